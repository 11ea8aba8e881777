# softseam: `make demo` and `make test` need Python >= 3.11 and make, nothing else.

SHELL := /bin/sh
.DEFAULT_GOAL := help
.PHONY: help demo dev fast chart rivals lifts references plans atlas claims shapes front results pages figures course bus faults pbd batch test lint types lock clean

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)
VENV := .venv
PY := $(VENV)/bin/python
SOURCES := protocol coupling services clients tests docs
PIP := $(PY) -m pip --disable-pip-version-check --quiet

# what is installed is translated when it is first imported, and kept; else each of many processes would do it again
unexport PYTHONDONTWRITEBYTECODE

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18

demo: $(VENV)/.run ## grasp a block of tofu with real processes; leaves recording, report and pictures in out/
	@$(VENV)/bin/softseam demo

dev: $(VENV)/.dev ## install what contributors need: solvers, viewers, pytest, ruff, mypy
	@echo "tests while you work: make fast; every gate: make test"

fast: $(VENV)/.dev ## the tests that enter no compiled kernel, some 2,400
	@$(PY) -m pytest -q -n 2 --dist loadfile -m fast tests/unit tests/contract tests/analysis

chart: $(VENV)/.dev ## regenerate docs/results/chart.md: accuracy against speed on this machine
	@$(PY) tests/benchmarks/chart.py

rivals: $(VENV)/.dev ## measure other simulators, installed in out/, for the marks in docs/results/chart.md
	@PYTHONPATH=tests $(PY) tests/benchmarks/rivals.py

lifts: $(VENV)/.dev ## regenerate docs/results/lifts.md: many lifts at once, beside MuJoCo's flex
	@PYTHONPATH=tests $(PY) tests/benchmarks/lifts.py

references: $(VENV)/.dev ## make the references that ship with the scenes anew: hours
	@PYTHONPATH=tests $(PY) tests/benchmarks/truths.py

plans: $(VENV)/.dev ## regenerate docs/results/plans.md: are plans right, and as cheap as can be?
	@PYTHONPATH=tests $(PY) tests/benchmarks/plans.py

atlas: $(VENV)/.dev ## regenerate docs/results/atlas.md: stability where methods fail
	@PYTHONPATH=tests $(PY) tests/benchmarks/atlas.py

claims: $(VENV)/.dev ## regenerate docs/results/claims.md: do claims of runs hold?
	@PYTHONPATH=tests $(PY) tests/benchmarks/claims.py

shapes: $(VENV)/.dev ## regenerate docs/results/shapes.md: how exact and how fast bodies from meshes are
	@PYTHONPATH=tests $(PY) tests/benchmarks/shapes.py

front: $(VENV)/.dev ## regenerate docs/results/front.md: what each of many bodies is best simulated as (RIVALS=1: other simulators, too; RIVALS=pybullet: that one again)
	@PYTHONPATH=tests $(PY) tests/benchmarks/front.py $(if $(RIVALS),--rivals $(filter-out 1,$(RIVALS)))

results: chart atlas ## regenerate docs/results/results.md, with charts and atlas: accuracy, speed and stability on this machine
	@PYTHONPATH=tests $(PY) tests/benchmarks/results.py

pages: $(VENV)/.dev ## write docs/reference/ from the code: Python, command line, messages
	@PYTHONPATH=tests $(PY) -m pages

figures: $(VENV)/.dev ## draw the pictures of docs/concepts/
	@PYTHONPATH=tests $(PY) -m pages.figures

course: $(VENV)/.dev ## run the lessons of docs/course/ and draw their pictures
	@for lesson in locking pbd_stiffness xpbd_substeps two_models accuracy_speed terzopoulos; do \
		$(PY) docs/course/$$lesson.py docs/pictures/course_$$lesson.png || exit 1; done

bus: $(VENV)/.dev ## measure what the bus costs on this machine
	@$(PY) tests/benchmarks/bus.py

faults: $(VENV)/.dev ## kill and freeze services a hundred times under clients: the same bits, whole recordings
	@$(PY) tests/benchmarks/faults.py

pbd: $(VENV)/.dev ## measure how fast the PBD participant is on this machine
	@NUMBA_NRT_STATS=1 PYTHONPATH=tests $(PY) tests/benchmarks/pbd.py
	@NUMBA_NRT_STATS=1 PYTHONPATH=tests $(PY) tests/benchmarks/particles.py

batch: $(VENV)/.dev ## measure how many actions a second many pieces take on this machine
	@PYTHONPATH=tests $(PY) tests/benchmarks/batch.py

test: $(VENV)/.dev ## every gate: format, lint, fast tests, types, layers, all other tests
	@sh .ci/gates $(PY)

lint: $(VENV)/.dev ## format and lint the sources in place
	@$(PY) -m ruff format $(SOURCES)
	@$(PY) -m ruff check --fix $(SOURCES)

types: $(VENV)/.dev ## strict type check
	@$(PY) -m mypy

lock: ## resolve requirements.lock and requirements-dev.lock anew
	@sh .ci/lock "$(PYTHON)"

clean: ## remove the environment, caches and outputs
	rm -rf $(VENV) build dist out .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find $(SOURCES) -name __pycache__ -type d -prune -exec rm -rf {} +

$(PY):
	@test -n "$(PYTHON)" || { echo "softseam needs Python 3.11 or newer: install it, or say where it is: make PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "$(PYTHON) is not Python 3.11 or newer: make PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "$(PYTHON) cannot make virtual environments: its distribution ships ensurepip apart." >&2; \
		echo "On Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@echo "creating $(VENV) with $$($(PYTHON) --version)"
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# A stamp is newer than its lock once the lock is installed; pyproject.toml names the entry points. Python translates the
# modules that are imported, as they are; pip would translate them all, one after the other, for a third of its time.
$(VENV)/.run: requirements.lock pyproject.toml | $(PY)
	@echo "installing what $< pins (some 250 MB the first time)"
	@$(PIP) install --no-compile --require-hashes -r $<
	@$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/.dev: requirements-dev.lock pyproject.toml | $(PY)
	@echo "installing what $< pins (some 330 MB the first time)"
	@$(PIP) install --no-compile --require-hashes -r $<
	@$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@ $(VENV)/.run
