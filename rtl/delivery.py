"""Write the files beside the Verilog: port list, timing constraints, description and FuseSoC core file."""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from amaranth.hdl import Shape
from amaranth.lib import wiring

from eskin.base.files import atomic_write
from eskin.base.pages import templates
from eskin.model import __version__
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.registers.description import NAME
from eskin.model.registers.export import c_header, ip_xact, page, system_rdl
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.bus.wrapper import AxiReadout
from eskin.rtl.gates.clock_gates import BEHAVIOUR, GATE, TEST
from eskin.rtl.links import registry as links
from eskin.rtl.testbench import has_testbench, testbench
from eskin.rtl.verilog import Config, clock_and_reset, header, top_block, verilog, what_is, wrapper

PORTS_OF_ALL = {"clk": "clock, rising edge", "rst": "reset, active high, {reset}"}

PORTS = PORTS_OF_ALL | {
    "taxel_enable": "mask, bit r * columns + c for taxel (r, c); 0 silences a taxel",
    "sample": "codes of all taxels, signed, {sample_bits} bits each, taxel 0 in the least significant bits",
    "sample_valid": "sample tick",
    "above": "comparator decisions, {above}, settled before the rising edge, ignored while compare is low",
    "below": "comparator decisions, {below}, settled before the rising edge, ignored while compare is low",
    "compare": "strobes of the comparators, taxel 0 in the least significant bit, from flops; a decision counts only "
    "in a clock with its strobe",
    "reference_code": "references, for the DACs, from flops, signed, {sample_bits} bits each, in codes of a sample",
    "half_width": "half-widths, for the DACs, from {half_width_from}, unsigned, {half_width_bits} bits each, in codes",
    "step_code": "D in codes, for the comparators' DACs, from flops, unsigned; a host sets it",
    "field_select": "{{both, neighbours, own}} of every taxel, for its multiplexer, from flops, one-hot or none; taxel "
    "0 in the least significant bits; a host sets it",
}
"""Meaning of the ports of the spiking readout before those of its link.

Fields in braces are those of the configuration.
"""

HOST_PORTS = {
    "spi_sck": "SPI mode 0, asynchronous; its times stand in eskin_registers.md",
    "spi_cs_n": "chip select, active low, asynchronous",
    "spi_mosi": "from the host, asynchronous",
    "spi_miso": "to the host",
    "spi_miso_enable": "opens the pad of spi_miso: a transfer is under way",
}
"""Meaning of the ports of the spiking readout behind those of its link."""

BUS_PORTS = {
    "aclk": "clock, rising edge",
    "aresetn": "reset, active low, {reset}",
    **{name: meaning for name, meaning in PORTS.items() if name not in PORTS_OF_ALL},
    "m_axis_tvalid": "an address event is offered",
    "m_axis_tready": "the sink takes the event at this edge",
    "m_axis_tdata": "{data_bits}",
    "m_axis_tlast": "the last event of a packet: events of one row in rising columns without a pause",
    "s_axi_awaddr": "address of a register in bytes; the lowest two bits have no effect",
    "s_axi_awprot": "no effect",
    "s_axi_awvalid": "write address",
    "s_axi_awready": "high together with s_axi_wready",
    "s_axi_wdata": "the word",
    "s_axi_wstrb": "1111, else nothing is written",
    "s_axi_wvalid": "write data",
    "s_axi_wready": "high together with s_axi_awready",
    "s_axi_bresp": "10 (SLVERR) for a write without all strobes, else 00 (OKAY)",
    "s_axi_bvalid": "write response: the write has taken effect",
    "s_axi_bready": "the response is taken",
    "s_axi_araddr": "address of a register in bytes; the lowest two bits have no effect",
    "s_axi_arprot": "no effect",
    "s_axi_arvalid": "read address",
    "s_axi_arready": "it is taken",
    "s_axi_rdata": "the word",
    "s_axi_rresp": "00 (OKAY)",
    "s_axi_rvalid": "read response",
    "s_axi_rready": "the response is taken",
}
"""Meaning of the ports of a readout behind AXI."""

