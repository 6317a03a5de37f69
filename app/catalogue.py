"""List the commands of ``eskin``; needs the standard library alone, since make reads it before anything is installed.

To add a command: write its function in a module of ``app/commands``, and list it here under what users want to do.
"""

from __future__ import annotations

import ast
from importlib.util import find_spec
from pathlib import Path


def _in(folder: str, **modules: str) -> dict[str, str]:
    """Return the module of each command, from the commands of each module of a folder."""
    return {
        name: f"eskin.app.commands.{folder}.{module}" for module, names in modules.items() for name in names.split()
    }


COMMANDS: dict[str, dict[str, str]] = {
    "Signals and events": _in(
        "signals",
        encode="encode decode",
        compare="compare",
        rates="rates",
        frames="frames",
        study="study",
        report="report",
    ),
    "RTL against model": _in("simulate", sim="sim", replay="replay", touch="touch"),
    "Classifier": _in(
        "learn",
        train="train crossval",
        predict="predict",
        sweep="sweep",
        pair="pair",
        counts="counts",
        exchange="quantise export import convert",
        cache="cache",
    ),
    "Hardware": _in(
        "silicon", verilog="verilog gates", netlist="asic asic-scale gatesim gatepower", places="layout fpga"
    ),
    "Board": _in("board", board="play listen load rescue"),
    "Power": _in("power", power="power sensitivity", explore="explore", event_rates="event-rates"),
    "Figures and studies": _in("power", power="fig6 fig7")
    | _in("learn", figures="fig8 fig9", robustness="robustness", studies="noise-power merits precision"),
    "Checks of the project": _in(
        "verify",
        evidence="formal properties coverage faults crosscheck crossproof",
        mutants="mutants",
        soak="soak",
    ),
}
"""Module of every command, grouped by what users want to do, in the order of ``eskin --help``."""

MODULES = {name: module for modules in COMMANDS.values() for name, module in modules.items()}
"""Module of every command; its function has the name of the command, with ``_`` for ``-``."""


def summary(name: str) -> str:
    """Return the first line of a command's docstring; imports no command."""
    place = find_spec(MODULES[name])
    assert place is not None
    assert place.origin is not None
    nodes = ast.parse(Path(place.origin).read_bytes()).body
    functions = {node.name.strip("_"): node for node in nodes if isinstance(node, ast.FunctionDef)}
    return (ast.get_docstring(functions[name.replace("-", "_")]) or "").partition("\n")[0]
