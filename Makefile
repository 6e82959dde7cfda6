# A fresh machine needs Python 3.11 (or later) and make; every target sets up its own .venv first.
PYTHON ?= python3
BIN := .venv/bin
SETUP := .venv/.set-up

.PHONY: demo test bench lint hidden

$(SETUP): pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $(SETUP)

demo: $(SETUP)
	$(BIN)/python sample_data/demo.py

test: $(SETUP)
	$(BIN)/python -m pytest -n 2

bench: $(SETUP)
	$(BIN)/python -m benchmarks

hidden: $(SETUP)
	$(BIN)/python -m benchmarks.hidden

lint: $(SETUP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