OUTSIDE = 0.2
"""Share of the period for the logic that drives an input or takes an output."""

DAC_OUT, DECISION_IN = 0.7, 0.7
"""Shares of a taxel's loop through its macros: references and strobes leave within 0.3 of a period, the DAC and the
comparator have 0.4, and the decision is there 0.3 before the edge that takes it."""

UNCERTAINTY = 0.05
"""Share of the period that jitter and the skew of a clock tree, which layout makes, may take."""

HOLD_NS = 0.1
"""Skew that must not break a hold time."""

LOAD_PF = 0.05
"""At every output: a wire of some 300 um, or the input of a pad."""

EDGE_NS, CLOCK_EDGE_NS = 0.5, 0.1
"""Transition times at the inputs, and at clock and reset, whose trees layout makes."""

HEADER = re.compile(r"\A(?:// .*\n){3}(?://   .*\n)*")
"""Header of a generated Verilog file."""

TEMPLATES = templates(Path(__file__).parent / "templates")

REGISTERS = ("h", "md", "rdl", "xml")
"""Ends of the names of the files that describe registers: C header, page, SystemRDL, IP-XACT."""

TEST_PORT = {
    "name": TEST,
    "direction": "input",
    "width": 1,
    "meaning": "low in operation; high, every clock gate is open, as a scan chain needs",
}

MACRO_IN, MACRO_OUT = ("above", "below"), ("compare", "reference_code", "half_width")
"""Ports at the comparators and the DACs of the analog front end."""

SPI = ("spi_sck", "spi_cs_n", "spi_mosi")
"""Inputs of the host without a relation to the clock."""

OF_TILES = "; those of a tile together, tile 0 in the least significant bits"

MERGE_PORTS = PORTS_OF_ALL | {
    "tile_valid": "tile i offers an address event, bit i",
    "tile_ready": "the event of tile i is taken at this edge, bit i; looks at no event_ready",
    "tile_row": "row of each tile's event, tile 0 in the least significant bits",
    "tile_col": "column of each tile's event, tile 0 in the least significant bits",
    "tile_polarity": "polarity of each tile's event, 1 is ON, bit i",
    "event_valid": "an address event is offered",
    "event_ready": "the sink takes the event at this edge",
    "event_tile": "tile of the event, r * {tile_columns} + c for tile (r, c) of the skin",
    "event_row": "row of the event within its tile",
    "event_col": "column of the event within its tile",
    "event_polarity": "1 is ON, 0 is OFF",
}
"""Meaning of every port of the merge."""

FRAME_PORTS = PORTS_OF_ALL | {
    "frame_start": "scan the array once; not heard during a scan",
    "row_select": "row at the converter, one-hot, 0 between frames",
    "column_select": "column at the converter, one-hot, 0 between frames",
    "adc_start": "start of a conversion, one clock; the ADC samples at the edge that ends it",
    "adc_done": "the code is there; looked at from the clock after adc_start on, a pulse or a level",
    "adc_code": "code, {resolution} bits, taken in the first clock with adc_done",
    "word_valid": "a word is offered",
    "word_ready": "the sink takes the word at this edge",
    "word_data": "codes of {resolution} bits without gaps, the first in the least significant bits",
    "word_sync": "first word of a frame",
    "frame_overrun": "the frame_start of the clock before was not heard",
}
"""Meaning of every port of the frame readout."""

