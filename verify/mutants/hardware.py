"""Mutation operators for Amaranth: dropped assignments, constant conditions, swapped values."""

from collections.abc import Callable, Iterator
from typing import Any

import parso
from cosmic_ray.operators.operator import Operator

Edit = tuple[Any, str]
"""A node of parso below the current node, and the code that replaces it."""


class HardwareOperator(Operator):
    """Mutation operator that replaces a part of a syntax tree node."""

    def __init__(self, edits: Callable[[Any], Iterator[Edit]]) -> None:
        self.edits = edits

    def mutation_positions(self, node: Any) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        """Yield start and end position of each edit."""
        for part, _ in list(self.edits(node)):
            yield part.start_pos, part.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """Apply an edit to a node and return the node."""
        part, code = list(self.edits(node))[index]
        siblings = part.parent.children
        siblings[siblings.index(part)] = parso.parse(part.get_first_leaf().prefix + code)
        return node

    @classmethod
    def examples(cls) -> tuple[()]:
        """Return no examples, because the tests contain examples."""
        return ()


def arguments(node: Any, *names: str) -> Any:
    """Return the arguments of a call with a given function name; None for other nodes."""
    children = getattr(node, "children", [])
    if node.type != "atom_expr" or len(children) < 2 or children[-1].type != "trailer":
        return None
    callee, call = "".join(child.get_code(include_prefix=False) for child in children[:-1]), children[-1].children
    return call[1] if callee in names and call[0].value == "(" and len(call) == 3 else None


def drop_assignment(node: Any) -> Iterator[Edit]:
    """Drop an assignment from ``m.d.comb += ...`` or ``m.d.sync += [..., ...]``."""
    if node.type != "expr_stmt" or not node.get_code(include_prefix=False).startswith("m.d."):
        return
    value = node.children[-1]
    if value.type != "atom" or value.children[0].value != "[":
        yield value, "[]"
    elif getattr(value.children[1], "type", "") == "testlist_comp":
        items = value.children[1].children
        if not any(item.type in ("sync_comp_for", "comp_for") for item in items):
            yield from ((item, "*[]") for item in items[::2])


def stick_condition(node: Any) -> Iterator[Edit]:
    """Make the condition of ``m.If`` or ``m.Elif`` true, false or inverted."""
    if condition := arguments(node, "m.If", "m.Elif"):
        yield from ((condition, code) for code in ("1", "0", f"({condition.get_code().strip()}) == 0"))


def swap_choice(node: Any) -> Iterator[Edit]:
    """Swap the two values of a ``Mux``."""
    chosen = arguments(node, "Mux")
    if chosen is not None and chosen.type == "arglist":
        condition, yes, no = (part.get_code().strip() for part in chosen.children[::2][:3])
        yield chosen, f"{condition}, {no}, {yes}"


def swap_reduction(node: Any) -> Iterator[Edit]:
    """Swap the reductions ``all`` and ``any``."""
    if node.type == "trailer" and node.children[0].value == "." and node.children[1].value in ("any", "all"):
        yield node.children[1], {"any": "all", "all": "any"}[node.children[1].value]


HARDWARE = {
    "DropAssignment": HardwareOperator(drop_assignment),
    "StickCondition": HardwareOperator(stick_condition),
    "SwapChoice": HardwareOperator(swap_choice),
    "SwapReduction": HardwareOperator(swap_reduction),
}
"""Operators by the name that their mutants have."""
