# make demo: run the main job; make paper: check the paper's tables; make test: run the tests;
# make lint: style, types, layers; make docs: the site, with the reference of every module;
# make pins: do the pinned versions install on the oldest Python that is allowed?;
# make mutants: would the tests notice faults?; make check-all: what takes too long for make test;
# make exam TOOL=...: the public exam of tools (docs/reference/exam.md);
# make processors: the kept results with the kernels of other processors, before a release.
# Each needs Python 3.11 or newer and nothing else: it makes .venv itself.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint .ci/constraints.txt
# BLAS threads fight over the small matrices of this project.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# Bytecode is kept, whatever the environment says: each process that the tests start would compile
# the package anew, and pytest would rewrite every test in every worker.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: exam demo paper pins test lowest lint golden format docs mutants processors check-all clean

demo: $(VENV)/run
	$(BIN)/identifiability demo

# Whether every pin installs on the oldest Python that pyproject.toml allows: nothing is installed.
pins: $(BIN)/python
	$(PIP) --dry-run --ignore-installed --target $(VENV)/nowhere --only-binary=:all: \
	  --python-version $$($(BIN)/python -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb")); print(p["project"]["requires-python"].removeprefix(">=") + ".0")') \
	  '.[test,lint,arviz,distributed,ros,excel,docs,browser,robots]'

paper: $(VENV)/run
	$(BIN)/identifiability paper

# TOOL names a tool, or is the path of an adapter; without it all tools run.
exam: $(VENV)/dev
	$(BIN)/python studies/public_exam.py $(if $(TOOL),--tool $(TOOL))

test: $(VENV)/dev
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -q $(PYTEST)

# Its virtual environment is its own: the lowest versions that pyproject.toml allows, Python 3.11.
lowest: .venv-lowest/run
	.venv-lowest/bin/python -m pytest --numprocesses 2 --dist worksteal -q $(PYTEST)

.venv-lowest/run: pyproject.toml .ci/lowest.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
	  { echo "the lowest versions are those for Python 3.11; say where it is: make lowest PYTHON=python3.11"; exit 1; }
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip --disable-pip-version-check install --quiet \
	  --constraint .ci/lowest.txt --editable '.[test,arviz,ros,excel,docs,browser,distributed]'
	@touch $@

# Whether today's results are those kept in tests/golden, to the last bit; GOLDEN=write makes them anew.
golden: $(VENV)/dev
	$(BIN)/python tests/golden/results.py $(or $(GOLDEN),check --exact)

lint: $(VENV)/dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/mypy --config-file studies/mypy.ini
	$(BIN)/lint-imports

format: $(VENV)/dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

mutants: $(VENV)/dev
	$(BIN)/python tests/mutants.py $(MUTANTS)

# Before each release: other processors sum in another order. SkylakeX's kernels need AVX-512.
processors: $(VENV)/dev
	for core in Prescott Haswell SkylakeX Zen; do \
	  if [ $$core = SkylakeX ] && ! grep -q avx512f /proc/cpuinfo; then \
	    echo "SkylakeX is not checked: this processor has no AVX-512"; continue; fi; \
	  OPENBLAS_CORETYPE=$$core $(BIN)/python tests/golden/results.py check || exit 1; done

# All mutants take hours; each day draws others.
check-all: PYTEST += --everything
check-all: MUTANTS := --draw 66 --seed $(shell date +%Y%m%d)
check-all: $(VENV)/robots lint test mutants

MODULES = $(shell find identifiability -name '*.py' ! -name __main__.py | \
  sed 's,/__init__,,; s,\.py$$,,; s,/,.,g' | sort)

# Links that lead nowhere are errors; NO_MKDOCS_2_WARNING: no advertisement for another program.
# An inherited field's annotation names what only its own module knows: it is printed as it stands.
docs: $(VENV)/dev
	$(BIN)/python docs/written.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	$(BIN)/python docs/gallery.py reports/docs/pages
	$(BIN)/python -W error::UserWarning -W 'ignore:The module specification' \
	  -W 'ignore:Error parsing type annotation' -m pdoc \
	  --docformat numpy --no-show-source --footer-text identifiability \
	  --output-directory reports/docs/modules $(MODULES)

# Public robot files, 131 MB, for tests that make test leaves out.
$(VENV)/robots: $(VENV)/dev
	$(PIP) --editable '.[robots]'
	@touch $@

clean:
	rm -rf $(VENV) .venv-lowest .mypy_cache .ruff_cache .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "identifiability needs Python 3.11 or newer; say which with: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# What is never imported is not compiled: a fifth of the install.
$(VENV)/run: pyproject.toml .ci/constraints.txt | $(BIN)/python
	$(PIP) --no-compile --editable .
	@touch $@

$(VENV)/dev: pyproject.toml .ci/constraints.txt | $(BIN)/python
	$(PIP) --editable '.[test,lint,arviz,distributed,ros,excel,docs,browser]'
	@touch $@ $(VENV)/run
