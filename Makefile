# davinci-forces: `make help` lists what can be made.  Every target sets up .venv first.
PYTHON ?= python3
STUDY ?=
JOBS ?= 1
TESTS ?=
WORKERS ?= auto
SEED ?= 0
COUNT ?= 20

ifeq ($(OS),Windows_NT)
BIN := .venv/Scripts
else
BIN := .venv/bin
endif
RUN := $(BIN)/davinci-forces
READY := .venv/ready
READY_TO_TEST := .venv/ready-to-test
READY_TO_CHECK := .venv/ready-to-check
READY_TO_COMPARE := .venv/ready-to-compare
INSTALL := $(BIN)/python .ci/install.py
PINNED := $(INSTALL) --require-hashes -r
# A file's tests share what they analyse and compile, so a file stays in one process.  Processes share the bytecode of
# the package, without which each of them takes seconds more to begin.
PYTEST := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
LOCK := uv pip compile -q --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header
UPGRADE ?=

PACKAGE := pipeline/davinci_forces
# Every module of stages/ is a stage, and its folders are groups of them.  README.md says what each makes.
MODULES := $(wildcard $(PACKAGE)/stages/*.py $(PACKAGE)/stages/*/*.py)
STAGES := $(subst _,-,$(filter-out __init__,$(basename $(notdir $(MODULES))))) report
GROUPS := $(notdir $(patsubst %/__init__.py,%,$(wildcard $(PACKAGE)/stages/*/__init__.py)))

# Compiled files of rooms that are no more would keep their folders alive, and importable.
define FORGET
import pathlib, shutil
for cache in [*pathlib.Path("pipeline").rglob("__pycache__")]:
    if not any(cache.parent.glob("*.py")):
        shutil.rmtree(cache)
for folder in sorted((f for f in pathlib.Path("pipeline").rglob("*") if f.is_dir()), reverse=True):
    if not any(folder.iterdir()):
        folder.rmdir()
endef
export FORGET

.PHONY: all install quick test check every-test format lint types oracles axe approve bench mutants locks demo pictures clean help $(STAGES) $(GROUPS)

all: $(READY) ## analyse every study in raw/ whose logs are here (STUDY=raw/x for one, JOBS=n for processes)
	$(RUN) all $(STUDY) --jobs $(JOBS)

install: $(READY) ## set up .venv, and no more

$(STAGES) $(GROUPS): $(READY)
	$(RUN) $@ $(or $(STUDY),raw/davinci-demo) --jobs $(JOBS)

quick: $(READY_TO_TEST) ## run the tests that take moments, for while you work
	$(PYTEST) -m "not medium and not slow" $(TESTS)

test: $(READY_TO_TEST) ## run the tests (TESTS=--slow for the longest studies, too; WORKERS=n for processes)
	$(PYTEST) $(TESTS)

check: lint types every-test ## what continuous integration checks: format, lint, types, and every test (-j2: at once)

every-test: oracles axe
	$(MAKE) --no-print-directory test TESTS=--slow

format: $(READY_TO_CHECK) ## lay out the code, and mend what the linter can
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lint: $(READY_TO_CHECK) ## say where the code is not laid out or breaks a rule
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(READY_TO_CHECK) ## check the types
	$(BIN)/mypy

oracles: $(READY_TO_COMPARE) ## install what tests compare with, where it is there: Pinocchio

axe: ## install what tests judge the accessibility of a report with, where npm is there
	@if command -v npm >/dev/null; then npm ci --silent --fetch-retries 1 --fetch-retry-mintimeout 1000 --prefix tests/report || echo "axe could not be installed"; else echo "no npm, so no axe"; fi

bench: $(READY_TO_TEST) $(READY_TO_COMPARE) ## the benchmarks at full size, against their rivals
	$(BIN)/python -m pytest tests/benchmarks --full -s

approve: $(READY_TO_TEST) ## keep the numbers and pages of the small studies, after you have looked at what changed
	$(BIN)/python -m pytest -q tests/contracts/test_approved.py --approve

mutants: $(READY_TO_TEST) ## change the code in COUNT places, and see whether tests notice (SEED=n for others)
	PYTHONPATH=pipeline $(BIN)/python -m tests.mutants --seed $(SEED) --count $(COUNT)

locks: ## pin anew what the project needs, by uv (UPGRADE=--upgrade for newer versions)
	$(LOCK) $(UPGRADE) pyproject.toml --group build -o requirements.lock
	$(LOCK) $(UPGRADE) --group install -o .ci/install.lock
	$(LOCK) $(UPGRADE) --group test -c requirements.lock -o tests/test.lock
	$(LOCK) $(UPGRADE) --group check -c requirements.lock -o tests/check.lock
	$(LOCK) $(UPGRADE) --group oracles -c requirements.lock -o tests/oracles.lock

demo: $(READY) ## simulate the demonstration study anew
	$(RUN) simulate davinci-demo raw/davinci-demo --force

pictures: ## draw the README's pictures anew, from the report of the demonstration study (needs pdftoppm)
	pdftoppm -r 65 -f 1 -singlefile -png reports/davinci-demo/report.pdf $(PACKAGE)/report/pictures/page-one
	pdftoppm -r 65 -f 10 -singlefile -png reports/davinci-demo/report.pdf $(PACKAGE)/report/pictures/joint

clean: ## remove what was made: the results of every study, and the environment
	rm -rf .venv build *.egg-info processed/* reports/*

help: ## list what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):[^#]*## /  \1\t/' | expand -t 12
	@echo "  one stage of STUDY (raw/davinci-demo unless given), and what it needs: $(STAGES)"
	@echo "  or one group of stages: $(GROUPS)"

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "davinci-forces needs Python 3.11 or later; run: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "Python cannot make environments here; on Debian and Ubuntu run: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(PINNED) requirements.lock
	@$(BIN)/python -c "$$FORGET"
	$(INSTALL) --no-build-isolation -e .
	@$(INSTALL) --slim
	@touch $@

$(READY_TO_TEST): $(READY) tests/test.lock
	$(PINNED) tests/test.lock
	@touch $@

$(READY_TO_CHECK): $(READY_TO_TEST) tests/check.lock
	$(PINNED) tests/check.lock
	@touch $@

$(READY_TO_COMPARE): $(READY_TO_TEST) tests/oracles.lock
	$(PINNED) tests/oracles.lock
	@touch $@
