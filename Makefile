# make demo   set up and run the demonstration: simulate a TX40, identify it, write a report
# make test   set up and run all checks
# make bench  set up and print the table of speeds, with the peers run beside us
# make truth  coverage and errors on simulated records, errors on held-out motion (some hours)
# make docs   build the documentation (build/docs/index.html); a warning is an error
# make lint   style and types only
#
# Everything lives in .venv; PYTHON names the interpreter (3.11 or newer).

PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := demo
.PHONY: demo test tests bench truth docs lint clean

demo: .venv/.pivident-report
	$(BIN)/pivident demo --out pivident-demo

# Types take a minute of one processor; the tests run beside them. Whoever wants no bytecode beside
# the sources gets it here all the same: hundreds of processes would each translate them anew.
test tests: export PYTHONDONTWRITEBYTECODE =
test: .venv/.pivident-test
	@$(MAKE) --no-print-directory --jobs=2 lint tests

tests: .venv/.pivident-test
	$(BIN)/python -m pytest -n auto --maxprocesses 8 --dist worksteal

lint: .venv/.pivident-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: .venv/.pivident-docs
	$(BIN)/sphinx-build -W --keep-going -q docs build/docs
	@echo build/docs/index.html

bench: .venv/.pivident-test
	$(BIN)/python benchmarks/bench.py
	$(BIN)/python benchmarks/profile_piv.py
	$(BIN)/python -m pytest benchmarks/bench_*.py --benchmark-enable --benchmark-only
	$(BIN)/python benchmarks/symbolic_models.py

truth: .venv/.pivident-all
	$(BIN)/python -m benchmarks.statistical_truth
	$(BIN)/python benchmarks/held_out_folds.py
	$(BIN)/python benchmarks/unknown_loop.py
	$(BIN)/python benchmarks/gravity_compensated_law.py
	$(BIN)/python -m benchmarks.linear_truth
	$(BIN)/python benchmarks/kuka_kr300_blocks.py
	$(BIN)/python benchmarks/friction_laws.py
	$(BIN)/python benchmarks/friction_law_recovery.py --choice-runs 10
	$(BIN)/python benchmarks/drive_gains.py
	$(BIN)/python benchmarks/two_mass.py
	$(BIN)/python benchmarks/consistent_parameters.py
	$(BIN)/python benchmarks/payload.py

.venv/.pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "pivident needs Python 3.11 or newer; name one: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	@touch $@

.venv/.pivident: .venv/.pip pyproject.toml
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

.venv/.pivident-report: .venv/.pivident pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[report]'
	@touch $@

.venv/.pivident-all: .venv/.pivident pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[all]'
	@touch $@

.venv/.pivident-test: .venv/.pivident pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[all]' --group test
	@touch $@

.venv/.pivident-docs: .venv/.pivident pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[all]' --group docs
	@touch $@

clean:
	rm -rf .venv build pivident-demo .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
