"""Read Verilog with slang, a strict SystemVerilog front end."""

import atexit
import gc
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from eskin.base.errors import InputError
from eskin.base.packages import missing
from eskin.base.units import counted

INCLUDE = re.compile(r'^[ \t]*`include\s+"([^"]+)".*$', re.MULTILINE)
NO_CODE = re.compile(r'"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
"""Strings and comments."""


class Port(NamedTuple):
    """Direction and width of a port."""

    direction: str
    width: int

    def __str__(self) -> str:
        return f"{self.direction}, {counted(self.width, 'bit')}"


def compilation(texts: Mapping[str, str], top: str) -> tuple[Any, Any]:
    """Return slang's compilation of the texts of files, by their names, and its source manager."""
    try:
        import pyslang
        from pyslang import ast, syntax
    except ImportError:
        raise InputError(missing("pyslang")) from None
    atexit.unregister(gc.freeze)  # set by collect_seldom; slang would print the objects left at exit
    options = ast.CompilationOptions()
    options.topModules = {top}
    bag = pyslang.Bag()
    bag.compilationOptions = options
    design = ast.Compilation(bag)
    sources = syntax.SyntaxTree.getDefaultSourceManager()
    for name, text in texts.items():
        design.addSyntaxTree(syntax.SyntaxTree.fromText(text, sources, name))
    return design, sources


def top_of(design: Any, top: str) -> Any:
    """Return the instance of the top module, or None if no module has this name."""
    return next((one for one in design.getRoot().topInstances if one.name == top), None)


def ports_of(text: str, top: str) -> dict[str, Port]:
    """Return the ports of a module by name, or no ports if a syntax error hides the module."""
    design, _ = compilation({"dut.v": text}, top)
    instance = top_of(design, top)
    if instance is None and re.search(rf"\bmodule\s+{re.escape(top)}\b", NO_CODE.sub(" ", text)):
        return {}
    if instance is None:
        modules = ", ".join(sorted(one.name for one in design.getDefinitions())[:8]) or "none"
        raise InputError(f"the Verilog contains no module {top} (its modules: {modules}); name the top with --top")
    words = {"In": "input", "Out": "output"}
    return {
        port.name: Port(words.get(port.direction.name, "inout"), int(port.type.bitWidth))
        for port in instance.body.portList
    }


def read_verilog(path: Path, inside: tuple[Path, ...] = ()) -> str:
    """Return the text of a Verilog file, with the files that it includes from its own folder.

    Messages about the text name these files and their lines.
    ``inside`` are the files that include this one; they are not included again.
    """
    try:
        text = path.read_text(errors="replace")
    except OSError as error:
        raise InputError(f"cannot read the Verilog {path}: {error.strerror}") from None
    chain = (*inside, path.resolve())

    def included(found: re.Match[str]) -> str:
        other = path.parent / found[1]
        after = text.count("\n", 0, found.start()) + 2
        return "" if other.resolve() in chain else f'{read_verilog(other, chain)}\n`line {after} "{path}" 0'

    return f'`line 1 "{path}" 0\n{INCLUDE.sub(included, text)}'
