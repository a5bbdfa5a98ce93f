# `make` alone lists the targets. Everything is installed in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help demo test test-oldest test-newer coverage check format docs bench integrations soak deb deb-same screens page clean

help: ## Print this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(VENV)/.demo: pyproject.toml
	@echo 'Setting up $(VENV), once: this needs a package index (PyPI, or the one pip is configured for) and takes a minute.'
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "needs Python 3.11 or newer: make PYTHON=python3.12 demo")'
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --editable '.[demo,web]' || { echo 'Setting up failed; see above. Is a package index within reach?' >&2; exit 1; }
	@touch $@

$(VENV)/.dev: $(VENV)/.demo
	@echo 'Installing the tools for tests and checks into $(VENV), once.'
	@$(BIN)/pip install --editable '.[demo,web,dev]'
	@touch $@

demo: $(VENV)/.demo ## Show it at work: simulated line, broker, daemon; no hardware needed
	@$(BIN)/lfs10d demo

# Many tests wait for brokers, pseudo terminals and daemons: all WORKERS but one run those, the last one computes at a
# lower priority (tests/support/sharing.py).
# Each of the hundreds of processes finds the modules compiled, also where PYTHONDONTWRITEBYTECODE is set.
WORKERS ?= 6
test test-oldest: export PYTHONDONTWRITEBYTECODE :=
test: $(VENV)/.dev ## Run all tests
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

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

test-oldest: $(OLDEST)/.installed ## Run the tests of the lowest dependency versions
	$(OLDEST)/bin/python -m pytest -q -n 3 --dist load $(TESTED_OLDEST)

# With another Python than that of .venv, in an environment of its own: what needs no other program, and is quick.
NEWER := $(VENV)/newer
TESTED_NEWER := tests/schema tests/config tests/modbus tests/profiles tests/telemetry tests/outbox tests/commands tests/reconfiguration

test-newer: ## Run the pure tests with another Python: PYTHON=python3.13
	@$(PYTHON) -m venv --clear $(NEWER)
	@$(NEWER)/bin/pip install --quiet --editable . 'pytest>=8.3,<10' 'pytest-xdist>=3.6.1,<4' 'hypothesis>=6.112,<7'
	$(NEWER)/bin/python -m pytest -q -n 2 --dist loadfile -m 'not long' $(TESTED_NEWER)

# Fails below 100 % of lines and branches.
coverage: $(VENV)/.dev ## Check that pure modules are covered by their own tests
	$(BIN)/python -m tests.own_coverage

check: $(VENV)/.dev ## Check format, lint, types and imports
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.dev ## Format the code and fix what ruff can fix
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(VENV)/.dev ## Write the generated pages of docs/
	$(BIN)/python -m docs.generate

bench: $(VENV)/.dev ## Measure against a master in C on a paced line (20 minutes)
	$(BIN)/python -m bench

# Telegraf, Node-RED, weewx, Prometheus, VictoriaMetrics and PostgreSQL are too large for CI: those installed are run.
integrations: $(VENV)/.dev ## Run the recipes of docs/integrations (10 minutes): ONLY="telegraf weewx"
	$(BIN)/python -m integrations $(ONLY)

soak: $(VENV)/.dev ## Account for every sample under faults: FOR=12h SEED=7
	$(BIN)/python -m soak --for $(or $(FOR),5m) --exchanges $(or $(EXCHANGES),1000000) $(if $(SEED),--seed $(SEED))

deb: $(VENV)/.demo ## Build the Debian package into dist/: SUITE=trixie or SUITE=bookworm
	packaging/build-deb $(or $(SUITE),trixie)

deb-same: $(VENV)/.demo ## Build the Debian package twice and compare the bytes: SUITE=trixie or SUITE=bookworm
	packaging/same-bytes $(or $(SUITE),trixie)

screens: $(VENV)/.dev ## Write a screenshot of every state of the page to screens/, and check its accessibility (5 minutes; needs chromium)
	$(BIN)/python -m tests.web.screens screens

# Not in CI: two adoptions and thirty outages take minutes.
page: $(VENV)/.dev ## Mount two sensors on a phone-sized page, and time what it shows of outages (5 minutes; needs chromium)
	$(BIN)/python -m tests.web.live screens

clean: ## Remove .venv and built files
	rm -rf $(VENV) bench/build build dist
