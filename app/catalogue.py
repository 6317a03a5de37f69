"""List the commands of ``eskin``.

This module imports only the standard library, because make reads the list before the installation.

To add a command: write its function in a module of ``app/commands``, and list its name here under the user's task.
"""

import re
import shutil
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path

COMMANDS = {
    heading: names.split()
    for heading, names in {
        "A first look": "demo",
        "Signals to events and back": "encode decode convert compare",
        "RTL against model": "sim replay touch agree",
        "Classifier": "train crossval predict sweep quantise export import cache",
        "Hardware": "verilog gates asic gatesim gatepower layout fpga tapeout",
        "Board": "play listen load rescue",
        "Power and data rate": "power explore rates frames",
    }.items()
}
"""Names of the user commands, grouped by task, in the order of ``eskin --help``."""

DEV = "dev"
CHECKS = ["formal", "properties", "coverage", "soak"]
"""Names of the checks of the project: ``eskin dev NAME``."""

GROUPS = COMMANDS | {"Checks of the project": CHECKS}

ABOUT = "Spiking readout for electronic skin: model, RTL, co-simulation, classifier."
ABOUT_DEV = "Checks of the project, available in a checkout."
HELP = "eskin COMMAND --help lists the options of a command."


def words_of(name: str) -> list[str]:
    """Return the words after ``eskin`` that run a command."""
    return [DEV, name] if name in CHECKS else [name]


def _functions() -> dict[str, tuple[str, str]]:
    """Return module and summary of each function in ``app/commands``; the summary is its docstring's first line."""
    function = re.compile(r'^def (\w+)\(.*\n(?:[ )].*\n)*?    """(.*?)(?:"""|$)', re.MULTILINE)
    return {
        name.rstrip("_").replace("_", "-"): (f"eskin.app.commands.{path.parent.name}.{path.stem}", text)
        for path in sorted(Path(__file__).with_name("commands").glob("*/*.py"))
        for name, text in function.findall(path.read_text())
    }


_FOUND = _functions()
MODULES = {name: _FOUND[name][0] for names in GROUPS.values() for name in names}
"""Module of every command; its function has the name of the command, with ``_`` for ``-``."""
SUMMARIES = {name: _FOUND[name][1] for name in MODULES}


def overview() -> str:
    """Return the text of ``eskin --help``."""
    listed = {heading: {name: SUMMARIES[name] for name in names} for heading, names in COMMANDS.items()}
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
