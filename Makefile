# Every target sets up its own virtual environment first.
#   make train ARGS='--resume'        ARGS passes flags on
#   make EXTRAS=test,cuda12 train     for a CUDA GPU
PYTHON ?= python3
VENV ?= .venv
EXTRAS ?= test
CHECKPOINT ?= ckpt
BIN := $(VENV)/bin

.PHONY: train test test-all test-peers mutants eval lint docs setup

train: setup
	$(BIN)/python train.py --num-envs 2048 --checkpoint $(CHECKPOINT) $(ARGS)

eval: setup
	$(BIN)/python eval.py --checkpoint $(CHECKPOINT) $(ARGS)

test: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal $(ARGS)

# The suite on every supported Python that is here, each with the newest JAX it can have.
test-all:
	for version in 3.11 3.12 3.13; do \
	    if python$$version -c '' 2>/dev/null; then \
	        $(MAKE) test PYTHON=python$$version VENV=$(VENV)-$$version || exit 1; \
	    else \
	        echo "python$$version is not here: skipped"; \
	    fi; \
	done

# Gymnasium and Stable-Baselines3, then gymnax and rejax: each pair where its own pins fit. PyTorch's
# default Linux wheels hold CUDA; PIP_EXTRA_INDEX_URL can name an index of smaller ones.
test-peers: $(VENV)-gym/installed $(VENV)-rejax/installed
	$(VENV)-gym/bin/python -m pytest tests/test_gymnasium.py tests/test_sb3.py \
	    tests/test_docs.py::test_python_runs attjax/gymnasium_env.py attjax/sb3.py $(ARGS)
	$(VENV)-rejax/bin/python -m pytest tests/test_gymnax.py tests/test_gymnasium.py \
	    tests/test_docs.py::test_python_runs attjax/gymnax_compat.py $(ARGS)

$(VENV)-gym/installed: PACKAGES = '.[test,gym]' torch stable-baselines3
$(VENV)-rejax/installed: PACKAGES = '.[test]' gymnax rejax
$(VENV)-gym/installed $(VENV)-rejax/installed: pyproject.toml
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet --disable-pip-version-check --editable $(PACKAGES)
	touch $@

# The tests are tried on broken code; ARGS='--modules losses reward' for a part of it.
mutants: $(VENV)/installed-mutation
	$(BIN)/python tests/mutants.py $(ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# The API reference, from the docstrings, as HTML in site/.
docs: $(VENV)/installed-docs,plot,onnx,gym
	$(BIN)/python docs/reference.py site

setup: $(VENV)/installed-$(EXTRAS)

$(VENV)/installed-%: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	touch $@
