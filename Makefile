# Two commands for a fresh machine with Python 3.11 or newer, make and git: make demo, make test.
# The oldest Python of those that start and are new enough (those of pyenv may be there and not start).
OLDEST = for each in python3.11 python3 python3.12 python3.13 python3.14; do \
	"$$each" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$each" && break; done
PYTHON ?= $(or $(shell $(OLDEST)),$(error gpsfsm needs Python 3.11 or newer: make PYTHON=/path/to/python3.12))
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check
# The versions that everything was tried with; what users install is bounded by pyproject.toml only.
PINS := -c constraints.txt
# What is compiled is kept: else each of a thousand processes of the tests compiles all that it loads.
unexport PYTHONDONTWRITEBYTECODE PYTHONUNBUFFERED
# A variable of this name is for make: the tests begin faster where nothing seems to be set for Python.
unexport PYTHON
# ROS 2 for the tests, in an environment of its own. A Python of it marks the environment of its
# children with this variable, with which another one cannot start.
ROS := .venv-ros
ROS_PIP := $(ROS)/bin/pip --quiet --disable-pip-version-check
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
FRESH := $(shell od -An -N3 -tu4 /dev/urandom | tr -d ' ')

.PHONY: demo test test-python test-browser test-ray test-ros newest evaluate lint lint-js format bench fuzz campaigns properties attack soak mutants engines docs screenshots docs-check package-check extension site site-version clean

demo: $(VENV)/installed  ## check a shipped plan
	@$(BIN)/gpsfsm check corpus/plans/tour_guide.xml || test $$? -eq 1
	@echo
	@echo "This plan has two mistakes on purpose. Activate the environment: . $(BIN)/activate"
	@echo "Then continue with docs/tutorial/index.md, or check a file of your own: gpsfsm check FILE"

test: $(VENV)/installed-dev  ## the whole test suite; CASES=all takes all random cases, not one of four
	$(BIN)/python -m pytest -n auto --dist worksteal

# What depends on the version of Python: processes, threads, files, SQLite, XML, addresses, its syntax.
OF_PYTHON := $(addprefix tests/,test_hanging.py test_late.py test_strict_json.py capabilities \
	checking/test_includes.py checking/test_inputs.py compile/formats execution grammars/test_tree.py \
	$(addprefix runners/test_,generic.py generic_http.py printed.py processes.py) running \
	service/test_clients.py service/test_files.py service/test_token.py \
	syntax/test_agreement.py syntax/test_hostile.py watch workers)

test-python: VERSION = $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
test-python:  ## a quick selection with another Python: make test-python PYTHON=python3.12
	$(PYTHON) -m venv .venv-$(VERSION)
	.venv-$(VERSION)/bin/pip install --quiet --disable-pip-version-check $(PINS) -e '.[dev]'
	.venv-$(VERSION)/bin/python -m pytest -n auto --dist worksteal $(OF_PYTHON)

test-browser: $(VENV)/installed-dev $(VENV)/installed-docs  ## the pages in a real browser; Chromium comes from the system
	$(PIP) $(PINS) 'playwright>=1.50'
	$(BIN)/python -m pytest -n auto --dist worksteal -m browser

test-ray: $(VENV)/installed-dev  ## plans on a Ray cluster, of which a machine dies; Ray takes 79 MB
	$(PIP) $(PINS) -e '.[ray]'
	$(BIN)/python -m pytest -m ray

test-ros: $(VENV)/installed-dev $(ROS)/installed  ## runs on a ROS 2 of wheels: 90 MB, and a g++
	$(BIN)/python -m pytest -n auto --dist worksteal -m ros

newest: pyproject.toml  ## the suite with the newest versions of everything; it reports, and never fails
	$(PYTHON) -m venv --clear .venv-newest
	.venv-newest/bin/pip install --quiet --disable-pip-version-check --upgrade -e '.[dev]'
	-.venv-newest/bin/python -m pytest -n auto --dist worksteal -q -W default
	@.venv-newest/bin/pip list --disable-pip-version-check --format freeze | diff -i constraints.txt - || true

evaluate: $(VENV)/installed  ## grade the experiment of the paper: make evaluate EXPERIMENT=../gpsfsm-2026
	@$(BIN)/python experiments/evaluate.py $(EXPERIMENT) --paper

lint: $(VENV)/installed-dev lint-js
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

lint-js:  ## types of the pages' JavaScript, as jsconfig.json has it
	@if [ -x node_modules/.bin/tsc ]; then node_modules/.bin/tsc -p jsconfig.json; \
	else echo "lint-js was skipped: there is no node_modules/.bin/tsc (npm install --no-save typescript)"; fi

