# Every target sets up its own virtual environment first.
#   make train ARGS='--resume'        ARGS passes flags on
#   make EXTRAS=test,cuda12 train     for a CUDA GPU
PYTHON ?= python3
VENV ?= .venv
EXTRAS ?= test
CHECKPOINT ?= ckpt
BIN := $(VENV)/bin

.PHONY: train test test-all eval lint setup

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

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

setup: $(VENV)/installed-$(EXTRAS)

$(VENV)/installed-$(EXTRAS): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	touch $@
