# Two commands: `make demo` and `make test`. Both create .venv and install what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed-dev

.PHONY: demo test check lint types imports examples bench clean

$(INSTALLED): pyproject.toml constraints-cpu.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints-cpu.txt -e '.[dev]'
	touch $(INSTALLED)

demo: $(INSTALLED)
	$(BIN)/taxel demo --seconds 60

test: $(INSTALLED)
	$(BIN)/python -m pytest -n 2

check: lint types imports test examples

lint: $(INSTALLED)
	$(BIN)/ruff check src tests examples
	$(BIN)/ruff format --check src tests examples

types: $(INSTALLED)
	$(BIN)/mypy

imports: $(INSTALLED)
	$(BIN)/lint-imports

examples: $(INSTALLED)
	$(BIN)/python -m pytest tests/test_examples.py

bench: $(INSTALLED)
	$(BIN)/taxel bench teng

clean:
	rm -rf $(VENV) build demo runs
