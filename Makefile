# Two commands: `make demo` and `make test`. Both create .venv and install what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed-dev
# Processes that tests run in, side by side.
TEST_WORKERS ?= 2

.PHONY: demo test test-slow check lint types imports size examples bench paper-tables docs dist try-wheel licences sbom mutants coverage clean

$(INSTALLED): pyproject.toml constraints-cpu.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints-cpu.txt -e '.[dev]'
	touch $(INSTALLED)

demo: $(INSTALLED)
	$(BIN)/taxel demo --seconds 60

# All tests but some 170 slow ones, which train for long or print the tutorial anew; CI runs both.
test: $(INSTALLED)
	$(BIN)/python -m pytest -n $(TEST_WORKERS) --dist worksteal -m "not slow"

test-slow: $(INSTALLED)
	$(BIN)/python -m pytest -n $(TEST_WORKERS) --dist worksteal -m slow

check: lint types imports test examples

lint: $(INSTALLED)
	$(BIN)/ruff check src tests examples supply website mutants
	$(BIN)/ruff format --check src tests examples supply website mutants

types: $(INSTALLED)
	$(BIN)/mypy

imports: $(INSTALLED)
	$(BIN)/lint-imports

# Code lines of src/, lengths of functions, parameters, docstrings, units (docs/decisions/0048).
size: $(INSTALLED)
	$(BIN)/python -m supply.size src

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

# The site in build/site, from docs/, the verbs and the docstrings; a warning is an error.
docs: $(INSTALLED)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints-cpu.txt -c constraints-docs.txt -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	$(BIN)/python -m website.check_site build/site

