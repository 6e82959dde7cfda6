# A fresh machine needs Python 3.11 (or later) and make; every target sets up its own .venv first.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: demo test bench lint hidden fuzz docs

# each target installs what it needs and no more: the demo the package with its pictures, the rest also the tools
.venv/bin/python:
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip

.venv/.demo: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install --quiet --editable ".[plot,report]"
	touch $@

.venv/.dev: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

demo: .venv/.demo
	$(BIN)/python sample_data/demo.py

test: .venv/.dev
	$(BIN)/python -m pytest -n 2 --dist loadgroup

bench: .venv/.dev
	$(BIN)/python -m benchmarks

hidden: .venv/.dev
	$(BIN)/python -m benchmarks.hidden

# another seed each time; FUZZ="--seed 1 --only 17" carries one case out again
fuzz: .venv/.dev
	$(BIN)/python -m benchmarks.fuzz $(FUZZ)
	$(BIN)/python -m benchmarks.fuzz.kills

lint: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# reference pages and README tables, from the registers of the package
docs: .venv/.dev
	$(BIN)/python docs/generate.py
