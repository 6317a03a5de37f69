"""Small wrong edits of the RTL's source, found by its grammar: what a slip of the pen could have written."""

from __future__ import annotations

import ast
import hashlib
import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flow.formal.mutants import Mutant

COMPARISONS = {ast.Eq: "!=", ast.NotEq: "==", ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
OPERATORS = {ast.BitAnd: "|", ast.BitOr: "&", ast.BitXor: "|", ast.Add: "-", ast.Sub: "+", ast.LShift: ">>"}
OPERATORS |= {ast.RShift: "<<"}
SIGNS = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
    ast.Add: "+",
    ast.Sub: "-",
    ast.LShift: "<<",
    ast.RShift: ">>",
    ast.And: "and",
    ast.Or: "or",
}
REDUCTIONS = {"any": "all", "all": "any"}

NO_HARDWARE = ("__init__", "settings", "signals", "fields", "address_bits", "setting")
"""Functions that describe ports, or only look something up: what they make is no logic."""


@dataclass(frozen=True)
class Change(Mutant):
    """One edit at one place.

    Parameters
    ----------
    kind : str
        ``comparison``, ``operator``, ``inversion``, ``condition``, ``constant``, ``assignment``, ``choice``,
        ``reduction``, ``reset`` or ``decision`` (one that the generator takes).
    start : int
        Place in the text of the file.
    line : int
        Its line.
    """

    kind: str = ""
    start: int = 0
    line: int = 0

    def source(self) -> str:
        """Return the text of the file with the edit."""
        text = text_of(self.file)
        end = self.start + len(self.old)
        if text[self.start : end] != self.old:
            raise ValueError(f"mutant {self.name!r}: {self.old!r} does not stand at {self.start} in {self.file}")
        return text[: self.start] + self.new + text[end:]

    @property
    def key(self) -> str:
        """Digest of the file with the edit: the same as long as the file is."""
        return hashlib.sha256(self.source().encode()).hexdigest()[:16]


def text_of(file: str) -> str:
    """Return the source of a module of ``rtl/``."""
    return Path(str(importlib.import_module(f"rtl.{file}").__file__)).read_text()


def changes(file: str) -> list[Change]:
    """Return all edits of a module of ``rtl/``, those of one place one behind the other."""
    text = text_of(file)
    found: dict[tuple[int, str, str], Change] = {}
    lines = [0]
    for line in text.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))
    for function in _hardware(ast.parse(text)):
        finder = _Finder(text, lines)
        for statement in function.body[1 if ast.get_docstring(function) else 0 :]:
            finder.visit(statement)
        for kind, start, end, new in finder.edits:
            old = text[start:end]
            row = text.count("\n", 0, start) + 1
            name = f"{file.replace('.', '/')}.py:{row}: {_short(old)} -> {_short(new)}"
            found.setdefault((start, old, new), Change(name, file, old, new, (), kind, start, row))
    return [found[place] for place in sorted(found)]


def _hardware(module: ast.Module) -> Iterator[ast.FunctionDef]:
    """Yield the functions that make hardware, those within others left out."""
    holders: list[ast.Module | ast.ClassDef] = [module]
    while holders:
        for node in holders.pop().body:
            if isinstance(node, ast.ClassDef):
                holders.append(node)
            elif isinstance(node, ast.FunctionDef) and node.name not in NO_HARDWARE and "ports" not in node.name:
                yield node


def _short(text: str) -> str:
    """Return a text in one line, as a list shows it."""
    line = " ".join(text.split()) or "nothing"
    return line if len(line) <= 60 else line[:57] + "..."