CLASSIFIER_PORTS = PORTS_OF_ALL | {
    "load_valid": "write a word of weights; nothing else may be under way",
    "load_neurons": "1: into the memory of output weights and biases, 0: into that of rows",
    "load_address": "address of the word",
    "load_data": "the word, from its least significant bit on",
    "event_valid": "an event is offered",
    "event_ready": "the classifier takes the event at this edge",
    "event_channel": "channel of the event, below {inputs}",
    "bin_end": "the time bin ends with this clock",
    "scan_start": "forget potentials, spikes, evidence, overrun and stalls",
    "class_valid": "one clock: class and evidence of another bin are there",
    "class_index": "the class with the most evidence, the first among equals; held",
    "class_sure": "rises with the class_valid of the first bin in which the most evidence exceeds all others by at "
    "least {margin}; held until scan_start",
    "evidence": "of all classes, signed, {evidence_bits} bits each, class 0 in the least significant bits",
    "overrun": "a bin_end came while the work of the one before was not done; held until scan_start",
    "stall_count": "clocks in which an event waited since scan_start; stops at its end",
    "hidden_valid": "a hidden neuron is compared with its threshold",
    "hidden_index": "its number",
    "hidden_potential": "its potential, signed, {membrane_bits} bits",
    "hidden_spike": "it fires",
    "output_valid": "an output neuron is compared, or its potential counted",
    "output_index": "its number",
    "output_potential": "its potential, signed, {output_bits} bits",
    "output_spike": "it fires",
}
"""Meaning of every port of the classifier; fields in braces are those of the configuration."""

WATCHED_PORTS = {
    "event_valid": "an event is offered within",
    "event_ready": "the classifier takes it at this edge",
    "event_channel": "its channel: row * columns + column, behind all taxels for OFF events kept apart",
}
"""Meaning of the ports that are outputs of a chip with readout and classifier."""


def _fields(config: ReadoutConfig) -> dict[str, Any]:
    """Return the values for the placeholders in the port descriptions of a readout."""
    half_width = "half_width" if config.closes else str(config.step) if config.registers == "none" else "step_code"
    return config.to_dict() | {
        "above": f"x >= reference_code + {half_width + (' + 1' if config.encoder.strict else '')}",
        "below": f"x < reference_code - {half_width}",
        "half_width_from": "flops" if config.registers == "none" else "logic behind flops",
        "half_width_bits": config.half_width_bits,
        "address_bits": _address_bits(config),
    }


def _meanings(config: ReadoutConfig) -> dict[str, str]:
    """Return the meaning of every port of a readout with its link."""
    return PORTS | links.named(config.link).meanings | HOST_PORTS


def _address_bits(config: ReadoutConfig) -> str:
    """Return the meaning of each bit of an address, such as ``[4] polarity (1 = ON), [3:2] row, [1:0] column``."""
    polarity = config.has_polarity and not config.protocol.request_has_polarity
    return _bits({"column": config.column_bits, "row": config.row_bits, "polarity": int(polarity)})


def _bits(fields: Mapping[str, int]) -> str:
    """Return the meaning of each bit of a word, whose fields are given from the lowest one on by their widths."""
    parts, low = [], 0
    for name, bits in fields.items():
        shown = "polarity (1 = ON)" if name == "polarity" else name
        if bits:
            parts.append(f"[{low}] {shown}" if bits == 1 else f"[{low + bits - 1}:{low}] {shown}")
        low += bits
    return ", ".join(reversed(parts)) or "constant"


def ports(config: Config, gated: bool = False) -> Iterator[dict[str, Any]]:
    """Yield a dictionary for each port of the top module: name, direction, width in bits, meaning.

    With ``gated`` the Verilog has clock gates, and ``test_enable`` is the last port.
    """
    members = top_block(config).signature.members
    fields, meanings = config.to_dict(), FRAME_PORTS
    if isinstance(config, ClassifierConfig):
        meanings = CLASSIFIER_PORTS
    elif isinstance(config, ReadoutConfig):
        fields, meanings = _fields(config), _meanings(config)
    elif isinstance(config, ChipConfig):
        fields = _fields(config.readout) | config.classifier.to_dict()
        meanings = _meanings(config.readout) | CLASSIFIER_PORTS | WATCHED_PORTS
    elif isinstance(config, MergeConfig):
        meanings = MERGE_PORTS
    elif isinstance(config, BusConfig):
        widths = {name: bits for name, (_, bits) in config.fields().items()}
        fields, meanings = _fields(config.readout) | {"data_bits": _bits(widths)}, BUS_PORTS
    if isinstance(config, TilesConfig):
        own = {name: f"{meaning}{OF_TILES}" for name, meaning in meanings.items() if name not in MERGE_PORTS}
        if not config.relays:
            own["sample_valid"] = f"{PORTS['sample_valid']}, of all tiles"
        meanings = meanings | own | {name: text for name, text in MERGE_PORTS.items() if name.startswith("event_")}
    for name, meaning in meanings.items():
        if name in ("clk", "rst"):
            direction, width = "input", 1
        elif name in members:
            direction = "input" if members[name].flow is wiring.In else "output"
            width = Shape.cast(members[name].shape).width
        else:
            continue
        yield {"name": name, "direction": direction, "width": width, "meaning": meaning.format(**fields)}
    if gated:
        yield TEST_PORT


