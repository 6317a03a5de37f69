"""Plain Verilog-2005 of the readout."""

from __future__ import annotations

from typing import Any

from model import __version__
from model.config import ReadoutConfig
from model.frame_config import FrameConfig
from rtl import yosys
from rtl.block import Block, Netlist
from rtl.frame import FrameReadout
from rtl.readout import Readout

Config = ReadoutConfig | FrameConfig
"""The configuration says which readout is meant: ``eskin_readout`` or ``eskin_frame_readout``."""

# Amaranth's RTLIL to readable Verilog: one always block per register with its reset and enable, no initial values.
# The order matters: Amaranth's own wires must be gone before opt_dff looks for the reset and enable of a register.
YOSYS_SCRIPT = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc -norom; opt_expr; opt_merge; opt_clean; opt_dff; "
    "opt_expr -mux_undef; wreduce; splitnets -driver; opt_clean -purge; setattr -unset init w:*; check -assert; "
    "autoname; write_verilog -noattr readout.v"
)

WAIVERS = {
    "DECLFILENAME": "all modules of the readout are in this one file",
    "WIDTHEXPAND": "a narrower operand is extended by its sign, as Verilog defines it",
}
"""Lint warnings that are waived in the whole file, each with the reason why it is meant."""

FRAME_WAIVERS = WAIVERS | {"WIDTHEXPAND": "a narrower operand is extended by zeros: all numbers are unsigned"}

UNUSED_SAMPLE_BITS = "bits below the encoder's step can never change a decision: the taxel keeps the others"


def top_block(config: Config) -> Block[Any]:
    """Return the top module of a configuration."""
    return FrameReadout(config) if isinstance(config, FrameConfig) else Readout(config)


def verilog(config: Config) -> str:
    """Return the readout as Verilog text: plain Verilog-2005, no initial values, one module per distinct block.

    The text depends on the configuration and on the pinned versions of Amaranth and Yosys only.
    """
    script = YOSYS_SCRIPT.format(top=top_block(config).module_name)
    text = yosys.tidy(yosys.run(script, rtlil(config), "readout.v"))
    return header(config, "//") + _waive(text, config)


def rtlil(config: Config) -> str:
    """Return the readout as RTLIL text, one module per distinct block."""
    netlist = Netlist(config.reset == "async")
    netlist.add(top_block(config))
    return netlist.text


def header(config: Config, comment: str) -> str:
    """Return the head of a generated file as comment lines: what it is, its licence and configuration."""
    kind = "frame-based" if isinstance(config, FrameConfig) else "spiking"
    lines = [
        f"{top_block(config).module_name}: {kind} e-skin readout, version {__version__}",
        "SPDX-License-Identifier: Apache-2.0",
        "Generated; do not edit. Configuration:",
        *(f"  {name} = {value}" for name, value in config.to_dict().items()),
    ]
    return "".join(f"{comment} {line}\n" for line in lines)


def _waive(text: str, config: Config) -> str:
    """Return the text with lint waivers, each with its reason."""
    waivers = FRAME_WAIVERS if isinstance(config, FrameConfig) else WAIVERS
    for warning, reason in reversed(waivers.items()):
        text = yosys.waive(text, warning, reason)
    if isinstance(config, ReadoutConfig) and config.frontend == "digital" and config.grid > 1:
        text = yosys.waive_input(text, "eskin_taxel", "sample", "UNUSEDSIGNAL", UNUSED_SAMPLE_BITS)
    return text
