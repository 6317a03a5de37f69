"""Generate plain Verilog-2005 of the readout."""

from __future__ import annotations

import re
from typing import Any

from eskin.model import __version__
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import is_off, unused
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl import yosys
from eskin.rtl.block import Block, RtlilModules
from eskin.rtl.classifier.chip import Chip
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.classifier.lane import Limit
from eskin.rtl.classifier.memory import InputMemory, RecurrentMemory
from eskin.rtl.encoders.fields import Fields
from eskin.rtl.frame import FrameReadout
from eskin.rtl.gates import clock_gates
from eskin.rtl.readout import Readout
from eskin.rtl.tiles.merge import Merge
from eskin.rtl.tiles.skin import Skin

Config = ReadoutConfig | FrameConfig | ClassifierConfig | ChipConfig | MergeConfig
"""What is meant: ``eskin_readout``, ``eskin_frame_readout``, ``eskin_classifier``, ``eskin_chip`` or ``eskin_merge``.

A ``TilesConfig``, which is a ``ReadoutConfig`` too, means ``eskin_tiles``.
"""

# Amaranth's RTLIL to readable Verilog: one always block per register with its reset and enable, no initial values.
# In the classifier alone a vector is split into what drives its parts: some of them use only a few bits of one.
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
"""Lint warnings that are waived in the whole file, each with the reason why it is meant."""

FRAME_WAIVERS = WAIVERS | {"WIDTHEXPAND": "a narrower operand is extended by zeros: all numbers are unsigned"}

CLASSIFIER_WAIVERS = WAIVERS | {"CASEOVERLAP": "each condition of a case compares one state: at most one of them holds"}

MEMORIES_WITHOUT_RESET = (
    "eskin_input_weights",
    "eskin_recurrent_weights",
    "eskin_neuron_weights",
    "eskin_potentials",
    "eskin_lane",
)

UNUSED_RESET = "a memory has no reset"

UNUSED_ADDRESS = "the memory has one word"

UNUSED_AWAKE = "low in a clock at whose end no register changes: for a clock gate, should there be one"

UNUSED_SAMPLE_BITS = "bits below the encoder's step can never change a decision: the taxel keeps the others"

UNUSED_TAXEL = "no receptive field has that taxel"

UNUSED_ENABLE = "a taxel without a receptive field is off"

UNUSED_PRODUCT = "the bits below a leak's shift are cut off"

UNUSED_WRITE_BITS = "no register has a field there"


def top_block(config: Config) -> Block[Any]:
    """Return the top module of a configuration."""
    if isinstance(config, ClassifierConfig):
        return Classifier(config)
    if isinstance(config, ChipConfig):
        return Chip(config)
    if isinstance(config, MergeConfig):
        return Merge(config.skin)
    if isinstance(config, TilesConfig):
        return Skin(config)
    return FrameReadout(config) if isinstance(config, FrameConfig) else Readout(config)


def verilog(config: Config, gated: bool = False) -> str:
    """Return the readout as plain Verilog-2005 text, with one module per distinct block.

    The text depends on the configuration, ``gated``, and the pinned versions of Amaranth and Yosys only.

    Parameters
    ----------
    config : Config
    gated : bool
        With the port ``test_enable`` and instances of ``eskin_clock_gate``, which is a text of its own (``BEHAVIOUR``).
    """
    if gated:
        top = top_block(config)
        text = clock_gates.gated(rtlil(config), top.module_name, config.reset == "sync")
        return header(config, "//") + _waive(_marked(text), config)
    return header(config, "//") + _waive(block_verilog(top_block(config)), config)


def block_verilog(block: Block[Any]) -> str:
    """Return a block and its submodules as Verilog text, with attributes at the synchronisers."""
    script = YOSYS_SCRIPT.format(top=block.module_name)
    return _marked(yosys.tidy(yosys.run(script, block_rtlil(block), "readout.v")))


