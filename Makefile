# Two commands do everything on a fresh machine with Python >= 3.11: `make demo` and `make test`.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
BENCH := .bench-venv

.PHONY: demo test soak slurm bench check format clean

demo: $(VENV)/.installed ## sources, a fit, three transfers, a comparison and a picture
	PATH="$(abspath $(BIN)):$$PATH" sh tests/demo.sh $(DEMO)

# with bytecode kept: the tests start hundreds of interpreters
test: $(VENV)/.test ## the tests
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest --numprocesses logical --dist worksteal

soak: $(VENV)/.test ## long soak and fault-injection runs
	$(BIN)/python -m pytest -m soak

slurm: ## a Slurm of one node on this machine, from Debian's packages, for its soak tests; as root
	tests/slurm/one_node.sh

bench: $(VENV)/.installed $(BENCH)/.installed ## qinit beside its peers, as a table of ratios in markdown
	$(BENCH)/bin/python tests/benchmarks/ratios.py --qinit $(BIN)/qinit $(BENCH_OPTIONS)

check: $(VENV)/.test $(VENV)/.check ## format, lint and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(VENV)/.check
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) $(BENCH) $(DEMO) build *.egg-info

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "qinit needs Python >= 3.11; name one with make PYTHON=python3.12" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/.installed: pyproject.toml $(VENV)/.created
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/.test: pyproject.toml $(VENV)/.created
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@ $(VENV)/.installed

$(VENV)/.check: pyproject.toml $(VENV)/.created
	$(BIN)/python -m pip install --quiet --editable '.[check]'
	touch $@

# the peers live apart: what they ask of numpy and Numba is theirs
$(BENCH)/.installed: tests/benchmarks/requirements.txt
	$(PYTHON) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --requirement tests/benchmarks/requirements.txt
	touch $@
