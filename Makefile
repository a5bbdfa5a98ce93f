# make demo | make test | make check | make docs | make bench | make soak: what a newcomer types.
# Everything lives in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: demo test test-oldest coverage check format docs bench soak clean

$(VENV)/.demo: pyproject.toml
	@echo 'Setting up $(VENV), once; this takes a moment.'
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "needs Python 3.11 or newer: make PYTHON=python3.12 demo")'
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --editable '.[demo]'
	@touch $@

$(VENV)/.dev: $(VENV)/.demo
	@$(BIN)/pip install --quiet --editable '.[demo,dev]'
	@touch $@

demo: $(VENV)/.demo
	@$(BIN)/lfs10d demo

# Most tests wait for brokers, ptys and daemons of their own: three workers share what the machine has.
test: $(VENV)/.dev
	$(BIN)/python -m pytest -n 3 --dist loadfile

# The ranges of pyproject.toml begin with versions that work: the lowest of each, in an environment of its own.
OLDEST := $(VENV)/oldest
TESTED_OLDEST := tests/mqtt tests/modbus tests/config/test_models.py tests/config/test_loader.py tests/config/test_validation.py \
  tests/schema/test_document.py tests/schema/test_fields.py tests/config/test_defaults.py

$(OLDEST)/.installed: pyproject.toml tests/oldest.py
	@$(PYTHON) -m venv --clear $(OLDEST)
	@$(PYTHON) -m tests.oldest >$(OLDEST)/requirements.txt
	@$(OLDEST)/bin/pip install --quiet --requirement $(OLDEST)/requirements.txt
	@$(OLDEST)/bin/pip install --quiet --no-deps --editable .
	@touch $@

test-oldest: $(OLDEST)/.installed
	$(OLDEST)/bin/python -m pytest -q -n 3 --dist load $(TESTED_OLDEST)

# Each pure module by its own tests alone; fails below 100 % of lines and branches.
coverage: $(VENV)/.dev
	$(BIN)/python -m tests.own_coverage

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(VENV)/.dev
	$(BIN)/python -m docs.generate

bench: $(VENV)/.dev
	$(BIN)/python -m bench

# make soak FOR=12h SEED=7; each has a default.
soak: $(VENV)/.dev
	$(BIN)/python -m soak --for $(or $(FOR),5m) --exchanges $(or $(EXCHANGES),1000000) $(if $(SEED),--seed $(SEED))

clean:
	rm -rf $(VENV) bench/build