def _marked(text: str) -> str:
    """Return Verilog text with attributes that keep tools from merging synchroniser flip-flops, and the limiter."""
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
    if isinstance(config, ClassifierConfig):
        return "classifier of a spiking e-skin readout"
    if isinstance(config, ChipConfig):
        return "spiking e-skin readout with its classifier"
    if isinstance(config, MergeConfig):
        return "merge of the events of spiking e-skin readouts"
    if isinstance(config, TilesConfig):
        return "spiking e-skin of tiles with the merge of their events"
    return f"{'frame-based' if isinstance(config, FrameConfig) else 'spiking'} e-skin readout"


def header(config: Config, comment: str) -> str:
    """Return the header of a generated file as comment lines: description, licence and configuration."""
    lines = [
        f"{top_block(config).module_name}: {what_is(config)}, version {__version__}",
        "SPDX-License-Identifier: Apache-2.0",
        "Generated; do not edit. Configuration:",
        *(f"  {name} = {value}" for name, value in config.to_dict().items()),
    ]
    return "".join(f"{comment} {line}\n" for line in lines)


def _waive(text: str, config: Config) -> str:
    """Return Verilog text with lint waivers and their reasons."""
    waivers = FRAME_WAIVERS if isinstance(config, FrameConfig) else WAIVERS
    if isinstance(config, ClassifierConfig | ChipConfig):
        waivers = CLASSIFIER_WAIVERS
    if "()" in text:
        waivers = waivers | {"PINCONNECTEMPTY": "an output that nothing takes is left open"}
    for warning, reason in reversed(waivers.items()):
        text = yosys.waive(text, warning, reason)
    readout = config.readout if isinstance(config, ChipConfig) else config
    if isinstance(readout, ReadoutConfig | FrameConfig):
        array = FrameReadout if isinstance(readout, FrameConfig) else Readout
        text = yosys.waive_signal(text, array.module_name, "awake", "UNUSEDSIGNAL", UNUSED_AWAKE)
    if isinstance(readout, ReadoutConfig) and readout.frontend == "digital" and readout.grid > 1:
        text = yosys.waive_signal(text, "eskin_taxel", "sample", "UNUSEDSIGNAL", UNUSED_SAMPLE_BITS)
    if isinstance(readout, ReadoutConfig) and is_off(readout).any():
        text = yosys.waive_signal(text, Readout.module_name, "taxel_enable", "UNUSEDSIGNAL", UNUSED_ENABLE)
    if isinstance(readout, ReadoutConfig) and readout.frontend == "digital" and unused(readout):
        text = yosys.waive_signal(text, Fields.module_name, "sample", "UNUSEDSIGNAL", UNUSED_TAXEL)
    if isinstance(readout, ReadoutConfig) and readout.registers != "none":
        text = yosys.waive_signal(text, "eskin_registers", "write_data", "UNUSEDSIGNAL", UNUSED_WRITE_BITS)
    if isinstance(config, ClassifierConfig | ChipConfig):
        text = yosys.waive_signal(text, Classifier.module_name, "awake", "UNUSEDSIGNAL", UNUSED_AWAKE)
        for module in MEMORIES_WITHOUT_RESET:
            text = yosys.waive_signal(text, module, "rst", "UNUSEDSIGNAL", UNUSED_RESET)
        network = config.classifier if isinstance(config, ChipConfig) else config
        for memory, words in ((InputMemory, network.input_words), (RecurrentMemory, network.recurrent_words)):
            for port in ("read_address", "write_address") if words == 1 else ():
                text = yosys.waive_signal(text, memory.module_name, port, "UNUSEDSIGNAL", UNUSED_ADDRESS)
        for name in re.findall(r"^  wire .*\b(leak_product\w*);", text, re.MULTILINE):
            text = yosys.waive_signal(text, "eskin_classifier", name, "UNUSEDSIGNAL", UNUSED_PRODUCT)
    return text
