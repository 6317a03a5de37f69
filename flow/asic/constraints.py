"""Write timing constraints (SDC) for synthesis and sign-off, complete for all ports and endpoints."""

import numpy as np

from eskin.flow import programs
from eskin.flow.asic.synthesis import Netlist
from eskin.flow.liberty.library import Cell, Library
from eskin.model.config import ReadoutConfig
from eskin.rtl import delivery
from eskin.rtl.verilog import header

MACRO = dict.fromkeys(delivery.MACRO_IN, delivery.DECISION_IN) | dict.fromkeys(delivery.MACRO_OUT, delivery.DAC_OUT)
"""External delays of the ports at comparators and DACs, as a share of the clock period."""


def sdc(netlist: Netlist, period: str = "") -> str:
    """Return the timing constraints of a netlist; ``period`` is a time in ns or a Tcl expression."""
    config = netlist.config
    delays: dict[tuple[str, float], list[str]] = {}
    driven = []
    for port in delivery.ports(config, True):
        name, way = port["name"] + ("[*]" if port["width"] > 1 else ""), port["direction"]
        if name != "clk":
            delays.setdefault((way, MACRO.get(port["name"], delivery.OUTSIDE)), []).append(name)
        if way == "input" and name not in ("clk", "rst"):
            driven.append(name)
    buffers = plain_buffers(netlist.library)
    return programs.filled(
        "netlist.sdc",
        header=header(config, "#"),
        period=period or f"{1e9 / config.clock_hz:.6g}",
        delivery=delivery,
        delays=delays,
        driven=driven,
        buffer=buffers[len(buffers) // 2] if buffers else None,
        requests=config.protocol.requests if isinstance(config, ReadoutConfig) else (),
    )


def plain_buffers(library: Library) -> list[Cell]:
    """Return the buffers of a library from smallest to largest, without delay cells.

    A delay cell is more than twice as slow as the fastest buffer, each with four times its own input as its load.
    """
    loads = {cell.name: 4 * next(iter(cell.loads.values())) for cell in library.buffers}
    delays = {c.name: float(c.worst(delivery.EDGE_NS * 1e-9, np.array([loads[c.name]]))[0][0]) for c in library.buffers}
    return [cell for cell in library.buffers if delays[cell.name] <= 2 * min(delays.values())]
