"""List the commands of ``eskin``.

This module imports only the standard library, because make reads the list before the installation.

To add a command: write its function in a module of ``app/commands``, and list it here under the user's task.
"""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path


def _in(folder: str, **modules: str) -> dict[str, str]:
    """Return the module of each command, from a table of the commands in each module of a folder."""
    return {
        name: f"eskin.app.commands.{folder}.{module}" for module, names in modules.items() for name in names.split()
    }


COMMANDS: dict[str, dict[str, str]] = {
    "A first look": _in("board", demo="demo"),
    "Signals to events and back": _in(
        "signals", encode="encode decode", convert="convert", compare="compare", report="report"
    ),
    "RTL against model": _in("simulate", sim="sim", replay="replay", touch="touch", agree="agree"),
    "Classifier": _in(
        "learn",
        train="train crossval",
        predict="predict",
        sweep="sweep",
        figures="pair",
        exchange="quantise export import",
        scans="cache",
    ),
    "Hardware": _in(
        "silicon", verilog="verilog gates", netlist="asic asic-scale gatesim gatepower", places="layout fpga tapeout"
    ),
    "Board": _in("board", board="play listen load rescue"),
    "Power and data rate": _in("power", power="power", explore="explore")
    | _in("signals", study="study", rates="rates frames")
    | _in("power", power="sensitivity")
    | _in("signals", rates="event-rates"),
    "Figures and studies of the paper": _in("power", power="fig6 fig7")
    | _in(
        "learn",
        figures="fig8 fig9 frontier",
        robustness="robustness",
        studies="noise-power merits precision",
        scans="counts",
    ),
}
"""Module of every user command, grouped by task, in the order of ``eskin --help``."""

DEV = "dev"
CHECKS = _in("verify", evidence="formal properties coverage faults crosscheck crossproof", campaigns="mutants soak")
"""Module of every check of the project: ``eskin dev NAME``."""

GROUPS = COMMANDS | {"Checks of the project": CHECKS}
MODULES = {name: module for modules in GROUPS.values() for name, module in modules.items()}
"""Module of every command; its function has the name of the command, with ``_`` for ``-``."""

ABOUT = "Spiking readout for electronic skin: model, RTL, co-simulation, classifier."
ABOUT_DEV = "Checks of the project, available in a checkout."
HELP = "eskin COMMAND --help lists the options of a command."


def words_of(name: str) -> list[str]:
    """Return the words after ``eskin`` that run a command."""
    return [DEV, name] if name in CHECKS else [name]


def summary(name: str) -> str:
    """Return the summary of a command, which is the first line of its docstring, without importing the command."""
    text = Path(__file__).parents[1].joinpath(*MODULES[name].split(".")[1:]).with_suffix(".py").read_text()
    function = re.search(rf'^def {name.replace("-", "_")}_?\(.*?^    """(.*?)("""|$)', text, re.MULTILINE | re.DOTALL)
    assert function is not None, f"{MODULES[name]} has no function {name} with a docstring"
    return function[1]


def overview() -> str:
    """Return the text of ``eskin --help``."""
    listed = {heading: {name: summary(name) for name in names} for heading, names in COMMANDS.items()}
    listed["Development"] = {DEV: f"{ABOUT_DEV} Commands: {', '.join(CHECKS)}."}
    options = {"Options": {"-h, --help": "Show this message and exit."}}
    return "\n".join(["Usage: eskin COMMAND [OPTIONS]", "", f"  {ABOUT}", *sections(listed | options), "", HELP])


def sections(listed: Mapping[str, Mapping[str, str]], width: int | None = None) -> Iterable[str]:
    """Yield the lines of help sections; a section has a heading, and a text for each name.

    By default, the lines are as wide as the terminal.
    """
    width = width or max(shutil.get_terminal_size().columns, 60)
    indent = max(len(name) for texts in listed.values() for name in texts) + 4
    for heading, texts in listed.items():
        yield from ("", f"{heading}:")
        for name, text in texts.items():
            head = f"  {name}".ljust(indent)
            yield textwrap.fill(
                text, width, initial_indent=head, subsequent_indent=" " * indent, break_on_hyphens=False
            )
