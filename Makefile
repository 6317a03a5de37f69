# Targets alone; `make help` says what they do. What each runs, and the packages it needs, stands in model/cli/make.py.
# Variables behind make are options of its command: ROWS=12 is --rows 12. They are read from MAKEFLAGS, so that no
# shell and no make expands them.

TARGETS := help setup sim replay touch soak verilog gates asic gatepower layout fpga formal faults coverage properties mutants crosscheck crossproof rates train crossval sweep predict robustness noise-power merits precision power fig6 fig7 fig8 \
  fig9 sensitivity explore frames study report docs bench check test lint format clean

# Before anything else looks at them: typed variables reach no environment, where COLUMNS is the width of a window.
unexport $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name)))
PYTHON ?= python3
export ESKIN_PYTHON := $(value PYTHON)

.DEFAULT_GOAL := help
.PHONY: $(TARGETS)

$(TARGETS):
	+@command -v "$$ESKIN_PYTHON" >/dev/null || \
	{ echo "error: Python 3.11 or newer not found; install with: apt-get install python3 python3-venv" >&2; exit 2; }; \
	"$$ESKIN_PYTHON" -m model.cli.make $@

.DEFAULT:
	@"$$ESKIN_PYTHON" -m model.cli.make $@