format: $(VENV)/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/installed-dev  ## rewrites docs/performance.md
	$(BIN)/python benchmarks/run.py

fuzz: SEED ?= $(FRESH)
fuzz: properties campaigns  ## property tests and a campaign of two minutes, with new cases every time

campaigns: $(VENV)/installed-dev  ## random cases, put to independent judges: SECONDS=60 SEED=7
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m campaign
	$(BIN)/python -m tests.campaigns --seconds $(or $(SECONDS),120) --seed $(or $(SEED),1)

properties: $(VENV)/installed-dev  ## the property tests of the suite, with new cases every time
	CASES=all HYPOTHESIS_PROFILE=fresh $(BIN)/python -m pytest -q -n auto --dist worksteal -m hypothesis

attack: $(VENV)/installed-dev  ## ten minutes of hostile texts, files, journals, servers and clients
	$(BIN)/python -m tests.campaigns --attacks --seconds $(or $(SECONDS),600) --seed $(or $(SEED),1)

soak: $(VENV)/installed-dev  ## killed runs and a long campaign; rewrites parts of two pages in docs/
	$(PIP) $(PINS) 'schemathesis>=4.30'
	$(BIN)/python benchmarks/soak_crash.py
	$(BIN)/python -m tests.campaigns --counts build/campaigns/counts.json --write --jobs 2

mutants: $(VENV)/installed-dev  ## defects planted in analysis/; rewrites a part of docs/reliability.md
	$(BIN)/python -m tests.mutants --seed 2 --mutants 165 --results build/mutants.json --write --jobs 2

engines: $(VENV)/installed-dev  ## the grammars in xgrammar, which takes several gigabytes
	$(PIP) xgrammar
	$(BIN)/python -m pytest -m slow -W default tests/grammars

screenshots: $(VENV)/installed-dev  ## takes the pictures of pages in docs/pictures anew; look at each after that
	$(PIP) $(PINS) 'playwright>=1.50'
	$(BIN)/python docs/screenshots.py

docs: $(VENV)/installed-dev  ## rewrites what is generated under docs/ and grammars/, and the version and the owner everywhere
	$(BIN)/python packaging/stamp.py
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/engines.py

docs-check: $(VENV)/installed-dev
	$(BIN)/python packaging/stamp.py --check
	$(BIN)/python docs/generate.py --check
	$(BIN)/python docs/engines.py --check
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m commands

package-check: $(VENV)/installed-dev  ## sdist, wheel, image and hooks, built and used where nothing is
	$(BIN)/python -m pytest -m packages tests/installation tests/pipelines

extension: VSCE := @vscode/vsce@3.9.2
extension:  ## the extension of Visual Studio Code: build/vscode/gpsfsm-VERSION.vsix; needs npm
	rm -rf build/vscode
	mkdir -p build
	cp -r editors/vscode build/vscode
	cp LICENSE build/vscode
	cd build/vscode && npm ci --no-audit --no-fund --ignore-scripts --silent
	cd build/vscode && npm exec --yes --ignore-scripts -- $(VSCE) package

site: $(VENV)/installed-docs  ## the documentation site, into build/site; a broken link is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

site-version: $(VENV)/installed-docs  ## the same as a version of the branch gh-pages: VERSION=0.2
	@test -n "$(VERSION)" || { echo 'which version? make site-version VERSION=0.2' >&2; exit 2; }
	NO_MKDOCS_2_WARNING=1 PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/mike deploy --update-aliases $(VERSION) latest
	$(BIN)/mike set-default latest

$(VENV)/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) $(PINS) -e .
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	$(PIP) $(PINS) -e '.[docs]'
	@touch $@

$(VENV)/installed-dev: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) $(PINS) -e '.[dev]'
	@touch $@ $(VENV)/installed

# lark-parser, which the wheels want, is an old lark of another name: its files would be ours as well
$(ROS)/installed: pyproject.toml constraints.txt tests/ros/requirements.txt \
		tests/ros/build_interfaces.py $(wildcard tests/ros/interfaces/*/*/*/*)
	$(PYTHON) -m venv $(ROS)
	$(ROS_PIP) install -r tests/ros/requirements.txt
	$(ROS_PIP) uninstall --yes lark-parser
	$(ROS_PIP) install $(PINS) --force-reinstall --no-deps lark
	$(ROS_PIP) install $(PINS) -e '.[serve,mcap]'
	$(ROS)/bin/python tests/ros/build_interfaces.py
	@touch $@

clean:
	rm -rf $(VENV) .venv-newest .venv-3.* $(ROS) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
