"""List the commands of ``eskin`` as their functions declare them.

This module imports only the standard library, because make reads the list before the installation.

To add a command: write its function in a module of ``app/commands``, below ``@command``.
"""

import ast
import shutil
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

DEV = "dev"
OF_PROJECT = "Checks of the project"
"""Heading of the commands ``eskin dev NAME``."""

HEADINGS = (
    "A first look",
    "Signals to events and back",
    "RTL against model",
    "Classifier",
    "Hardware",
    "Board",
    "Power and data rate",
    OF_PROJECT,
)
"""Headings of ``eskin --help`` in order; the commands under a heading are sorted by name."""

ABOUT = "Spiking readout for electronic skin: model, RTL, co-simulation, classifier."
ABOUT_DEV = "Checks of the project, available in a checkout."
HELP = "eskin COMMAND --help lists the options of a command."


class Declaration(NamedTuple):
    """A command, and the arguments of its ``@command``, which must be literals."""

    module: str  # of the function; the function has the name of the command, with ``_`` for ``-``
    summary: str  # first line of the docstring
    heading: str  # one of ``HEADINGS``
    needs: str = ""  # groups of packages beside ``base``
    fuzz: str | None = None  # arguments with which the command ends soon; None if no arguments make it short
    variables: str = ""  # variables that the make target sets if the user does not: ``ROWS=2 COLUMNS=2``
    switch: str = ""  # target and variable of make that also run the command: ``sim GATES``
    idle: Mapping[str, str] = MappingProxyType({})  # options without effect by condition; see ``app.refusals``


def _declared() -> Iterable[tuple[str, Declaration]]:
    """Yield name and declaration of each command, without importing its module."""
    for path in Path(__file__).with_name("commands").glob("*/*.py"):
        module = f"eskin.app.commands.{path.parent.name}.{path.stem}"
        functions = [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]
        for function in functions:
            for call in function.decorator_list:
                if isinstance(call, ast.Call) and ast.unparse(call.func) == "command":
                    summary = str(ast.get_docstring(function)).partition("\n")[0]
                    arguments = {str(word.arg): ast.literal_eval(word.value) for word in call.keywords}
                    name = function.name.rstrip("_").replace("_", "-")
                    yield name, Declaration(module, summary, ast.literal_eval(call.args[0]), **arguments)


COMMANDS = dict(sorted(_declared(), key=lambda found: (HEADINGS.index(found[1].heading), found[0])))
"""All commands by name, in the order of ``eskin --help``."""

GROUPS = {heading: [name for name, found in COMMANDS.items() if found.heading == heading] for heading in HEADINGS}
CHECKS = GROUPS[OF_PROJECT]


def words_of(name: str) -> list[str]:
    """Return the words after ``eskin`` that run a command."""
    return [DEV, name] if name in CHECKS else [name]


def summaries() -> dict[str, dict[str, str]]:
    """Return the summary of each command, by heading and name."""
    return {heading: {name: COMMANDS[name].summary for name in names} for heading, names in GROUPS.items()}


def overview() -> str:
    """Return the text of ``eskin --help``."""
    listed = summaries()
    listed[OF_PROJECT] = {DEV: f"{ABOUT_DEV} Commands: {', '.join(CHECKS)}."}
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
