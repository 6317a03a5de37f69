"""Verilog expressions written by Yosys: parser, width rules and printer."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

COMPARISONS = {"==", "!=", "===", "!==", "<", "<=", ">", ">="}
LOGICAL = {"||", "&&"}
SHIFTS = {"<<", ">>", "<<<", ">>>"}
BITWISE = {"&", "|", "^", "~^"}
REDUCTIONS = {"&", "|", "^", "~&", "~|", "~^", "!"}

BINARY = COMPARISONS | LOGICAL | SHIFTS | BITWISE | {"~|", "+", "-", "*", "/", "%"}
"""Operators of two operands."""

MAX_IN_A_ROW = 4
"""Operands of one operator that are written without parentheses."""

NAME = re.compile(r"([A-Za-z_]\w*)(?:\[(\d+)(?::(\d+))?\])?")
TOKEN = re.compile(
    r"\s*(\d+'s?[bhd][0-9a-fxz]+|\$?[A-Za-z_]\w*(?:\[\d+(?::\d+)?\])?|\d+"
    r"|<<<|>>>|===|!==|<<|>>|<=|>=|==|!=|&&|\|\||~[&|^]|\S)"
)


class UnknownTextError(ValueError):
    """Raised for text that is not a supported expression."""


@dataclass(frozen=True)
class Wire:
    """Width and signedness of a declared wire."""

    width: int
    signed: bool = False


@dataclass(frozen=True)
class Node:
    """Node of an expression tree.

    ``kind`` is "name", "number", "slice" (of bits ``high`` to ``low``), "signed", "join" (concatenation), "unary",
    "binary" or "choice". ``text`` is the name, number or operator, and ``parts`` are the operands.
    """

    kind: str
    text: str = ""
    parts: tuple[Node, ...] = ()
    high: int = 0
    low: int = 0


def read(text: str) -> Node:
    """Return the expression tree for a text; raise UnknownTextError if Yosys writes no such plain logic.

    Yosys writes one operator at a time: operands that are operators are in parentheses.
    """
    reader = _Reader([*TOKEN.findall(text), ""][::-1])
    tree = reader.expression()
    reader.take("")
    return tree


class _Reader:
    """The tokens of an expression, the last first, behind an empty one."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens = tokens

    def take(self, token: str | None = None) -> str:
        """Return the next token, which must be the given one."""
        if self.tokens[-1] != token and (token is not None or not self.tokens[-1]):
            raise UnknownTextError(self.tokens[-1])
        return self.tokens.pop()

    def expression(self) -> Node:
        left = self.operand()
        if self.tokens[-1] in BINARY:
            left = Node("binary", self.take(), (left, self.operand()))
        if self.tokens[-1] != "?":
            return left
        self.take("?")
        yes = self.expression()
        self.take(":")
        return Node("choice", "?", (left, yes, self.expression()))

    def operand(self) -> Node:
        token = self.take()
        if token in REDUCTIONS | {"~", "-", "+"}:
            return Node("unary", token, (self.operand(),))
        if token == "$signed":
            return Node("signed", "", (self.operand(),))
        if token in ("(", "{"):
            parts = [self.expression()]
            while token == "{" and self.tokens[-1] == ",":
                self.take(",")
                parts.append(self.expression())
            self.take(")" if token == "(" else "}")
            return parts[0] if token == "(" else Node("join", "", tuple(parts))
        if "'" in token:
            return Node("number", token)
        found = NAME.fullmatch(token)
        if found is None:
            raise UnknownTextError(token)
        name, high, low = found.groups()
        return Node("name", name) if high is None else Node("slice", name, (), int(high), int(low or high))


def names(node: Node) -> list[str]:
    """Return the names in an expression, including repetitions."""
    own = [node.text] if node.kind in ("name", "slice") else []
    return own + [name for part in node.parts for name in names(part)]


