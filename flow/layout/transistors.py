"""Derive the function of a cell from its transistors with a switch-level model."""

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from eskin.flow.liberty.boolean import evaluate

SUPPLY, GROUND = "vdd", "vss"
UNKNOWN = None
Level = bool | None


@dataclass(frozen=True)
class SwitchCell:
    """A cell as a list of transistors."""

    name: str
    ports: tuple[str, ...]  # in the order of the SPICE line, with supply and ground
    # gate, the two joined nets, and True if a high gate joins them (n-channel)
    switches: tuple[tuple[str, str, str, bool], ...]
    text: str  # SPICE lines

    @property
    def pins(self) -> tuple[str, ...]:
        """Ports without supply and ground."""
        return tuple(port for port in self.ports if port not in (SUPPLY, GROUND))


def read(spice: str) -> dict[str, SwitchCell]:
    """Return the cells in a SPICE file by name: ``.subckt`` blocks of ``M... DRAIN GATE SOURCE BULK MODEL``."""
    cells = {}
    for found in re.finditer(r"^\.subckt (\S+) (.*?)\n(.*?)^\.ends.*?$", spice, re.MULTILINE | re.DOTALL):
        switches = [
            (words[2], words[1], words[3], "nfet" in words[5])
            for words in (line.split() for line in found[3].splitlines())
            if words and words[0].startswith("M")
        ]
        cells[found[1]] = SwitchCell(found[1], tuple(found[2].split()), tuple(switches), found[0])
    return cells


def settle(cell: SwitchCell, inputs: Mapping[str, Level], before: Mapping[str, Level]) -> dict[str, Level]:
    """Return the logic levels of all nets in steady state, for levels of driven pins and earlier levels of nets.

    A net without a path to supply and ground keeps its level; a net with possible paths to both is unknown.
    """
    nets = {net for switch in cell.switches for net in switch[:3]}
    fixed: dict[str, Level] = {SUPPLY: True, GROUND: False, **inputs}
    levels: dict[str, Level] = {net: before.get(net) for net in nets} | fixed
    for _ in range(4 * len(nets) + 4):
        after = {net: fixed[net] if net in fixed else _level(cell, levels, net, fixed) for net in levels}
        if after == levels:
            break
        levels = after
    return levels


def _level(cell: SwitchCell, levels: Mapping[str, Level], net: str, fixed: Mapping[str, Level]) -> Level:
    """Return the logic level of a net from its connected nets."""
    surely = {fixed[end] for end in _joined(cell, levels, net, fixed, sure=True) if end in fixed}
    perhaps = {fixed[end] for end in _joined(cell, levels, net, fixed, sure=False) if end in fixed}
    if not perhaps:
        return levels[net]
    if len(perhaps) == 1 and (surely or perhaps == {levels[net]}):
        return next(iter(perhaps))
    return UNKNOWN


def _joined(
    cell: SwitchCell, levels: Mapping[str, Level], net: str, fixed: Mapping[str, Level], *, sure: bool
) -> set[str]:
    """Return the nets connected to a net by transistors that certainly or possibly conduct."""
    seen, open_ends = {net}, [net]
    while open_ends:
        here = open_ends.pop()
        for gate, one, other, high in cell.switches:
            conducts = levels[gate] == high if sure or levels[gate] is not UNKNOWN else True
            if not conducts or here not in (one, other):
                continue
            there = other if here == one else one
            if there not in seen:
                seen.add(there)
                if there not in fixed:
                    open_ends.append(there)
    return seen - {net}


def table(cell: SwitchCell, inputs: tuple[str, ...], output: str) -> list[Level]:
    """Return the truth table of an output, with the last input changing fastest."""
    return [
        settle(cell, dict(zip(inputs, levels, strict=True)), {})[output]
        for levels in itertools.product((False, True), repeat=len(inputs))
    ]


def does(cell: SwitchCell, inputs: tuple[str, ...], output: str, function: str) -> bool:
    """Return True if the transistors of a cell compute a given function, in Liberty syntax."""
    levels = np.array(list(itertools.product((False, True), repeat=len(inputs))))
    values = evaluate(function, dict(zip(inputs, levels.T, strict=True)))
    return table(cell, inputs, output) == values.tolist()


def stores(cell: SwitchCell, data: str, clock: str, output: str) -> bool:
    """Return True if the transistors of a cell form a rising-edge flip-flop."""
    levels: Mapping[str, Level] = {}
    held: Level = UNKNOWN
    word = False
    # every pair of old and new data, and data that changes while the clock is low and while it is high
    for word, early in itertools.product((False, True, True, False, False), (False, True)):
        for clocked, value in ((False, early), (False, word), (True, word), (True, not word), (False, not word)):
            held = word if clocked else held
            levels = settle(cell, {data: value, clock: clocked}, levels)
            if levels[output] is not held:
                return False
    return True
