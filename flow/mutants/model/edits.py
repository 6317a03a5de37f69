"""Small wrong edits of ``model/`` and ``snn/``, made by Cosmic Ray: which there are, and a sample of them."""

from __future__ import annotations

import ast
import hashlib
import random
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from cocotb_tests.session.store import ROOT
from model.errors import InputError

LEFT_OUT = ("RemoveDecorator", "VariableReplacer", "VariableInserter")
"""Operators of Cosmic Ray that are not used: Numba's decorators change speed alone, the others need a list of names."""


@dataclass(frozen=True)
class Place:
    """A place of a file with what can be written there instead.

    Parameters
    ----------
    file : str
        ``model/taxel.py``.
    line : int
    start : tuple of int
        Line and column of the edit.
    choices : tuple of (str, int)
        Operators of Cosmic Ray, each with the number of the place among its own.
    """

    file: str
    line: int
    start: tuple[int, int]
    choices: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Edit:
    """One edit.

    Parameters
    ----------
    file, kind : str
        ``kind`` is the operator.
    line : int
    old, new : str
        The line without and with the edit, blanks at its ends taken off.
    text : str
        The whole file with the edit.
    """

    file: str
    kind: str
    line: int
    old: str
    new: str
    text: str

    @property
    def name(self) -> str:
        """As a list shows it."""
        return f"{self.file}:{self.line}: {self.old} -> {self.new}"

    @property
    def key(self) -> str:
        """Digest of the file with the edit: the same as long as the file is."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]


def sample(file: str, share: float, fewest: int, seed: int) -> tuple[list[Edit], int]:
    """Return a sample of the edits of a file, one from each stretch of it, and how many places it has.

    At every place that is drawn one edit is, of all that Cosmic Ray knows. An edit of an annotation or a decorator
    alone is none, nor one that is no Python.
    """
    every = places(file)
    count = min(len(every), max(fewest, round(share * len(every))))
    ends = [number * len(every) // count for number in range(count + 1)] if count else []
    rng = random.Random(f"{seed} {file}")
    found: dict[str, Edit] = {}
    for stretch in pairwise(ends):
        for number in rng.sample(range(*stretch), stretch[1] - stretch[0]):
            if edit := _edit(every[number], rng):
                found[edit.key] = edit
                break
    return list(found.values()), len(every)


@cache
def places(file: str) -> list[Place]:
    """Return the places of a file at which Cosmic Ray edits."""
    tools = _tools()
    tree = tools.get_ast((ROOT / file).read_text())
    found: dict[tuple[int, int], list[tuple[str, int]]] = {}
    nodes = list(tools.ast_nodes(tree))
    for name in tools.operator_names():
        if name.partition("/")[2] in LEFT_OUT:
            continue
        operator, number = tools.get_operator(name)(), 0
        for node in nodes:
            for start, _ in operator.mutation_positions(node):
                found.setdefault(start, []).append((name, number))
                number += 1
    return [Place(file, start[0], start, tuple(found[start])) for start in sorted(found)]


def _edit(place: Place, rng: random.Random) -> Edit | None:
    """Return one edit at a place; None if none of them changes what the program does."""
    tools, text = _tools(), (ROOT / place.file).read_text()
    for name, number in rng.sample(place.choices, len(place.choices)):
        new = tools.mutate_code(text, tools.get_operator(name)(), number)
        try:
            if new is None or meaning(new) == meaning(text):
                continue
        except SyntaxError:
            continue
        pair = zip(text.splitlines(), new.splitlines(), strict=False)
        line, before, after = next((n, a, b) for n, (a, b) in enumerate(pair, 1) if a != b)
        return Edit(place.file, name.partition("/")[2], line, before.strip(), after.strip(), new)
    return None


@cache
def meaning(text: str) -> str:
    """Return what a program does, without annotations and decorators."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            node.decorator_list = []
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
    return ast.dump(tree)


@cache
def _tools() -> Any:
    """Return what is used of Cosmic Ray."""
    try:
        from cosmic_ray.ast import ast_nodes, get_ast
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator, operator_names
    except ImportError:
        raise InputError(
            "cosmic-ray is not installed; run make mutants MODEL=1, or pip install -c constraints.txt -e '.[mutants]'"
        ) from None
    names = (ast_nodes, get_ast, mutate_code, get_operator, operator_names)
    return type("Tools", (), {name.__name__: staticmethod(name) for name in names})
