# The two commands that matter: make demo, make test. The environment is made once in $(VENV) and again when it changes.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test lint bench mutants docs results clean

demo: $(READY)
	$(BIN)/cwlf-slam demo --out runs/demo --overwrite

test: lint
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python -m pytest benchmarks --benchmark-enable --benchmark-only --benchmark-columns=median,iqr,rounds

# Half an hour; ONLY="ekf jcbb" runs parts.
mutants: $(READY)
	$(BIN)/python tests/mutants/run.py $(ONLY)

docs: demo
	cp runs/demo/map.png docs/demo-map.png
	$(BIN)/cwlf-slam study paper --docs docs --out runs/paper
	$(BIN)/python docs/draw_worlds.py runs/worlds

results: $(READY)
	$(BIN)/python docs/measure_logs.py runs/results

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv "$(VENV)"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch "$(READY)"

clean:
	rm -rf "$(VENV)" runs .pytest_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