class _Finder(ast.NodeVisitor):
    """Collects edits of the statements that it visits."""

    def __init__(self, text: str, lines: list[int]) -> None:
        self.text, self.lines = text, lines
        self.edits: list[tuple[str, int, int, str]] = []
        self.deciding = False

    def _start(self, node: ast.AST) -> int:
        return self.lines[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]

    def _end(self, node: ast.AST) -> int:
        return self.lines[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]

    def _of(self, node: ast.AST) -> str:
        return self.text[self._start(node) : self._end(node)]

    def _edit(self, kind: str, node: ast.AST, new: str) -> None:
        self.edits.append(("decision" if self.deciding else kind, self._start(node), self._end(node), new))

    def _exchange(self, kind: str, left: ast.AST, right: ast.AST, sign: str, new: str) -> None:
        """Exchange the sign between two operands."""
        start = self.text.index(sign, self._end(left), self._start(right))
        self.edits.append(("decision" if self.deciding else kind, start, start + len(sign), new))

    def visit_Compare(self, node: ast.Compare) -> None:
        operator = type(node.ops[0])
        if len(node.ops) == 1 and operator in COMPARISONS:
            self._exchange("comparison", node.left, node.comparators[0], SIGNS[operator], COMPARISONS[operator])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        operator = type(node.op)
        if operator in OPERATORS and not isinstance(node.left, ast.Dict | ast.List):
            self._exchange("operator", node.left, node.right, SIGNS[operator], OPERATORS[operator])
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Attribute) and self._of(node.target).startswith("m.d."):
            of_list = isinstance(node.value, ast.List)
            for item in node.value.elts if isinstance(node.value, ast.List) else [node.value]:
                if isinstance(item, ast.Call | ast.Starred):
                    self._edit("assignment", item, "*[]" if of_list else "[]")
            self.visit(node.value)
            return
        if type(node.op) in OPERATORS and not isinstance(node.value, ast.List | ast.ListComp | ast.Name):
            sign = SIGNS[type(node.op)] + "="
            self._exchange("operator", node.target, node.value, sign, OPERATORS[type(node.op)] + "=")
        self.visit(node.value)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Invert) or not isinstance(node.operand, ast.Constant):
            kind = "inversion" if isinstance(node.op, ast.Invert) else "operator"
            self._edit(kind, node, self._of(node.operand))
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        operator = type(node.op)
        left, right = node.values[:2]
        self._exchange("decision", left, right, SIGNS[operator], "or" if operator is ast.And else "and")
        self.generic_visit(node)

    def visit_With(self, node: ast.With) -> None:
        for item in node.items:
            call = item.context_expr
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr in ("If", "Elif"):
                condition = call.args[0]
                for new in ("1", "0", f"({self._of(condition)}) == 0"):
                    self._edit("condition", condition, new)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Name) and node.func.id == "Mux":
            _, yes, no = node.args
            new = self._of(no) + self.text[self._end(yes) : self._start(no)] + self._of(yes)
            self.edits.append(("choice", self._start(yes), self._end(no), new))
        if isinstance(node.func, ast.Attribute) and node.func.attr in REDUCTIONS and not node.args:
            self._edit("reduction", node, f"{self._of(node.func.value)}.{REDUCTIONS[node.func.attr]}()")
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg in ("name", "attrs"):
            return
        if node.arg == "init" and not isinstance(node.value, ast.Constant | ast.List):
            self._edit("reset", node.value, "0")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if type(node.value) is int:
            for new in {0: (1,), 1: (0, 2)}.get(node.value, (node.value - 1, node.value + 1)):
                self._edit("constant", node, str(new))

    def visit_If(self, node: ast.If) -> None:
        self._decide(node.test)
        for statement in [*node.body, *node.orelse]:
            self.visit(statement)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._decide(node.test)
        self.visit(node.body)
        self.visit(node.orelse)

    def _decide(self, test: ast.expr) -> None:
        """Visit what the generator asks, and turn its answer round."""
        before, self.deciding = self.deciding, True
        self._edit("decision", test, f"not ({self._of(test)})")
        self.visit(test)
        self.deciding = before

    def visit_Raise(self, node: ast.Raise) -> None:
        pass

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        pass

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)
