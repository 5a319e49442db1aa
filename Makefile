# Needs git, make and a Python 3.11-3.14 with venv; everything else goes into .venv.
# Another Python: make clean, then make setup PYTHON=python3.12

PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
# After a worker's death xdist 3.8 waits for ever (its issue 784) unless none takes its place.
WORKERS := --numprocesses auto --dist loadfile --no-loadscope-reorder --max-worker-restart 0
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

# A sourced ROS installation must not leak into .venv; hundreds of processes start in the tests, and
# none should compile the package anew.
unexport PYTHONPATH PYTHONDONTWRITEBYTECODE

.PHONY: help setup run view paper pictures docs test lint check-pages tests test-long references bench lock clean

help: ## list these targets
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/  make \1\t\2/p' Makefile | expand -t 20

setup: $(STAMP) ## make .venv with everything in requirements.lock

run: setup ## run the TM21 noise sweep, then analyse its bag
	@$(BIN)/cam-rig run --analyze

view: setup ## show the newest bag in Rerun; ARGS=--web for a browser
	@$(BIN)/cam-rig view $(ARGS)

paper: setup ## run the paper's experiments, and build their report out/paper.html (6 minutes)
	@for name in stem flywheel as_cut refit readings timing factorial calibrate identify; do \
		echo "== $$name" && $(BIN)/python -m examples.paper.$$name || exit 1; done
	@$(BIN)/python -m examples.paper.report

pictures: setup ## run the sweep, and draw the pictures in docs/ from its bag
	@rm -rf out/pictures
	@$(BIN)/cam-rig run --bag out/pictures
	@$(BIN)/python -m tools.docs.main out/pictures

docs: setup ## build the documents as a site into out/site (EDITION=student: without answers)
	@$(BIN)/python tools/docs/commands.py
	@$(BIN)/python tools/docs/parameters.py
	@$(BIN)/python tools/docs/results.py
	@$(BIN)/python tools/docs/drawings.py
	@EDITION=$(EDITION) NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet && echo 'out/site/index.html'

test: setup ## lint, types, import rules, tests
	@$(MAKE) --no-print-directory --jobs=2 lint tests

lint: setup ## lint, types, import rules alone; their words where one does not hold
	@words=$$({ $(BIN)/ruff check && $(BIN)/ruff format --check && $(BIN)/mypy && \
		$(BIN)/lint-imports; } 2>&1) && echo 'lint, types, import rules: all hold' || \
		{ printf '%s\n' "$$words"; exit 1; }

check-pages: ## types of the pages' JavaScript, by Node.js and npm
	@cd tools/pages && npm ci --silent && node_modules/.bin/tsc && echo "types of the pages: all hold"

tests: setup ## the tests alone
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest $(WORKERS)

test-long: setup ## all tests, with many more random cases (more than an hour)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest $(WORKERS) -m "" --hypothesis-profile=long --references=compute

references: setup ## compute the tests' many-digit references anew
	$(BIN)/python -m pytest --references=write -m ""

bench: setup ## speed against error, against other solvers: writes docs/accuracy.md, docs/develop/cost.md (5 minutes)
	@OMP_NUM_THREADS=1 $(BIN)/python -m benchmark.work_precision

lock: | $(BIN)/pip ## resolve requirements.lock anew (remove it first to raise every version)
	@$(PIP) install uv==0.13.8
	$(BIN)/uv pip compile setup.py --extra all --extra dask --extra ros-wheels --extra bench --extra docs --extra test --output-file requirements.lock \
		--universal --python-version 3.11 --fork-strategy fewest \
		--no-annotate --generate-hashes --custom-compile-command 'make lock' --quiet

clean: ## remove .venv and everything built; bags stay
	rm -rf .venv build install log tools/pages/node_modules *.egg-info .*_cache .hypothesis
	find cam_rig launch test -name __pycache__ -prune -exec rm -rf {} +

# pip is the last thing venv writes, so a half-made .venv is made again.
$(BIN)/pip:
	@command -v $(PYTHON) >/dev/null || { \
		echo 'cam_rig needs Python 3.11 to 3.14, and there is no $(PYTHON):' \
			'name one with PYTHON=...' >&2; exit 1; }
	@$(PYTHON) -c 'import platform as p, sys; v = sys.version_info[:2]; \
		(3, 11) <= v <= (3, 14) or sys.exit( \
			"cam_rig needs Python 3.11 to 3.14, and $(PYTHON) is %s: " \
			"name another with PYTHON=..." % p.python_version())'
	@echo 'Making .venv with $(PYTHON)'
	@$(PYTHON) -m venv --clear .venv

$(STAMP): requirements.lock package.xml setup.py setup.cfg | $(BIN)/pip
	@rm -f $@
	@echo 'Installing requirements.lock into .venv (about 1.4 GB the first time)'
	@$(PIP) install --require-hashes --requirement requirements.lock
	@# a path, which checkers of types follow, in place of a finder, which costs each start 10 ms
	@$(PIP) install --no-deps --no-build-isolation --config-settings editable_mode=compat --editable .
	@# without a C compiler plain Python is used, and the command says so
	@$(BIN)/python -m cam_rig.dynamics.events || true
	@touch $@
