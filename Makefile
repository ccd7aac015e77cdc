# aerojax: every target creates .venv by itself; only python3 and make are needed.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed
CLIENTS := $(VENV)/.clients

.PHONY: run test test-all test-fast check bench docs wheel venv clients format clean

venv: $(STAMP)

$(STAMP): requirements.lock pyproject.toml setup.py
	@test -x $(PY) || $(PYTHON) -m venv $(VENV)
	@echo "installing the locked packages (about a minute)"
	@$(PY) -m pip install --quiet --disable-pip-version-check -r requirements.lock
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $(STAMP)

# The tools that read the exports in tests. One of them asks for opencv-python, which would overwrite the headless one.
clients: $(CLIENTS)

$(CLIENTS): $(STAMP) requirements.clients.lock
	@echo "installing the tools that read the exports"
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps -r requirements.clients.lock
	@touch $(CLIENTS)

run: venv
	$(PY) -m experiments.classify

test: clients
	$(PY) -m pytest -n auto --dist loadfile -m "not long"

test-all: clients
	$(PY) -m pytest -n auto --dist loadfile

test-fast: clients
	$(PY) -m pytest -n auto --dist loadfile -m "not slow and not long"

check: venv
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/pyrefly check
	$(PY) -m pytest tests/test_architecture.py tests/test_configs.py tests/test_docs.py

format: venv
	$(VENV)/bin/ruff format .
	$(VENV)/bin/ruff check --fix .

docs: venv
	$(PY) docs/make_api.py
	$(PY) docs/make_results.py

wheel: venv
	$(PY) -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

bench: venv
	$(PY) -m experiments.benchmark

clean:
	rm -rf $(VENV) build dist *.egg-info
