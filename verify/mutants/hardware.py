"""Operators of Cosmic Ray for Amaranth: dropped assignments, constant conditions, swapped values.

Cosmic Ray finds them by the entry point ``cosmic_ray.operator_providers`` of this package.
"""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import parso
from cosmic_ray.operators.operator import Example, Operator

Edit = tuple[Any, str]
"""A node of parso below the current node, and the code that replaces it."""

Position = tuple[int, int]


class HardwareOperator(Operator):
    """Operator that replaces parts of a syntax tree node, one part in each mutant."""

    @staticmethod
    @abstractmethod
    def edits(node: Any) -> Iterator[Edit]:
        """Yield the edits of a node."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:
        """Yield start and end position of each edit."""
        for part, _ in list(self.edits(node)):
            yield part.start_pos, part.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """Apply an edit to a node and return the node."""
        part, code = list(self.edits(node))[index]
        siblings = part.parent.children
        siblings[siblings.index(part)] = parso.parse(part.get_first_leaf().prefix + code)
        return node


def arguments(node: Any, *names: str) -> Any:
    """Return the arguments of a call with a given function name; None for other nodes."""
    children = getattr(node, "children", [])
    if node.type != "atom_expr" or len(children) < 2 or children[-1].type != "trailer":
        return None
    callee, call = "".join(child.get_code(include_prefix=False) for child in children[:-1]), children[-1].children
    return call[1] if callee in names and call[0].value == "(" and len(call) == 3 else None


class DropAssignment(HardwareOperator):
    """Drop an assignment from ``m.d.comb += ...`` or ``m.d.sync += [..., ...]``."""

    @staticmethod
    def edits(node: Any) -> Iterator[Edit]:
        """Yield an edit for each assignment of a statement."""
        if node.type != "expr_stmt" or not node.get_code(include_prefix=False).startswith("m.d."):
            return
        value = node.children[-1]
        if value.type != "atom" or value.children[0].value != "[":
            yield value, "[]"
        elif getattr(value.children[1], "type", "") == "testlist_comp":
            items = value.children[1].children
            if not any(item.type in ("sync_comp_for", "comp_for") for item in items):
                yield from ((item, "*[]") for item in items[::2])

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """Return a statement of one assignment, and the second assignment of a list."""
        listed = "m.d.comb += [a.eq(1), b.eq(2)]"
        return Example("m.d.sync += a.eq(1)", "m.d.sync += []"), Example(listed, "m.d.comb += [a.eq(1), *[]]", 1)


class StickCondition(HardwareOperator):
    """Make the condition of ``m.If`` or ``m.Elif`` true, false or inverted."""

    @staticmethod
    def edits(node: Any) -> Iterator[Edit]:
        """Yield the three edits of a condition."""
        if condition := arguments(node, "m.If", "m.Elif"):
            yield from ((condition, code) for code in ("1", "0", f"({condition.get_code().strip()}) == 0"))

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """Return the three edits of a condition."""
        edited = ("with m.If(1): pass", "with m.If(0): pass", "with m.If((a & b) == 0): pass")
        return tuple(Example("with m.If(a & b): pass", one, number) for number, one in enumerate(edited))


class SwapChoice(HardwareOperator):
    """Swap the two values of a ``Mux``."""

    @staticmethod
    def edits(node: Any) -> Iterator[Edit]:
        """Yield the edit of a choice."""
        chosen = arguments(node, "Mux")
        if chosen is not None and chosen.type == "arglist":
            condition, yes, no = (part.get_code().strip() for part in chosen.children[::2][:3])
            yield chosen, f"{condition}, {no}, {yes}"

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """Return an edited choice."""
        return (Example("x = Mux(a, b, c)", "x = Mux(a, c, b)"),)


class SwapReduction(HardwareOperator):
    """Swap the reductions ``all`` and ``any``."""

    @staticmethod
    def edits(node: Any) -> Iterator[Edit]:
        """Yield the edit of a reduction."""
        if node.type == "trailer" and node.children[0].value == "." and node.children[1].value in ("any", "all"):
            yield node.children[1], {"any": "all", "all": "any"}[node.children[1].value]

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """Return both edited reductions."""
        return Example("x = a.any()", "x = a.all()"), Example("x = a.all()", "x = a.any()")


class Hardware(dict[str, type[HardwareOperator]]):
    """The operators by name, as Cosmic Ray asks for them."""

    def __init__(self) -> None:
        super().__init__({one.__name__: one for one in (DropAssignment, StickCondition, SwapChoice, SwapReduction)})
