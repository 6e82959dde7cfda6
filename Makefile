# A fresh machine needs Python 3.11 (or later) and make; every target sets up its own .venv first.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: demo test test-slow test-extras test-versions coverage bench lint hidden nuisances calibration fuzz faults docs reference outputs gallery

# each target installs what it needs and no more: the demo the package with its pictures, the rest also the tools
.venv/bin/python:
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip

# installing compiles the loops over samples (tirelog/kernels), anew if one of them was edited
KERNELS := hatch_build.py tirelog/kernels/calls.json $(shell grep -rl '^@compiled' tirelog --include='*.py')
# and what the last build was made of, which has files that loops import
KERNELS += $(wildcard $(shell sed -n 's|^ *"\(.*\.py\)": .*|tirelog/\1|p' tirelog/kernels/_built.json 2> /dev/null))

.venv/.demo: pyproject.toml $(KERNELS) | .venv/bin/python
	$(BIN)/python -m pip install --quiet --editable ".[plot,report]"
	touch $@

.venv/.dev: pyproject.toml $(KERNELS) | .venv/bin/python
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

demo: .venv/.demo
	$(BIN)/python sample_data/demo.py

test: .venv/.dev
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m "not slow"

# the tests that take longest, some ten seconds and more each; CI runs them too
test-slow: .venv/.dev
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m slow

# the quick families on each Python that pyproject.toml allows and this machine has, each in its own
# .venv-VERSION; a version that is not there is said, and is no failure
VERSIONS := 3.11 3.12 3.13 3.14
QUICK := tests/test_errors.py tests/test_layers.py tests/data tests/tables tests/readers tests/dsp

test-versions:
	@for version in $(VERSIONS); do \
		if ! command -v python$$version > /dev/null || ! python$$version -c pass 2> /dev/null; then \
			echo "Python $$version: not on this machine"; continue; \
		fi; \
		echo "Python $$version:"; \
		test -x .venv-$$version/bin/python || python$$version -m venv .venv-$$version || exit 1; \
		.venv-$$version/bin/python -m pip install --quiet --editable ".[plot]" pytest hypothesis || exit 1; \
		.venv-$$version/bin/python -m pytest -q $(QUICK) || exit 1; \
	done

# logs that the libraries of the extras read: tests that `make test` passes over without them, in an
# environment of its own
test-extras:
	test -x .venv-extras/bin/python || $(PYTHON) -m venv .venv-extras
	.venv-extras/bin/python -m pip install --quiet --editable ".[formats]" pytest hypothesis
	.venv-extras/bin/python -m pytest -q tests/faults/test_extras.py \
		tests/readers/test_generated_layouts.py

# which lines no test runs; kernels run as plain Python, or their lines would all seem not to be run
coverage: .venv/.dev
	$(BIN)/python -m pip install --quiet coverage
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m coverage run -m pytest $(QUICK) tests/physics tests/faults
	$(BIN)/python -m coverage report

bench: .venv/.dev
	$(BIN)/python -m benchmarks

hidden: .venv/.dev
	$(BIN)/python -m benchmarks.hidden

# other tires and plans from seed 20000 on; NUISANCES="--seeds 1-4 --effects all" for others
nuisances: .venv/.dev
	$(BIN)/python -m benchmarks.nuisances $(NUISANCES)

# cases to calibrate a verdict's probability; CALIBRATION="--fit FILE.csv" makes the table of them
calibration: .venv/.dev
	$(BIN)/python -m benchmarks.calibration $(CALIBRATION)

# another seed each time; FUZZ="--seed 1 --only 17" carries one case out again
fuzz: .venv/.dev
	$(BIN)/python -m benchmarks.fuzz $(FUZZ)
	$(BIN)/python -m benchmarks.fuzz.kills

# what one fault in a clean log does to the tables; FAULTS="--suite reporting --seed 1 --logs 2"
faults: .venv/.dev
	$(BIN)/python -m benchmarks.faults $(FAULTS)

lint: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# the site in build/docs; reference pages, outputs and pictures are made first
docs: reference outputs gallery .venv-docs/.done
	.venv-docs/bin/sphinx-build -W -q docs build/docs
	@echo "open build/docs/index.html"

# reference pages and tables in pages, from the registers of the package
reference: .venv/.dev
	$(BIN)/python docs/generate.py

# what README.md and the pages show under their commands, and the pictures
outputs: .venv/.dev
	$(BIN)/python docs/outputs.py

# every figure of the papers that can be computed, redrawn: docs/gallery.md and its pictures
gallery: .venv/.dev
	$(BIN)/python docs/gallery.py

# the site's builder has an environment of its own: nothing of tirelog needs it
.venv-docs/.done: docs/requirements.txt
	$(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --requirement docs/requirements.txt
	touch $@