def width(node: Node, wires: Mapping[str, Wire]) -> int:
    """Return the self-determined width of an expression (IEEE 1364-2005, table 5-22)."""
    if node.kind == "name":
        return wires[node.text].width
    if node.kind == "slice":
        return node.high - node.low + 1
    if node.kind == "number":
        return int(node.text.partition("'")[0].lstrip("-"))
    if node.kind == "join":
        return sum(width(part, wires) for part in node.parts)
    return max((width(part, wires) for part in _deciding(node)), default=1)


def signed(node: Node, wires: Mapping[str, Wire]) -> bool:
    """Return True if an expression is signed (IEEE 1364-2005, section 5.5.1)."""
    if node.kind == "name":
        return wires[node.text].signed
    if node.kind in ("number", "slice", "join"):
        return "'s" in node.text
    parts = _deciding(node)
    return node.kind == "signed" or (bool(parts) and all(signed(part, wires) for part in parts))


def _deciding(node: Node) -> tuple[Node, ...]:
    """Return the operands that decide width and sign of an expression; none for an expression of one unsigned bit."""
    if node.kind == "binary" and node.text in COMPARISONS | LOGICAL:
        return ()
    if node.kind == "unary" and node.text in REDUCTIONS:
        return ()
    if node.kind == "binary" and node.text in SHIFTS:
        return node.parts[:1]
    return node.parts[1:] if node.kind == "choice" else node.parts


def contexts(node: Node, outer: int, wires: Mapping[str, Wire]) -> list[int]:
    """Return the context width of each operand of an expression; 0 for self-determined operands.

    The expression itself is extended to ``outer`` bits; 0 for its own.
    """
    own = max(outer, width(node, wires))
    if node.kind == "choice":
        return [0, own, own]
    if node.kind == "binary":
        if node.text in LOGICAL:
            return [0, 0]
        if node.text in SHIFTS:
            return [own, 0]
        if node.text in COMPARISONS:
            common = max(width(part, wires) for part in node.parts)
            return [common, common]
        return [own, own]
    if node.kind == "unary" and node.text not in REDUCTIONS:
        return [own]
    return [0] * len(node.parts)


def extends_by_zeros(node: Node) -> bool:
    """Return True if zero-extension of an unsigned expression to a wider context keeps its value."""
    if node.kind == "choice" or (node.kind == "binary" and node.text in ("&", "|", "^")):
        return all(map(extends_by_zeros, node.parts[-2:]))
    if node.kind == "binary":
        return node.text in COMPARISONS | LOGICAL
    return node.kind != "unary" or node.text in REDUCTIONS


# -- plainer words for the same ----------------------------------------------------------------------


def plain(node: Node, wires: Mapping[str, Wire]) -> Node:
    """Return an expression simplified for readers, without concatenations of single bits and redundant signs."""
    if node.kind == "binary" and node.text in COMPARISONS and node.parts[1].kind == "signed":
        (number,) = node.parts[1].parts
        if number.kind == "number":
            bits = max(width(part, wires) for part in node.parts)
            return replace(node, parts=(plain(node.parts[0], wires), _decimal(number, bits)))
    node = _fitting(replace(node, parts=tuple(plain(part, wires) for part in node.parts)), wires)
    if node.kind == "signed":
        (inner,) = node.parts
        return inner if signed(inner, wires) else _signed_numbers(inner) or node
    if node.kind == "choice" and [part.text for part in node.parts[1:]] == ["1'h1", "1'h0"]:
        return node.parts[0]
    if node.kind == "unary" and node.text in ("|", "&", "~|", "!"):
        return _plain_reduction(node, wires)
    return node


def _fitting(node: Node, wires: Mapping[str, Wire]) -> Node:
    """Return a comparison or a sum with an unsigned number behind the operator, with the number as wide as the rest."""
    if node.kind != "binary" or node.text not in COMPARISONS | {"+", "-"}:
        return node
    left, right = node.parts
    found = re.fullmatch(r"(\d+)'h([0-9a-f]+)", right.text) if right.kind == "number" else None
    if found is None or (bits := width(left, wires)) <= int(found[1]):
        return node
    return replace(node, parts=(left, replace(right, text=f"{bits}'h{int(found[2], 16):0{-(-bits // 4)}x}")))


