# aerojax: every target creates .venv by itself; only python3 and make are needed.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed
CLIENTS := $(VENV)/.clients
SITE_TOOLS := $(VENV)/.site_tools
DEMO := runs/demo
AEROJAX := cd $(DEMO) && $(abspath $(VENV))/bin/aerojax

.PHONY: run demo test test-all test-fast check bench docs docs-site pictures wheel venv clients contrib site-tools format clean

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

# OpenCV with its contributed modules, for the tracker of B2-lite: in a folder of its own, because in the environment it
# would overwrite the headless one. Its tests are skipped without it.
contrib: venv
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps --upgrade --target build/contrib \
		opencv-contrib-python-headless==$$($(PY) -m pip list --format=freeze | sed -n 's/^opencv-python-headless==//p')
	PYTHONPATH=build/contrib $(PY) -m pytest -q tests/classify/images/test_tracked.py

site-tools: $(SITE_TOOLS)

$(SITE_TOOLS): $(STAMP) requirements.docs.lock
	@echo "installing what builds the documentation"
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps -r requirements.docs.lock
	@touch $(SITE_TOOLS)

run: venv
	$(PY) -m experiments.classify

# The whole chain on little data. Each step leaves its last file when it is done, and is not done again while that is there.
demo: $(DEMO)/classify/report.html
	@echo "the report: $(DEMO)/classify/report.html (delete $(DEMO) to do everything again)"

$(DEMO)/generate/metrics.json: | venv
	@mkdir -p $(DEMO)
	$(AEROJAX) generate_dataset preset=smoke rig=random hydra.run.dir=generate

$(DEMO)/reconstruct/metrics.json: $(DEMO)/generate/metrics.json
	$(AEROJAX) reconstruct_dataset preset=smoke hydra.run.dir=reconstruct

$(DEMO)/train/metrics.json: $(DEMO)/reconstruct/metrics.json
	$(AEROJAX) train_classifier preset=smoke hydra.run.dir=train

$(DEMO)/evaluate/results.json: $(DEMO)/train/metrics.json
	@rm -f $@  # of weights of before
	$(AEROJAX) measure_accuracy preset=smoke weights=train/weights.safetensors hydra.run.dir=evaluate

$(DEMO)/classify/report.html: $(DEMO)/evaluate/results.json
	$(AEROJAX) classify preset=smoke weights=train/weights.safetensors hydra.run.dir=classify

test: clients site-tools
	$(PY) -m pytest -n auto --dist loadfile -m "not long"

test-all: clients site-tools
	$(PY) -m pytest -n auto --dist loadfile

test-fast: clients site-tools
	$(PY) -m pytest -n auto --dist loadfile -m "not slow and not long"

check: site-tools
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

docs-site: site-tools
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet
	@echo "the site: build/site/index.html"

pictures: venv
	$(PY) docs/make_pictures.py

wheel: venv
	$(PY) -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

bench: venv
	$(PY) -m experiments.benchmark

clean:
	rm -rf $(VENV) build dist *.egg-info
