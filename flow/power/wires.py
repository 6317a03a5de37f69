"""Estimate wire lengths from the taxel pitch, without a layout."""

from __future__ import annotations

import re

import numpy as np

from eskin.flow.gatesim.flat_netlist import FlatNetlist
from eskin.flow.wire import FARAD_PER_UM, WITHIN_UM

TAXEL = re.compile(r"\brow_(\d+)\b(?:.*?\btaxel_(\d+)\b)?")


def wires_f(netlist: FlatNetlist, rows: int, columns: int, pitch_um: float) -> dict[str, float]:
    """Return the wire capacitance of every net, estimated from the taxel pitch; empty for a pitch of 0.

    A net within a block has ``WITHIN_UM`` for every pin. A net between blocks also spans half the box around its
    blocks. A row lies along the array with its taxels spread over it. Everything else, and the ports, are at the middle
    of the left edge.
    """
    if not pitch_um:
        return {}
    pins: dict[str, list[str]] = {}
    for cell in netlist.cells:
        for net in cell.pins.values():
            pins.setdefault(net, []).append(block_of(cell.place))
    for port in netlist.ports:
        for net in port.nets:
            pins.setdefault(net, []).append("port")

    def spot(block: str) -> tuple[float, float]:
        """Return the position of a block in units of the pitch."""
        found = TAXEL.match(block)
        if not found:
            return 0.0, rows / 2
        return (float(found[2]) if found[2] else (columns - 1) / 2) + 0.5, float(found[1]) + 0.5

    def length_um(places: list[str]) -> float:
        x, y = np.array([spot(block) for block in set(places)]).T
        return WITHIN_UM * len(places) + pitch_um * float(np.ptp(x) + np.ptp(y))

    return {net: FARAD_PER_UM * length_um(places) for net, places in pins.items() if not net.startswith("1'b")}


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
