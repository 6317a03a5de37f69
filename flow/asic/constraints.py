"""Write timing constraints (SDC) for synthesis and sign-off, complete for all ports and endpoints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eskin.flow.asic.synthesis import Netlist
from eskin.flow.liberty.library import Cell, Library
from eskin.model.config import ReadoutConfig
from eskin.rtl import delivery
from eskin.rtl.link import requests
from eskin.rtl.verilog import header


def sdc(netlist: Netlist, period: str = "") -> str:
    """Return the timing constraints of a netlist; ``period`` is a time in ns or a Tcl expression."""
    config = netlist.config
    lines = [
        f"set period_ns {period or f'{1e9 / config.clock_hz:.6g}'}",
        "create_clock -name clk -period $period_ns [get_ports {clk}]",
        f"set_clock_uncertainty -setup [expr {delivery.UNCERTAINTY} * $period_ns] [get_clocks clk]",
        f"set_clock_uncertainty -hold {delivery.HOLD_NS} [get_clocks clk]",
        "",
        "# rst is released in step with the clock; its tree, as the clock's, is made by layout.",
        *_delays(netlist),
        "",
        *_edges(netlist),
        f"set_load -pin_load {delivery.LOAD_PF} [all_outputs]",
    ]
    if isinstance(config, ReadoutConfig) and config.handshake:
        lines += ["", *_four_phase(config)]
    return header(config, "#") + "\n" + "\n".join(lines) + "\n"


def _delays(netlist: Netlist) -> Iterator[str]:
    """Yield the external delay of every port as a fraction of the clock period."""
    macro = dict.fromkeys(delivery.MACRO_IN, delivery.DECISION_IN) | dict.fromkeys(delivery.MACRO_OUT, delivery.DAC_OUT)
    shares: dict[tuple[str, float], list[str]] = {}
    for port in delivery.ports(netlist.config, True):
        name, way = port["name"], port["direction"]
        if name != "clk":
            share = macro.get(name, delivery.OUTSIDE)
            shares.setdefault((way, share), []).append(name + ("[*]" if port["width"] > 1 else ""))
    for (way, share), names in shares.items():
        yield f"set_{way}_delay [expr {share} * $period_ns] -clock clk [get_ports {{{' '.join(names)}}}]"


def _edges(netlist: Netlist) -> Iterator[str]:
    """Yield the driving cells of the inputs, or edge times for clk, rst and libraries without a buffer."""
    inputs = [port for port in delivery.ports(netlist.config, True) if port["direction"] == "input"]
    names = [port["name"] + ("[*]" if port["width"] > 1 else "") for port in inputs]
    driven = " ".join(name for name in names if name not in ("clk", "rst"))
    if buffers := plain_buffers(netlist.library):
        cell = buffers[len(buffers) // 2]
        pin = cell.drives(cell.inputs[0])
        yield f"set_driving_cell -lib_cell {cell.name} -pin {pin} [get_ports {{{driven}}}]"
    else:
        yield f"set_input_transition {delivery.EDGE_NS} [get_ports {{{driven}}}]"
    yield f"set_input_transition {delivery.CLOCK_EDGE_NS} [get_ports {{clk rst}}]"


def plain_buffers(library: Library) -> list[Cell]:
    """Return the buffers of a library from smallest to largest, without delay cells.

    A delay cell is more than twice as slow as the fastest buffer, each with four times its own input as its load.
    """
    loads = {cell.name: 4 * next(iter(cell.loads.values())) for cell in library.buffers}
    delays = {c.name: float(c.worst(delivery.EDGE_NS * 1e-9, np.array([loads[c.name]]))[0][0]) for c in library.buffers}
    return [cell for cell in library.buffers if delays[cell.name] <= 2 * min(delays.values())]


def _four_phase(config: ReadoutConfig) -> Iterator[str]:
    """Yield the constraints of the asynchronous pins."""
    yield "# aer_ack comes at any time; two flops take it. The way to the first is short, so that it settles."
    yield "set_max_delay [expr 0.5 * $period_ns] -from [get_ports {aer_ack}]"
    yield "# Bundled data: aer_addr stands a clock before aer_req rises, and less than a clock lies between their ways."
    yield f"set_max_delay $period_ns -to [get_ports {{{' '.join(requests(config))} aer_addr[*]}}]"
