"""Generate plain Verilog-2005 of the readout."""

import re
from collections.abc import Callable, Iterator
from typing import Any

from eskin.model import __version__
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import is_off, unused
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl import yosys
from eskin.rtl.block import Block, RtlilModules
from eskin.rtl.bus.wrapper import AxiReadout
from eskin.rtl.classifier.chip import Chip
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.classifier.lane import Lane, Limit
from eskin.rtl.classifier.memory import (
    InputMemory,
    NeuronMemory,
    ParameterMemory,
    PotentialMemory,
    RecurrentMemory,
)
from eskin.rtl.encoders.fields import Fields
from eskin.rtl.frame import FrameReadout
from eskin.rtl.gates import clock_gates
from eskin.rtl.readout import Readout
from eskin.rtl.tiles.merge import Merge
from eskin.rtl.tiles.skin import Skin

Config = ReadoutConfig | FrameConfig | ClassifierConfig | ChipConfig | MergeConfig | BusConfig
"""Configuration of ``eskin_readout``, ``eskin_frame_readout``, ``eskin_classifier``, ``eskin_chip``, ``eskin_merge`` or
``eskin_axi``.

A ``TilesConfig``, which is a ``ReadoutConfig`` too, is the configuration of ``eskin_tiles``.
"""

# Amaranth's RTLIL to readable Verilog: one always block per register with its reset and enable, no initial values.
# In the classifier alone, splitnets splits a vector by its drivers, because some logic uses only a few of its bits.
# The order matters: Amaranth's own wires must be gone before opt_dff looks for the reset and enable of a register.
YOSYS_SCRIPT = (
    "read_rtlil readout.il; delete t:$meminit_v2; hierarchy -check -top {top}; "
    "proc -norom; opt_expr; opt_merge; opt_clean; opt_dff; "
    "opt_expr -mux_undef; wreduce; splitnets -driver eskin_classifier; opt_clean -purge; "
    "setattr -unset init w:*; check -assert; write_verilog -noattr readout.v"
)

WAIVERS = {
    "DECLFILENAME": "all modules of the readout are in this one file",
    "WIDTHEXPAND": "a narrower operand is extended by its sign, as Verilog defines it",
}
"""Lint warnings that are waived in the whole file, each with its reason."""

FRAME_WAIVERS = WAIVERS | {"WIDTHEXPAND": "a narrower operand is extended by zeros: all numbers are unsigned"}

CLASSIFIER_WAIVERS = WAIVERS | {"CASEOVERLAP": "each condition of a case compares one state: at most one of them holds"}

KINDS: dict[type, tuple[Callable[[Any], Block[Any]], str]] = {
    ReadoutConfig: (Readout, "spiking e-skin readout"),
    FrameConfig: (FrameReadout, "frame-based e-skin readout"),
    ClassifierConfig: (Classifier, "classifier of a spiking e-skin readout"),
    ChipConfig: (Chip, "spiking e-skin readout with its classifier"),
    MergeConfig: (lambda config: Merge(config.skin), "merge of the events of spiking e-skin readouts"),
    TilesConfig: (Skin, "spiking e-skin of tiles with the merge of their events"),
    BusConfig: (AxiReadout, "spiking e-skin readout behind AXI"),
}
"""Top module of every kind of configuration, and what the design is."""


def top_block(config: Config) -> Block[Any]:
    """Return the top module of a configuration."""
    return KINDS[type(config)][0](config)


def clock_and_reset(config: Config) -> tuple[str, str]:
    """Return the names of the clock and reset of a design."""
    return ("aclk", "aresetn") if isinstance(config, BusConfig) else ("clk", "rst")


def verilog(config: Config, gated: bool = False) -> str:
    """Return the readout as plain Verilog-2005 text, with one module per distinct block.

    The text depends on the configuration, ``gated``, and the pinned versions of Amaranth and Yosys only. With ``gated``
    it has the port ``test_enable`` and instances of ``eskin_clock_gate``, which is a text of its own (``BEHAVIOUR``).
    Behind a bus, the readout is the same text as without the bus.
    """
    if isinstance(config, BusConfig):
        return wrapper(config, gated) + verilog(config.readout, gated)
    return header(config, "//", gated) + _waive(_text(config, gated), config)


def wrapper(config: BusConfig, gated: bool = False) -> str:
    """Return the modules around the readout as Verilog text."""
    modules = re.findall(r"^module .*?^endmodule\n", _text(config, gated), re.MULTILINE | re.DOTALL)
    own = "\n".join(text for text in modules if text.startswith(f"module {AxiReadout.module_name}"))
    return header(config, "//", gated) + _waive(own, config)


def _text(config: Config, gated: bool) -> str:
    """Return all modules of a design, without header and waivers."""
    top = top_block(config)
    if not gated:
        return block_verilog(top)
    return _marked(clock_gates.gated(block_rtlil(top), top.module_name, config.reset == "sync"))


