# The two commands of the README, and what the project's own checks run.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PYTEST := $(BIN)/pytest --numprocesses auto --maxprocesses 8 --dist loadfile

.PHONY: demo test test-all test-browser bench clean

demo: $(VENV)/installed
	$(BIN)/winchcascade demo --out demo

test: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(PYTEST) -m "not slow"

test-all: $(VENV)/installed
	$(PYTEST) -m slow

# The reports in a real browser; needs Chromium on the path.
test-browser: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[browser]"
	WINCHCASCADE_BROWSER=1 $(BIN)/pytest tests/report/test_browser.py

# One table of ratios in a quarter of an hour or less; make bench BENCH=--quick takes about a minute and is rougher.
bench: $(VENV)/installed
	$(BIN)/python benchmarks/all.py $(BENCH)

$(VENV)/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	$(BIN)/python -m compileall -q winchcascade
	@touch $@

clean:
	rm -rf $(VENV) demo build dist
