# Every target sets up its own virtual environment first.
#   make train ARGS='--resume'        ARGS passes flags on
#   make EXTRAS=test,cuda12 train     for a CUDA GPU
PYTHON ?= python3
VENV ?= .venv
EXTRAS ?= test
CHECKPOINT ?= ckpt
BIN := $(VENV)/bin

.PHONY: train test test-all test-peers mutants eval lint types coverage hooks docs setup

train: setup
	$(BIN)/python train.py --num-envs 2048 --checkpoint $(CHECKPOINT) $(ARGS)

eval: setup
	$(BIN)/python eval.py --checkpoint $(CHECKPOINT) $(ARGS)

test: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal --durations 20 --durations-min 5 $(ARGS)

# The suite on every supported Python that is here, each with the newest JAX it can have.
test-all:
	for version in 3.11 3.12 3.13; do \
	    if python$$version -c '' 2>/dev/null; then \
	        $(MAKE) test PYTHON=python$$version VENV=$(VENV)-$$version || exit 1; \
	    else \
	        echo "python$$version is not here: skipped"; \
	    fi; \
	done

# The libraries of docs/peers.md: those on Gymnasium, then those on gymnax; each group where its own
# pins fit. PyTorch's wheels for Linux bring 2.3 GB of CUDA. Where pip would take those, it is left
# out, with what needs it. An index of CPU builds can be named by PIP_EXTRA_INDEX_URL, or a build by
# TORCH (as TORCH=torch==2.13.0 where pip finds a CPU build of that); CUDA=1 takes what there is.
TORCH ?= torch
CUDA ?=
TORCH_CLIENTS := stable-baselines3 sb3-contrib sbx-rl tianshou torchrl skrl
PIP = $(@D)/bin/python -m pip --disable-pip-version-check

test-peers: $(VENV)-gym/installed $(VENV)-rejax/installed
	$(VENV)-gym/bin/python -m pytest tests/wrappers/test_gymnasium*.py tests/wrappers/test_rendering.py \
	    tests/wrappers/test_sb3.py tests/wrappers/test_clients.py tests/test_docs.py::test_python_runs \
	    attjax/wrappers/gymnasium attjax/wrappers/sb3.py $(ARGS)
	$(VENV)-rejax/bin/python -m pytest tests/wrappers/test_gymnax*.py tests/test_docs.py::test_python_runs \
	    attjax/wrappers/gymnax.py $(ARGS)

$(VENV)-gym/installed: pyproject.toml
	$(PYTHON) -m venv $(@D)
	$(PIP) --quiet install --editable '.[test,gym]' 'gymnasium[other]' pygame
	if [ -z "$(CUDA)" ] && $(PIP) install --dry-run $(TORCH) | grep -q nvidia; then \
	    echo "left out: PyTorch, which here would bring CUDA, and its clients; see the Makefile"; \
	else \
	    $(PIP) --quiet install $(TORCH) $(TORCH_CLIENTS); \
	fi
	touch $@

$(VENV)-rejax/installed: pyproject.toml
	$(PYTHON) -m venv $(@D)
	$(PIP) --quiet install --editable '.[test]' gymnax rejax evosax brax stoa-env
	touch $@

# The tests are tried on broken code; ARGS='--modules losses reward' for a part of it.
mutants: $(VENV)/installed-mutation
	$(BIN)/python tests/mutation/mutants.py $(ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/python -m mypy

# The lines and branches of attjax/ that the tests run; with those missed, as HTML in site/coverage.
# Compiled functions count where JAX traces them.
coverage: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal --cov --cov-report=term-missing --cov-report=html $(ARGS)

# What .pre-commit-config.yaml checks before each commit, in this environment and without a network.
hooks: $(VENV)/installed-dev
	$(BIN)/pre-commit install

# The API reference, from the docstrings, as HTML in site/.
docs: $(VENV)/installed-docs,plot,onnx,gym
	$(BIN)/python docs/reference.py site

setup: $(VENV)/installed-$(EXTRAS)

$(VENV)/installed-%: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	touch $@