def block_verilog(block: Block[Any]) -> str:
    """Return a block and its submodules as Verilog text, with attributes at the synchronisers."""
    script = YOSYS_SCRIPT.format(top=block.module_name)
    return _marked(yosys.tidy(yosys.run(script, block_rtlil(block), "readout.v")))


def _marked(text: str) -> str:
    """Return Verilog text with attributes that make tools keep synchroniser flip-flops and the limiter."""
    for module, names in clock_gates.SYNCHRONISERS.items():
        for name in names:
            text = yosys.mark(text, module, name, '(* async_reg = "true", keep = "true" *)')
    return text.replace(f"module {Limit.module_name}(", f'(* keep_hierarchy = "yes" *)\nmodule {Limit.module_name}(')


def rtlil(config: Config) -> str:
    """Return the readout as RTLIL text with one module per distinct block."""
    return block_rtlil(top_block(config))


def block_rtlil(block: Block[Any]) -> str:
    """Return a block and its submodules as RTLIL text."""
    netlist = RtlilModules(block.config.reset == "async")
    netlist.add(block)
    return netlist.text


def what_is(config: Config) -> str:
    """Return a short description of a configuration."""
    return KINDS[type(config)][1]


def header(config: Config, comment: str, gated: bool = False) -> str:
    """Return the header of a generated file as comment lines: description, licence, configuration, and any gates."""
    lines = [
        f"{top_block(config).module_name}: {what_is(config)}, version {__version__}",
        "SPDX-License-Identifier: Apache-2.0",
        "Generated; do not edit. Configuration:",
        *(f"  {name} = {value}" for name, value in config.to_dict().items()),
        *(["  clock_gates = True"] if gated else []),
    ]
    return "".join(yosys.comment(line, comment, "    ") for line in lines)


def _waive(text: str, config: Config) -> str:
    """Return Verilog text with lint waivers and their reasons."""
    waivers = FRAME_WAIVERS if isinstance(config, FrameConfig) else WAIVERS
    if isinstance(config, ClassifierConfig | ChipConfig):
        waivers = CLASSIFIER_WAIVERS
    if "()" in text:
        waivers = waivers | {"PINCONNECTEMPTY": "an output that nothing takes is left open"}
    for warning, reason in reversed(waivers.items()):
        text = yosys.waive(text, warning, reason)
    for module, signal, why in _unused(text, config):
        text = yosys.waive_signal(text, module, signal, "UNUSEDSIGNAL", why)
    return text


def _unused(text: str, config: Config) -> Iterator[tuple[str, str, str]]:
    """Yield module and name of every signal that may be unused in a Verilog text, and the reason."""
    awake = "low in a clock at whose end no register changes: for a clock gate, should there be one"
    of_array = (
        "low in a clock at whose end no register of rows and arbiter changes: for their clock gate, never for that of "
        "link or host registers"
    )
    readout = config.readout if isinstance(config, ChipConfig) else config
    network = config.classifier if isinstance(config, ChipConfig) else config
    if isinstance(config, BusConfig):
        for name in ("s_axi_awaddr", "s_axi_araddr"):
            yield "eskin_axi_lite", name, "registers are words: the lowest two bits have no effect"
        for name in ("s_axi_awprot", "s_axi_arprot"):
            yield "eskin_axi_lite", name, "every access is allowed"
    if isinstance(readout, FrameConfig):
        yield FrameReadout.module_name, "awake", awake
    if isinstance(readout, ReadoutConfig):
        yield Readout.module_name, "awake", of_array
        if readout.frontend == "digital" and readout.grid > 1:
            why = "bits below the encoder's step can never change a decision: the taxel keeps the others"
            yield "eskin_taxel", "sample", why
        if is_off(readout).any():
            enable = "taxel_enable" if readout.registers == "none" else "host_enabled"
            yield Readout.module_name, enable, "a taxel without a receptive field is off"
        if readout.frontend == "digital" and unused(readout):
            yield Fields.module_name, "sample", "no receptive field has that taxel"
        if readout.registers != "none":
            yield "eskin_registers", "write_data", "no register has a field there"
    if isinstance(network, ClassifierConfig):
        yield Classifier.module_name, "awake", awake
        for block in (InputMemory, RecurrentMemory, NeuronMemory, ParameterMemory, PotentialMemory, Lane):
            yield block.module_name, "rst", "a memory has no reset"
        for memory, words in ((InputMemory, network.input_words), (RecurrentMemory, network.recurrent_words)):
            for port in ("read_address", "write_address") if words == 1 else ():
                yield memory.module_name, port, "the memory has one word"
        for name in re.findall(r"^  wire .*\b(leak_product\w*);", text, re.MULTILINE):
            yield Classifier.module_name, name, "the bits below a leak's shift are cut off"