def description(config: Config, gated: bool = False) -> str:
    """Return the JSON description of a design: version, configuration and ports."""
    return json.dumps(
        {
            "top": top_block(config).module_name,
            "version": __version__,
            "licence": "Apache-2.0",
            "configuration": config.to_dict(),
            "clock_hz": config.clock_hz,
            "clock_gates": gated,
            "ports": [*ports(config, gated)],
        },
        indent=2,
    )


def constraints(config: Config, gated: bool = False) -> str:
    """Return the SDC timing constraints: clock, port delays and asynchronous inputs."""
    own = list(ports(config, gated))
    pins = {port["name"]: port["name"] + ("[*]" if port["width"] > 1 else "") for port in own}
    inputs = {port["name"] for port in own if port["direction"] == "input"}
    ack = links.named(config.link).asynchronous if isinstance(config, ReadoutConfig) else ()
    clock, reset = clock_and_reset(config)
    timed = [name for name in pins if name not in (clock, *ack, *SPI, *MACRO_IN, *MACRO_OUT)]
    base = "sample rate times clocks per sample"
    if isinstance(config, FrameConfig):
        base = "frame rate times clocks per frame"
    elif isinstance(config, ClassifierConfig):
        base = "clocks of a time bin, and its length"

    def joined(names: Iterable[str]) -> str:
        return " ".join(pins[name] for name in names if name in pins)

    # With the delay on rst, recovery and removal of the flops' asynchronous resets are checked.
    return timing(
        config,
        header=header(config, "#"),
        base=base,
        clock=clock,
        reset=reset,
        driven=joined(name for name in pins if name in inputs - {clock, reset}),
        inputs=joined(name for name in timed if name in inputs),
        outputs=joined(name for name in timed if name not in inputs),
        decisions=joined(MACRO_IN),
        references=joined(MACRO_OUT),
        ack=joined(ack),
        spi=joined(SPI),
    )


def timing(config: Config, **names: str) -> str:
    """Return SDC timing constraints for given names of clock, reset and ports; see ``templates/constraints.sdc``."""
    none = dict.fromkeys(("decisions", "references", "ack", "spi", "synchronised", "end"), "")
    return TEMPLATES.get_template("constraints.sdc").render(
        config=config,
        **{"UNCERTAINTY": UNCERTAINTY, "HOLD_NS": HOLD_NS, "EDGE_NS": EDGE_NS, "CLOCK_EDGE_NS": CLOCK_EDGE_NS},
        **{"LOAD_PF": LOAD_PF, "OUTSIDE": OUTSIDE, "DECISION_IN": DECISION_IN, "DAC_OUT": DAC_OUT},
        **none | names,
    )


def core(config: Config, gated: bool = False) -> str:
    """Return the FuseSoC core file (CAPI2)."""
    return TEMPLATES.get_template("design.core").render(
        header=header(config, "#"),
        top=top_block(config).module_name,
        version=__version__.split("+")[0],
        summary=_summary(config),
        files=[f"{top_block(config).module_name}.v", *_beside(config, gated)],
        bench=has_testbench(config),
    )


def _beside(config: Config, gated: bool) -> list[str]:
    """Return the Verilog files that a design needs beside its own."""
    readout = [f"{top_block(config.readout).module_name}.v"] if isinstance(config, BusConfig) else []
    return [*readout, *([f"{GATE}.v"] if gated else [])]


