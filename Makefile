# The two commands of the README, and what the project's own checks run.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt
PYTEST := $(BIN)/pytest --numprocesses auto --maxprocesses 8 --dist loadfile

# Compiled modules are kept even where PYTHONDONTWRITEBYTECODE is set: the tests start some hundred processes, and each would
# compile again what has changed since the installation.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-types test-fast test-all test-browser docs bench trials clean

demo: $(VENV)/installed
	$(BIN)/winchcascade demo --out demo

test: $(VENV)/developing
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(MAKE) --no-print-directory --jobs 2 test-types test-fast

# mypy uses one processor: it runs beside the first tests.
test-types: $(VENV)/developing
	$(BIN)/mypy

test-fast: $(VENV)/developing
	$(PYTEST) -m "not slow"

# The slow tests, and the tests of properties once more with many more examples.
test-all: $(VENV)/developing
	$(PYTEST) --hypothesis-profile thorough -m "slow or hypothesis"

# The reports in a real browser; needs Chromium on the path.
test-browser: $(VENV)/developing
	$(INSTALL) -e ".[browser]"
	WINCHCASCADE_BROWSER=1 $(BIN)/pytest tests/report/test_browser.py

# The site of the documents, in site/; it loads nothing from the network.
docs: $(VENV)/installed
	$(INSTALL) -e ".[docs]"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

# One table of ratios in a quarter of an hour or less; make bench BENCH=--quick takes about a minute and is rougher.
bench: $(VENV)/developing
	$(BIN)/python benchmarks/bench.py $(BENCH)

# Scores of the diagnosis on campaigns of the twin; make trials TRIALS="--family nothing" does a part.
trials: $(VENV)/developing
	$(BIN)/python benchmarks/trials.py $(TRIALS)

# What a user installs; Python compiles a module when it is first imported, as most of these are not.
$(VENV)/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) -e .
	$(BIN)/python -m compileall -q winchcascade
	$(BIN)/python -m winchcascade.sea.machine_code
	@touch $@

# What the tests and the checks need besides.
$(VENV)/developing: $(VENV)/installed
	$(INSTALL) -e ".[dev]"
	@touch $@

clean:
	rm -rf $(VENV) demo build dist site