def _signed_numbers(node: Node) -> Node | None:
    """Return a constant, or a choice between constants, as signed numbers; None for other expressions."""
    if node.kind == "number":
        return _decimal(node, 0)
    if node.kind != "choice":
        return None
    parts = [_signed_numbers(part) for part in node.parts[1:]]
    chosen = tuple(part for part in parts if part is not None)
    return replace(node, parts=(node.parts[0], *chosen)) if len(chosen) == len(parts) else None


def _plain_reduction(node: Node, wires: Mapping[str, Wire]) -> Node:
    (inner,) = node.parts
    if node.text == "!":  # lint wants a single bit behind "!"
        return Node("unary", "~" if width(inner, wires) == 1 else "~|", (inner,))
    bits = inner.parts if inner.kind == "join" else (inner,)
    if node.text == "~|" or any(width(bit, wires) > 1 for bit in bits):
        return node
    tree = bits[-1]
    for bit in bits[-2::-1]:
        tree = Node("binary", node.text, (tree, bit))
    return tree


def _decimal(number: Node, bits: int) -> Node:
    """Return a number as a signed decimal constant with at least the given bits.

    The least number of its width stays as it is: its sign, put before it, would be taken of the number extended.
    """
    found = re.fullmatch(r"(\d+)'s?h([0-9a-f]+)", number.text)
    if found is None:
        return number
    own, value = int(found[1]), int(found[2], 16)
    size = max(bits, own)
    if value >> (own - 1):
        value -= 1 << own
    if value == -1 << (size - 1):
        return replace(number, text=f"{size}'sh{-value:x}")
    return replace(number, text=f"{'-' if value < 0 else ''}{size}'sd{abs(value)}")


# -- writing -----------------------------------------------------------------------------------------


def write(node: Node) -> str:
    """Return the text of an expression, with nested operators in parentheses."""
    if node.kind in ("name", "number"):
        return node.text
    if node.kind == "slice":
        at = f"{node.high}" if node.high == node.low else f"{node.high}:{node.low}"
        return f"{node.text}[{at}]"
    if node.kind == "signed":
        return f"$signed({write(node.parts[0])})"
    if node.kind == "join":
        return _write_join(node)
    if node.kind == "unary":
        inner = write(node.parts[0])
        bare = node.parts[0].kind not in ("unary", "binary", "choice")
        return f"{node.text}{inner if bare else f'({inner})'}"
    if node.kind == "binary" and node.text in BITWISE and len(chain := _chain(node, node.text)) <= MAX_IN_A_ROW:
        return f" {node.text} ".join(_operand(part) for part in chain)
    words = [_operand(part) for part in node.parts]
    if node.kind == "binary":
        return f"{words[0]} {node.text} {words[1]}"
    last = write(node.parts[2]) if node.parts[2].kind == "choice" else words[2]
    return f"{words[0]} ? {words[1]} : {last}"


def _chain(node: Node, operator: str) -> list[Node]:
    """Return the operands of a chain of one operator; long chains keep their parentheses."""
    if node.kind != "binary" or node.text != operator:
        return [node]
    return [end for part in node.parts for end in _chain(part, operator)]


def _operand(node: Node) -> str:
    bare = node.kind not in ("binary", "choice") and not (node.kind == "unary" and node.text in REDUCTIONS)
    return write(node) if bare else f"({write(node)})"


def _write_join(node: Node) -> str:
    words: list[tuple[str, int]] = []
    for word in map(write, node.parts):
        if words and words[-1][0] == word:
            words[-1] = (word, words[-1][1] + 1)
        else:
            words.append((word, 1))
    parts = [f"{{{count}{{{word}}}}}" if count > 2 else ", ".join([word] * count) for word, count in words]
    return parts[0] if len(parts) == 1 and words[0][1] > 2 else f"{{{', '.join(parts)}}}"