# What would be published: a source archive and a wheel, in dist/.
dist:
	test -x $(VENV)-dist/bin/python || $(PYTHON) -m venv $(VENV)-dist
	$(VENV)-dist/bin/pip install --quiet --disable-pip-version-check -c constraints-docs.txt build twine
	rm -rf dist/*.whl dist/*.tar.gz build/lib
	$(VENV)-dist/bin/python -m build --outdir dist .
	$(VENV)-dist/bin/twine check --strict dist/*.whl dist/*.tar.gz

# The wheel alone, in an empty environment and folder: a short demo, its page included.
try-wheel: dist
	rm -rf $(VENV)-wheel build/try-wheel && mkdir -p build/try-wheel
	$(PYTHON) -m venv $(VENV)-wheel
	$(VENV)-wheel/bin/pip install --quiet --disable-pip-version-check -c constraints-cpu.txt "$$(echo dist/*.whl)[train,page]"
	cd build/try-wheel && $(abspath $(VENV)-wheel)/bin/taxel demo --scans-per-class 30000 --live-seconds 20 --seconds 5

bench: $(INSTALLED)
	$(BIN)/taxel bench teng

# Tables 1 to 3 of the grasp-transition paper with trained networks, and the claims card: ResNet50's
# ImageNet weights are fetched, the other three backbones learn from it on touch images of other
# objects than the tables' cups (docs/decisions/0057). Broken off, it goes on where it was; four
# hours of one core and longer where others use it. SLIP: the folder of gelsight-slip.
# CARD=yes: on a graphics card, students of 224 pixels that see other copies of images in each epoch,
# and three Transformers with backbones trained end to end. With two of these its parts took under 20
# minutes of an H100, two at a time; it was not run as a whole.
SLIP ?= ../shared/data/gelsight-slip
CARD ?= no
ifeq ($(CARD),yes)
TABLES := build/paper-tables-card
FAST := --engine torch --precision bf16
else
TABLES := build/paper-tables
FAST := --engine openvino --precision bf16
endif
DISTIL = $(BIN)/taxel distil $(SLIP) $(filter %-cups,$|) $(FAST) --bf16 --resume

paper-tables: $(TABLES)/densenet121.safetensors $(TABLES)/efficientnet-b0.safetensors $(TABLES)/resnet101.safetensors $(TABLES)/cups
	TAXEL_WEIGHTS=$(TABLES) $(BIN)/taxel reproduce transition-tables --data $(TABLES)/cups --backbones paper $(FAST) --no-steps --json > $(TABLES)/tables.json
	$(BIN)/taxel report --claims docs/reference/claims.md --keep $(TABLES)/tables.json

$(TABLES)/cups: | $(INSTALLED)
	$(BIN)/taxel simulate cup-pour --output $@

NO_CARD := needed a graphics card for CARD=yes; got none; leave CARD out.

$(TABLES)/other-cups: | $(INSTALLED)
ifeq ($(CARD),yes)
	$(BIN)/python -c "import sys, torch; sys.exit(None if torch.cuda.is_available() else '$(NO_CARD)')"
endif
	$(BIN)/taxel weights fetch resnet50 densenet121-typefaces
	$(BIN)/taxel simulate cup-pour --output $@ --seed 57 --first-cup 1000 --cups 20 --camera-hz 2

ifeq ($(CARD),yes)
# Epochs as in docs/decisions/0057; later parts go on from earlier ones, on other copies.
FRESH = $(DISTIL) --side-px 224 --frames 8 --copies 5 --batch 128

$(TABLES)/first/densenet121.safetensors: | $(TABLES)/other-cups
	mkdir -p $(@D)
	$(FRESH) --backbone densenet121 --epochs 8 --output $@

$(TABLES)/second/densenet121.safetensors: $(TABLES)/first/densenet121.safetensors | $(TABLES)/other-cups
	mkdir -p $(@D)
	$(FRESH) --backbone densenet121 --start $< --seed 1 --epochs 12 --output $@

$(TABLES)/densenet121.safetensors: $(TABLES)/second/densenet121.safetensors | $(TABLES)/other-cups
	$(FRESH) --backbone densenet121 --start $< --seed 2 --epochs 24 --output $@

$(TABLES)/first/efficientnet-b0.safetensors: | $(TABLES)/other-cups
	mkdir -p $(@D)
	$(FRESH) --backbone efficientnet-b0 --epochs 12 --output $@

$(TABLES)/efficientnet-b0.safetensors: $(TABLES)/first/efficientnet-b0.safetensors | $(TABLES)/other-cups
	$(FRESH) --backbone efficientnet-b0 --start $< --seed 1 --epochs 4 --output $@

$(TABLES)/resnet101.safetensors: | $(TABLES)/other-cups
	$(FRESH) --backbone resnet101 --epochs 2 --output $@

# Which models are trained end to end was decided on other cups than the tables'.
END_TO_END = $(BIN)/taxel train-backbone $(TABLES)/pours --bf16 --resume
ENDS = resnet50 densenet121 efficientnet-b0

paper-tables: $(ENDS:%=$(TABLES)/%+transformer.safetensors)

$(TABLES)/pours: | $(INSTALLED)
	$(BIN)/taxel simulate cup-pour --output $@ --seed 57 --first-cup 1000 --cups 80

$(TABLES)/resnet50+transformer.safetensors: | $(TABLES)/other-cups $(TABLES)/pours
	$(END_TO_END) --backbone resnet50 --head transformer --epochs 2 --output $@

$(TABLES)/densenet121+transformer.safetensors: $(TABLES)/densenet121.safetensors | $(TABLES)/pours
	$(END_TO_END) --backbone densenet121 --weights $< --head transformer --epochs 1 --output $@

$(TABLES)/efficientnet-b0+transformer.safetensors: $(TABLES)/efficientnet-b0.safetensors | $(TABLES)/pours
	$(END_TO_END) --backbone efficientnet-b0 --weights $< --epochs 2 --batch 8 --learning-rate 2e-4 --output $@
else
# Three epochs, a fourth of smaller steps, two on other copies of the images (docs/decisions/0057).
DENSENET = $(DISTIL) --backbone densenet121 --side-px 160 --frames 8 --copies 5

$(TABLES)/first/densenet121.safetensors: | $(TABLES)/other-cups
	mkdir -p $(@D)
	$(DENSENET) --epochs 3 --output $@

$(TABLES)/second/densenet121.safetensors: $(TABLES)/first/densenet121.safetensors | $(TABLES)/other-cups
	mkdir -p $(@D)
	$(DENSENET) --epochs 1 --start $< --output $@

$(TABLES)/densenet121.safetensors: $(TABLES)/second/densenet121.safetensors | $(TABLES)/other-cups
	$(DENSENET) --epochs 2 --start $< --seed 1 --output $@

$(TABLES)/efficientnet-b0.safetensors: | $(TABLES)/other-cups
	$(DISTIL) --backbone efficientnet-b0 --side-px 160 --frames 8 --copies 5 --epochs 3 --output $@

$(TABLES)/resnet101.safetensors: | $(TABLES)/other-cups
	$(DISTIL) --backbone resnet101 --side-px 192 --frames 4 --copies 5 --epochs 1 --output $@
endif

# Mutation testing of six places, an hour at most, not in CI. The tool that draws the mutants stands
# in an environment of its own: it brings 25 distributions that nothing else needs.
mutants: $(INSTALLED)
	test -x $(VENV)-mutants/bin/cosmic-ray || $(PYTHON) -m venv $(VENV)-mutants
	$(VENV)-mutants/bin/pip install --quiet --disable-pip-version-check 'cosmic-ray>=8.4,<9'
	OMP_NUM_THREADS=1 $(BIN)/python -m mutants --store

# Branches taken in the same places, the camera's path and the station.
coverage: $(INSTALLED)
	OMP_NUM_THREADS=1 $(BIN)/python -m mutants.branches --store

clean:
	rm -rf $(VENV) $(VENV)-mutants $(VENV)-sbom $(VENV)-dist $(VENV)-wheel dist build demo runs
