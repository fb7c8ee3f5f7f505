# davinci-forces: `make help` lists what can be made.  Every target sets up .venv first.
PYTHON ?= python3
STUDY ?=
JOBS ?= 1
TESTS ?=

ifeq ($(OS),Windows_NT)
BIN := .venv/Scripts
else
BIN := .venv/bin
endif
RUN := $(BIN)/davinci-forces
READY := .venv/ready
CHECKED := .venv/checked
PIP := $(BIN)/python -m pip --disable-pip-version-check -q

# One line a stage: what it reads, and what it makes.
STAGES := design ingest resample average differentiate fit predict ekf whiteness report
# design        : robot -> Links Pose Workspace Control Lyapunov Excitation
# ingest        : logs -> Recording LogSummary Diagnostic
# resample      : Recording -> Signal Diagnostic
# average       : Signal -> Average PeriodResidual Diagnostic
# differentiate : Average -> Trajectory Spectrum Diagnostic
# fit           : Trajectory -> Fit Residual Diagnostic
# predict       : Signal Trajectory Fit -> Prediction Diagnostic
# ekf           : Signal Fit Average -> Track Diagnostic
# whiteness     : PeriodResidual Residual Track -> Whiteness
# report        : everything -> report.html report.pdf results.json

.PHONY: all test check bench demo clean help $(STAGES)

all: $(READY) ## analyse every study in raw/ whose logs are here (STUDY=raw/x for one, JOBS=n for processes)
	$(RUN) all $(STUDY) --jobs $(JOBS)

$(STAGES): $(READY)
	$(RUN) $@ $(or $(STUDY),raw/davinci-demo) --jobs $(JOBS)

test: $(READY) ## run the tests (TESTS=--slow for the long studies, too)
	$(BIN)/python -m pytest $(TESTS)

check: $(CHECKED) ## format, lint, types, tests, slow ones included
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest --slow

bench: $(CHECKED) ## the benchmarks at full size, against their rivals
	$(PIP) install --require-hashes --no-deps -r tests/benchmarks/rivals.lock
	$(BIN)/python -m pytest tests/benchmarks --full -s

demo: $(READY) ## simulate the demonstration study anew
	$(RUN) simulate davinci-demo raw/davinci-demo --force

clean: ## remove what was made: processed files, reports, environment
	rm -rf .venv build *.egg-info processed/* reports/*

help: ## list what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):[^#]*## /  \1\t/' | expand -t 12
	@echo "  one stage of STUDY (raw/davinci-demo unless given): $(STAGES)"

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "davinci-forces needs Python 3.11 or later; run: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "Python cannot make environments here; on Debian and Ubuntu run: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(PIP) install --require-hashes --no-deps -r requirements.lock
	$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@

$(CHECKED): $(READY) tests/check.lock
	$(PIP) install --require-hashes --no-deps -r tests/check.lock
	@touch $@
