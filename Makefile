# Every command of eskin is a target, beside those of the project; `make help` lists them. app/make.py runs them.
# Variables behind make are options of the command: ROWS=12 is --rows 12. app/make.py reads them from MAKEFLAGS, so that
# no shell and no make expands them.

# Before anything else looks at them: typed variables reach no environment, where COLUMNS is the width of a window.
unexport $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name)))
PYTHON ?= python3
export ESKIN_PYTHON := $(value PYTHON)

.DEFAULT_GOAL := help
.PHONY: FORCE
.SUFFIXES:
Makefile: ;

# Any name is a target, whether or not a file or folder has it; the launcher refuses unknown ones.
%: FORCE
	+@"$$ESKIN_PYTHON" -c 'import tomllib' 2>/dev/null || \
	{ echo "error: Python 3.11 or newer not found; install with: apt-get install python3 python3-venv, or name one with PYTHON=" >&2; \
	exit 2; }; \
	"$$ESKIN_PYTHON" -m eskin.app.make '$(subst ','\'',$@)'
