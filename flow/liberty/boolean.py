"""Evaluate Boolean expressions of a Liberty file, and convert them to Verilog."""

import functools
import itertools
import operator
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError

Bits = NDArray[np.bool_]
OPERATORS = {"And": (operator.and_, "&"), "Or": (operator.or_, "|"), "Xor": (operator.xor, "^")}


@functools.cache
def expression(text: str) -> Any:
    """Return a Liberty expression as a sympy expression."""
    from liberty.boolean_functions import parse_boolean_function

    try:
        return parse_boolean_function(text)
    except Exception as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InputError(f"the expression {text!r} of the cell library cannot be read: {reason}") from None


def literal(text: str) -> str:
    """Return a Liberty expression of one literal without blanks and parentheses."""
    return text.replace(" ", "").strip("()")


def evaluate(text: str, values: Mapping[str, Bits]) -> Bits:
    """Return the values of an expression, for values of its names in shapes that NumPy can broadcast."""
    try:
        return _value(expression(text), values)
    except KeyError as name:
        raise InputError(f"the expression {text!r} of the cell library has the unknown name {name}") from None


def _value(node: Any, values: Mapping[str, Bits]) -> Bits:
    if not node.args:
        return np.array(bool(node)) if node.is_Boolean else values[str(node)]
    found = [_value(part, values) for part in node.args]
    kind = type(node).__name__
    return ~found[0] if kind == "Not" else functools.reduce(OPERATORS[kind][0], found)


@functools.lru_cache(maxsize=4096)
def possible(text: str, inputs: tuple[tuple[str, str], ...]) -> str:
    """Return the value of an expression for inputs "0", "1" or "x" (unknown).

    Examples
    --------
    >>> possible("!(A & B)", (("A", "0"), ("B", "x")))
    '1'
    >>> possible("A ^ B", (("A", "0"), ("B", "x")))
    'x'
    """
    levels = [(False, True) if value not in ("0", "1") else (value == "1",) for _, value in inputs]
    cases = zip(*itertools.product(*levels), strict=True)
    found = np.unique(evaluate(text, {name: np.array(bits) for (name, _), bits in zip(inputs, cases, strict=False)}))
    return str(int(found[0])) if len(found) == 1 else "x"


@functools.cache
def verilog_of(text: str) -> str:
    """Return a Liberty expression as Verilog.

    Examples
    --------
    >>> verilog_of("!(A B')")
    '~(A & ~B)'
    """
    return _written(expression(text))


def _written(node: Any) -> str:
    if not node.args:
        return f"1'b{int(bool(node))}" if node.is_Boolean else str(node)
    words = [_written(part) for part in sorted(node.args, key=str)]
    kind = type(node).__name__
    return f"~{words[0]}" if kind == "Not" else "(" + f" {OPERATORS[kind][1]} ".join(words) + ")"
