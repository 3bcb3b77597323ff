# Two commands: `make demo` and `make test`. Both create .venv and install what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed-dev

.PHONY: demo test check lint types imports examples bench licences sbom clean

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
	$(BIN)/ruff check src tests examples supply
	$(BIN)/ruff format --check src tests examples supply

types: $(INSTALLED)
	$(BIN)/mypy

imports: $(INSTALLED)
	$(BIN)/lint-imports

examples: $(INSTALLED)
	$(BIN)/python -m pytest tests/test_examples.py

licences: $(INSTALLED)
	$(BIN)/python -m supply.licences

# The tool stands in an environment of its own, so that the bill lists taxel's parts, not the tool's.
sbom: $(INSTALLED)
	test -x $(VENV)-sbom/bin/cyclonedx-py || $(PYTHON) -m venv $(VENV)-sbom
	$(VENV)-sbom/bin/pip install --quiet --disable-pip-version-check 'cyclonedx-bom>=7,<8'
	mkdir -p dist
	$(VENV)-sbom/bin/cyclonedx-py environment $(BIN)/python --pyproject pyproject.toml \
	    --output-reproducible --output-format JSON --output-file dist/sbom.json
	$(BIN)/python -m supply.sbom dist/sbom.json

bench: $(INSTALLED)
	$(BIN)/taxel bench teng

clean:
	rm -rf $(VENV) $(VENV)-sbom dist build demo runs
