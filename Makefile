PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

# Bytecode is kept even where the environment says otherwise: a process that has to compile the
# project's modules again takes two seconds longer to start, and each study starts several.
export PYTHONDONTWRITEBYTECODE :=

# The studies of the paper's claims, the longest first, and all others; the experiment `smoke` repeats
# the paper's.
STUDIES := telescope paper calibration sensitivity in_cell
OTHERS := $(filter-out $(STUDIES) smoke,$(basename $(notdir $(wildcard conf/experiment/*.yaml))))

# Two studies run at a time, each on half of the cores: while one plans its points, waits for what they
# share or writes its tables, the other computes.
HALF := $(shell echo $$(( ($$(getconf _NPROCESSORS_ONLN) + 1) / 2 )))

# The longest first.
STRESS := $(addprefix tests/stress/,hydra14.sh storm.py plans.py long_tests.sh fuzz.py)
STRESS += $(filter-out $(STRESS),$(wildcard tests/stress/*.py tests/stress/*.sh))

# Each line of a study with its name, as another one runs beside it, and as soon as it is there: some
# versions of awk wait for thousands of characters.
SAY = (trap "" INT; while IFS= read -r line || [ -n "$$line" ]; do echo "$*: $$line"; done)

.PHONY: help install paper studies field figures report smoke test stress lint benchmark lock

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-9s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

install: .venv/installed ## install what running needs, without tools; EXTRAS="parquet excel" reads more formats
	@echo "installed: try $(BIN)/python experiments/infer.py demonstrations=FOLDER"

paper: $(READY) ## run what is missing of the paper's studies, draw their figures, write the report
	@$(MAKE) --no-print-directory --keep-going --jobs=2 $(STUDIES:%=study-%)
	$(BIN)/python -m paper_figures $(STUDIES)
	@$(MAKE) --no-print-directory report

study-%: $(READY)
	@bash -o pipefail -c '$(BIN)/python experiments/run.py -m experiment=$* workers=$(HALF) sweep.replace=true 2>&1 | $(SAY)'

studies: $(READY) ## run what is missing of all other studies, and draw their figures
	@set -e; for each in $(OTHERS); do \
		echo "=== study $$each"; \
		$(BIN)/python experiments/run.py -m experiment=$$each sweep.replace=true; \
		$(BIN)/python -m paper_figures $$each; \
	done
	@$(BIN)/python -m experiments.success_rule

field: $(READY) ## run the benchmark of methods and worlds: results/field/LEADERBOARD.md
	$(BIN)/python -m experiments.field

figures: $(READY) ## draw all figures and write the report again, from the tables alone
	$(BIN)/python -m paper_figures
	@$(MAKE) --no-print-directory report

report: $(READY) ## write results/paper/REPORT.md and .html
	$(BIN)/python -m paper_figures.report

smoke: $(READY) ## run, draw and report every study, tiny, in results/smoke
	@$(MAKE) --no-print-directory --jobs=2 $(patsubst %,smoke-%,$(STUDIES) $(OTHERS))
	$(BIN)/python -m paper_figures --results results/smoke $(STUDIES) $(OTHERS)
	$(BIN)/python -m paper_figures.report --results results/smoke
	$(BIN)/python -m experiments.field --seeds 1 --demonstrations 3 --workers 1 --out results/smoke/field \
		--worlds "walls S3" "pendulum C1" "maze 3"

# One worker each: to start another takes longer than its share of such points.
smoke-%: $(READY)
	@bash -o pipefail -c '$(BIN)/python experiments/run.py -m experiment=$* scale=smoke study=$* workers=1 \
		sweep.replace=true results=$(CURDIR)/results/smoke 2>&1 | $(SAY)'

test: $(READY) ## run the tests, on all cores
	$(BIN)/python -m pytest -n logical --dist worksteal

# Two at a time, as most of them wait for processes and clocks.
stress: $(READY) ## run what is too long for the tests: kill storms, fuzzing, clusters, Hydra 1.4, slow oracles
	@$(MAKE) --no-print-directory --jobs=2 $(STRESS:tests/stress/%=stress-%)

stress-%: $(READY)
	@bash -o pipefail -c 'TIMEFORMAT="$*: took %0R s"; time { \
		case $* in *.py) $(BIN)/python tests/stress/$*;; *) tests/stress/$*;; esac; } 2>&1 | $(SAY)'

lint: $(READY) ## check style, formatting and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy mlci experiments

# SCALE=6d runs one task in six dimensions instead, of which every core takes a part.
benchmark: $(READY) ## time the project against other packages and floors
	$(BIN)/python -m tests.benchmark$(if $(SCALE),.$(SCALE:6d=six_dimensions))

# All extras but the benchmark's peers, which weigh gigabytes.
LOCKED := parquet excel mocap slurm dask dev

lock: $(READY) ## write requirements.lock from pyproject.toml, at the newest versions
	$(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
		$(LOCKED:%=--extra %) --custom-compile-command "make lock" --output-file requirements.lock pyproject.toml

# Packages without a wheel are built with the locked setuptools, which therefore comes first. A stamp is
# written last: an installation that failed halfway is tried again.
PIP := $(BIN)/python -m pip --disable-pip-version-check
INSTALL := $(PIP) install --no-build-isolation

define environment
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	echo "mlci needs Python 3.11 or newer, and $(PYTHON) is not: try make PYTHON=python3.12" >&2; \
	exit 1; }
$(PYTHON) -m venv .venv
sed -n '/^setuptools==/,/# via/p' requirements.lock > .venv/setuptools.lock
$(INSTALL) --quiet --requirement .venv/setuptools.lock
endef

$(READY): requirements.lock pyproject.toml
	$(environment)
	$(INSTALL) --requirement requirements.lock
	$(INSTALL) --quiet --no-deps --editable .
	$(BIN)/python -m mlci.precompile
	@touch .venv/installed $@

.venv/installed: requirements.lock pyproject.toml
	$(environment)
	$(BIN)/python .ci/needed.py $(EXTRAS) > .venv/needed.lock
	$(INSTALL) --requirement .venv/needed.lock
	$(INSTALL) --quiet --no-deps --editable .
	$(BIN)/python -m mlci.precompile
	@test -e $(READY) || $(PIP) uninstall --quiet --yes setuptools
	@touch $@
