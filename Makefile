# The commands that matter: make demo, make test, and make quick while one works. The environment is made once in
# $(VENV) and again when it changes.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
PYTEST := $(BIN)/python -m pytest --numprocesses auto --dist worksteal

.PHONY: demo test quick slowest lint kernels bench mutants docs results clean

demo: $(READY)
	$(BIN)/cwlf-slam demo --out runs/demo --overwrite

test: $(READY)
	$(MAKE) --jobs=2 lint kernels
	$(PYTEST)

quick: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(PYTEST) -m "not slow" --durations=10 --durations-min=1

slowest: $(READY)
	$(PYTEST) --durations=60

# Compiled once, beside the types; otherwise each process of pytest would compile all of them.
kernels: $(READY)
	$(BIN)/python -c 'import sim, slam.pipeline, slam.study.paper.timing_kernels'

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
