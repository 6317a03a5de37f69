"""Mutants of a source file: small edits by Cosmic Ray and by hardware operators."""

import ast
import random
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.plugins import get_operator, operator_names

from eskin.verify.mutants.hardware import HARDWARE

LEFT_OUT = re.compile(r"RemoveDecorator|Variable(Replacer|Inserter)|\w+_(Eq|NotEq|Lt|LtE|Gt|GtE)_Is(Not)?")
"""Mutation operators without use: removed Numba decorators change only speed, two operators need lists of names, and
``is`` for ``==`` is no realistic error."""

NO_HARDWARE = ("_Div", "_FloorDiv", "_Mod", "_Pow")
"""Endings of operators that are not used for RTL, because Amaranth rejects them or the error is not realistic."""


@dataclass(frozen=True)
class Mutant:
    """One edit of one place in a file."""

    file: str  # ``rtl/taxel.py``
    function: str  # qualified name of the innermost function or class around the place; empty for the module
    operator: str  # of Cosmic Ray, or of ``hardware.py``
    number: int  # of the construct among those of the operator in that function, from 0
    line: int
    edit: str  # the line before and after, for a reader
    text: str  # the whole file with the edit

    @property
    def name(self) -> str:
        """Name of the mutated place, independent of other lines."""
        return f"{self.file} {self.function or 'module'} {self.operator} {self.number}"

    @property
    def of_rtl(self) -> bool:
        """True if hardware is generated from the file."""
        return self.file.startswith("rtl/")

    @property
    def kind(self) -> str:
        """Kind of the mutation operator."""
        return self.operator.partition("_")[0]

    @property
    def block(self) -> str:
        """Block or package of the file, such as ``taxel`` or ``registers``."""
        return Path(self.file).with_suffix("").parts[1]


@dataclass(frozen=True)
class Place:
    """A place in a file that a mutation operator can edit."""

    operator: str
    function: str
    number: int
    occurrence: int


def places(file: str, text: str) -> dict[tuple[int, int], list[Place]]:
    """Return the places of a file that mutation operators can edit."""
    nodes = list(ast_nodes(get_ast(text)))
    functions = _functions(text)
    found: dict[tuple[int, int], list[Place]] = {}
    for name, operator in _operators(file.startswith("rtl/")).items():
        numbers: Counter[str] = Counter()
        occurrence = 0
        for node in nodes:
            for start, _ in operator.mutation_positions(node):
                around = [function for function in functions if function[0] <= start[0] <= function[1]]
                function = max(around)[2] if around else ""
                found.setdefault(start, []).append(Place(name, function, numbers[function], occurrence))
                numbers[function] += 1
                occurrence += 1
    return dict(sorted(found.items()))


def sample(file: str, text: str, share: float, fewest: int, seed: int) -> tuple[list[Mutant], int]:
    """Return a random sample of a file's mutants, and the number of its mutable places.

    Which mutants are drawn from a file does not depend on other files. Edits of annotations and decorators are left
    out, as are edits that are no Python.
    """
    every = list(places(file, text).values())
    count = min(len(every), max(fewest, round(share * len(every))))
    ends = [number * len(every) // count for number in range(count + 1)] if count else []
    rng = random.Random(f"{seed} {file}")
    found: dict[str, Mutant] = {}
    for stretch in pairwise(ends):
        for number in rng.sample(range(*stretch), stretch[1] - stretch[0]):
            choices = rng.sample(every[number], len(every[number]))
            if mutant := next(filter(None, (mutated(file, text, place) for place in choices)), None):
                found[mutant.text] = mutant
                break
    return list(found.values()), len(every)


def mutated(file: str, text: str, place: Place) -> Mutant | None:
    """Return the mutant for a place; None if the edit does not change the program."""
    try:
        new = mutate_code(text, _operators(file.startswith("rtl/"))[place.operator], place.occurrence)
        if new is None or _meaning(new) == _meaning(text):
            return None
    except (SyntaxError, AttributeError):  # ExceptionReplacer knows no exception with a dot in its name
        return None
    before, after = text.splitlines(), new.splitlines()
    line = next(n for n, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1])
    edit = f"{before[line].strip()} -> {after[line].strip()}"
    return Mutant(file, place.function, place.operator, place.number, line + 1, edit, new)


@cache
def _operators(hardware: bool) -> dict[str, Operator]:
    """Return the mutation operators by name, with hardware operators only for RTL."""
    found: dict[str, Operator] = {}
    for name in operator_names():
        short = name.partition("/")[2]
        if not LEFT_OUT.fullmatch(short) and not (hardware and short.endswith(NO_HARDWARE)):
            found[short] = get_operator(name)()
    return found | (HARDWARE if hardware else {})


@cache
def _functions(text: str) -> list[tuple[int, int, str]]:
    """Return first line, last line and qualified name of every function and class."""

    def walk(node: ast.AST, name: str) -> Iterator[tuple[int, int, str]]:
        for child in ast.iter_child_nodes(node):
            inner = name
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = f"{name}.{child.name}" if name else child.name
                yield child.lineno, child.end_lineno or child.lineno, inner
            yield from walk(child, inner)

    return list(walk(ast.parse(text), ""))


@cache
def _meaning(text: str) -> str:
    """Return the syntax tree of a program without annotations and decorators."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        changed: Any = node
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            changed.decorator_list = []
        if isinstance(node, ast.FunctionDef):
            changed.returns = None
        if isinstance(node, ast.arg | ast.AnnAssign):
            changed.annotation = ast.Constant(None)
    return ast.dump(tree)