def _summary(config: Config) -> str:
    """Return a one-line description of a design."""
    if isinstance(config, ChipConfig):
        return f"{_summary(config.readout)}, with its classifier of {config.classifier.hidden} neurons"
    if isinstance(config, BusConfig):
        return f"{_summary(config.readout)}, behind AXI"
    what = what_is(config)
    what = what[0].upper() + what[1:]
    if isinstance(config, ClassifierConfig):
        return f"{what}, {config.inputs} inputs, {config.hidden} neurons, {config.classes} classes"
    if isinstance(config, MergeConfig):
        return f"{what}, {_tiles(config.skin)}"
    if isinstance(config, TilesConfig):
        return f"{what}, {_tiles(config)}, {config.encoding}, {config.resolution} b"
    encoding = "" if isinstance(config, FrameConfig) else f"{config.encoding}, "
    return f"{what}, {config.rows} x {config.columns} taxels, {encoding}{config.resolution} b"


def _of_registers(config: ReadoutConfig, head: str) -> dict[str, str]:
    """Return the descriptions of the registers of a readout, by file name; ``head`` is the header of its Verilog."""
    texts = {"h": head + c_header(config), "md": page(config), "rdl": head + system_rdl(config), "xml": ip_xact(config)}
    return {f"{NAME}.{end}": texts[end] for end in REGISTERS}


def _tiles(skin: TilesConfig) -> str:
    tile = skin.tile
    return f"{skin.tile_rows} x {skin.tile_columns} tiles of {tile.rows} x {tile.columns} taxels"


def write(config: Config, folder: Path, gated: bool = False) -> list[Path]:
    """Write Verilog, constraints, description and core file into a folder; return their paths.

    Each file is written whole or not at all. With ``gated`` the Verilog has clock gates, whose module is a file of its
    own. Unchanged files of an earlier configuration of the design are removed. Behind a bus, the files of the readout
    are those that it has without the bus, and the wrapper's files stand beside them.
    """
    top = top_block(config).module_name
    files = {
        ".v": wrapper(config, gated) if isinstance(config, BusConfig) else verilog(config, gated),
        ".sdc": constraints(config, gated),
        ".json": description(config, gated) + "\n",
        ".core": core(config, gated),
    }
    if has_testbench(config):
        files["_tb.sv"] = testbench(config, TEST if gated else "")
    texts = {f"{top}{suffix}": text for suffix, text in files.items()}
    readout = config.readout if isinstance(config, ChipConfig) else config
    if isinstance(readout, ReadoutConfig) and readout.registers != "none":
        texts |= _of_registers(readout, header(config, "//", gated))
    if gated and not isinstance(config, BusConfig):
        texts[f"{GATE}.v"] = header(config, "//", gated) + BEHAVIOUR
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    earlier: list[Path] = []
    if isinstance(config, BusConfig):
        paths = write(config.readout, folder, gated)
    else:
        earlier = _unchanged(folder, top, {f"{GATE}.v", *(f"{NAME}.{end}" for end in REGISTERS)} - set(texts))
    for name, text in texts.items():
        paths.append(folder / name)
        with atomic_write(paths[-1]) as file:
            file.write(text.encode())
    for path in earlier:
        path.unlink()
    return paths


def _unchanged(folder: Path, top: str, names: Collection[str]) -> list[Path]:
    """Return the existing files with exactly the text that this program writes for their configuration.

    The list is empty if the folder contains another design, which may use these files.
    """
    paths = [folder / name for name in names if (folder / name).is_file()]
    wrapped = folder / f"{AxiReadout.module_name}.core"
    if not paths or {*folder.glob("*.core")} - {wrapped} != {folder / f"{top}.core"}:
        return []
    try:
        fields = json.loads((folder / f"{top}.json").read_text())["configuration"]
        text = (folder / f"{top}.v").read_text()
        head = HEADER.findall(text)[0]
        written = {f"{GATE}.v": head + BEHAVIOUR}
        if paths != [folder / f"{GATE}.v"]:
            written |= _of_registers(ReadoutConfig.from_dict(fields.get("readout", fields)), head)
        return [path for path in paths if path.read_text() == written[path.name]]
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return []
