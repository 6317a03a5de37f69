"""Estimate wire lengths from the taxel pitch, without a layout."""

from __future__ import annotations

import re
from dataclasses import dataclass

from eskin.flow.gatesim.flat_netlist import FlatNetlist
from eskin.flow.wire import FARAD_PER_UM, WITHIN_UM

TAXEL = re.compile(r"\brow_(\d+)\b(?:.*?\btaxel_(\d+)\b)?")


@dataclass(frozen=True)
class Wires:
    """Wire length estimate from the taxel pitch."""

    rows: int
    columns: int
    pitch_um: float  # 0 for no wires

    def capacitance_f(self, netlist: FlatNetlist) -> dict[str, float]:
        """Return the wire capacitance of every net.

        A net within a block has ``WITHIN_UM`` for every pin. One that leaves it spans half the box around its blocks:
        a row lies along the array with its taxels spread over it, all else and the ports at the middle of the left
        edge.
        """
        if not self.pitch_um:
            return {}
        pins: dict[str, list[str]] = {}
        for cell in netlist.cells:
            for net in cell.pins.values():
                pins.setdefault(net, []).append(block_of(cell.place))
        for port in netlist.ports:
            for net in port.nets:
                pins.setdefault(net, []).append("port")
        return {net: FARAD_PER_UM * self._length(places) for net, places in pins.items() if not net.startswith("1'b")}

    def _length(self, places: list[str]) -> float:
        """Return the length of a net in um."""
        inside = WITHIN_UM * len(places)
        blocks = set(places)
        if len(blocks) == 1:
            return inside
        spots = [self._spot(block) for block in blocks]
        width = max(x for x, _ in spots) - min(x for x, _ in spots)
        height = max(y for _, y in spots) - min(y for _, y in spots)
        return inside + self.pitch_um * (width + height)

    def _spot(self, block: str) -> tuple[float, float]:
        """Return the position of a block in units of the pitch."""
        found = TAXEL.match(block)
        if not found:
            return 0.0, self.rows / 2
        column = float(found[2]) if found[2] else (self.columns - 1) / 2
        return column + 0.5, float(found[1]) + 0.5


def block_of(place: str) -> str:
    """Return the block of a cell: its taxel or row, else the first part of its name, else the top.

    Examples
    --------
    >>> block_of("row_3.taxel_1._12_"), block_of("row_3._7_"), block_of("arbiter._1_"), block_of("_9_")
    ('row_3.taxel_1', 'row_3', 'arbiter', 'top')
    """
    parts = place.split(".")
    if len(parts) == 1:
        return "top"
    return ".".join(parts[:2]) if len(parts) > 2 and parts[1].startswith("taxel_") else parts[0]
