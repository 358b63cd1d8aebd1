# Two commands for a fresh machine with Python 3.11, make and git: make demo, make test.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test evaluate lint format bench fuzz attack soak mutants engines docs docs-check package-check clean

demo: $(VENV)/installed  ## check a shipped plan
	@$(BIN)/gpsfsm check corpus/plans/tour_guide.xml || test $$? -eq 1

test: $(VENV)/installed-dev  ## run the whole test suite
	$(BIN)/python -m pytest -n auto --dist worksteal

evaluate: $(VENV)/installed  ## grade a recorded experiment: make evaluate EXPERIMENT=../gpsfsm-2026
	@$(BIN)/python experiments/evaluate.py $(EXPERIMENT)

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/installed-dev  ## rewrites docs/performance.md
	$(BIN)/python benchmarks/run.py

fuzz: $(VENV)/installed-dev  ## two minutes of random cases, put to independent judges
	$(BIN)/python -m tests.campaigns --seconds $(or $(SECONDS),120) --seed $(or $(SEED),1)

attack: $(VENV)/installed-dev  ## ten minutes of hostile texts, files, journals, servers and clients
	$(BIN)/python -m tests.campaigns --attacks --seconds $(or $(SECONDS),600) --seed $(or $(SEED),1)

soak: $(VENV)/installed-dev  ## killed runs and a long campaign; rewrites parts of two pages in docs/
	$(BIN)/pip install --quiet --disable-pip-version-check 'schemathesis>=4.30'
	$(BIN)/python benchmarks/soak_crash.py
	$(BIN)/python -m tests.campaigns --counts build/campaigns/counts.json --write --jobs 2

mutants: $(VENV)/installed-dev  ## defects planted in analysis/; rewrites a part of docs/reliability.md
	$(BIN)/python -m tests.mutants --seed 2 --mutants 165 --results build/mutants.json --write --jobs 2

engines: $(VENV)/installed-dev  ## the grammars in xgrammar, which takes several gigabytes
	$(BIN)/pip install --quiet --disable-pip-version-check xgrammar
	$(BIN)/python -m pytest -m slow -W default tests/grammars

docs: $(VENV)/installed-dev  ## rewrites what is generated under docs/ and grammars/
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/engines.py
	$(BIN)/python -m gpsfsm.grammars.write

docs-check: $(VENV)/installed-dev
	$(BIN)/python docs/generate.py --check
	$(BIN)/python docs/engines.py --check
	$(BIN)/python -m gpsfsm.grammars.write --check
	$(BIN)/python docs/check.py

package-check: $(VENV)/installed-dev  ## the sdist, the wheel made from it, used in an empty environment
	$(BIN)/python tests/package_check.py

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/installed-dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@ $(VENV)/installed

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
