"""Generate a self-checking testbench beside the Verilog: samples, and expected events from the golden model."""

from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from amaranth.hdl import Shape
from amaranth.lib import wiring
from numpy.typing import NDArray

from eskin.base.pages import templates
from eskin.model import frame
from eskin.model.bus.axi_lite import ACCESS_CLOCKS
from eskin.model.bus.axi_stream import AxiStream, Event
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.words import packed
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import ANALOG_RANGE, seen
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code
from eskin.model.readout import Stimulus, simulate
from eskin.model.registers.description import registers
from eskin.model.registers.settings import SETTING_DTYPE
from eskin.rtl.bus import axi_lite, axi_stream
from eskin.rtl.frame import RECEIVER, converter
from eskin.rtl.links import registry as links
from eskin.rtl.links.link import ACK_EIGHTHS, READY
from eskin.rtl.registers import spi
from eskin.rtl.text.fold import LONGEST
from eskin.rtl.verilog import Config, clock_and_reset, header, top_block

TEMPLATES = templates(Path(__file__).with_name("templates"))
TICKS, FRAMES = 8, 2
"""Sample ticks, or frames, that are played."""
START = 4
"""Clock of the first sample tick, without registers."""
SIGNAL_BITS_BEYOND = ANALOG_RANGE.bit_length() - 1
"""Bits of an analog signal above those of a sample."""
REST = 64
"""Clocks after the last event."""
IDLE_HIGH = {"rst": "1'b1", "spi_cs_n": "1'b1"}
"""Inputs that are not low at the beginning."""
VECTORS = ("taxel_enable", "above", "below", "compare", "row_select", "column_select")
"""Ports with a bit for each taxel, row or column, also for a single one."""

EXPECT = """\
  reg [31:0] word;
  task static expect_register(input logic [14:0] address, input logic [31:0] value);
    begin
      transfer(1'b0, address, 32'h0);
      if (word !== value) begin
        $display("register 0x%h: expected 0x%h, found 0x%h", address, value, word);
        fail("wrong register");
      end
    end
  endtask
"""
"""Check of a register, behind the host's task ``transfer``, which leaves what it reads in ``word``."""


class Play(NamedTuple):
    """The part of a testbench that depends on the kind of the design."""

    what: str  # name of what is played
    item: str  # name of what is compared
    strobe: str  # input that is high for a clock with every word of ticks
    period: int  # clocks from one word to the next
    start: int  # clock of the first word
    end: int  # clock of the end
    wide: int  # bits of a word
    ticks: list[int]
    shown: dict[str, tuple[int, int]]  # lowest bit and width of every field of an item, by its format
    expected: list[tuple[int, int]]  # clock and value of every item
    parts: list[str]  # Verilog of what stands around the design
    before: list[str]  # statements before and after the words
    after: list[str]


def has_testbench(config: object) -> bool:
    """Return True if a design has a testbench: a single readout, also behind a bus."""
    return type(config) in (ReadoutConfig, FrameConfig, BusConfig)


def testbench(config: Config, tied: str = "") -> str:  # noqa: PT028
    """Return a SystemVerilog testbench that plays samples and compares every event or word with the golden model.

    It compares clock and value. It prints a line with PASS, or the first difference and FAIL, and then ends with
    ``$fatal``: the simulator returns an error. ``tied`` is an input that is low: the test enable of clock gates.
    """
    play = _frames(config) if isinstance(config, FrameConfig) else _events(config)
    top = top_block(config)
    clock, reset = clock_and_reset(config)
    ports = {name: (flow, 1) for name, flow in ((clock, True), (reset, True))}
    for name, member in top.signature.members.items():
        ports[name] = (member.flow is wiring.In, Shape.cast(member.shape).width)
    if tied:
        ports[tied] = (True, 1)
    return TEMPLATES.get_template("testbench.sv").render(
        **play._asdict() | {"fields": play.shown.values(), "shown": play.shown.keys()},
        header=header(config, "//", bool(tied)),
        top=top.module_name,
        ports=[
            {
                "name": name,
                "driven": driven,
                "range": f"[{width - 1}:0] " if width > 1 or name in VECTORS else "",
                "initial": f"{{{width}{{1'b1}}}}" if name == "taxel_enable" else IDLE_HIGH.get(name, f"{width}'h0"),
            }
            for name, (driven, width) in ports.items()
        ],
        clk=clock,
        release=f"{reset} = 1'b{0 if reset in IDLE_HIGH else 1};",
        bits=max(low + width for low, width in play.shown.values()),
        literal=literal,
        count=len(play.expected),
    )


def literal(value: int, bits: int) -> str:
    """Return a number as Verilog of several short lines."""
    most = 4 * (LONGEST - 20)
    parts = []
    for low in range(0, bits, most):
        width = min(most, bits - low)
        parts.append(f"{width}'h{value >> low & (1 << width) - 1:x}")
    return parts[0] if len(parts) == 1 else "{\n      " + ",\n      ".join(reversed(parts)) + "}"


def _walk(full_scale: int, step: int, ticks: int, taxels: int) -> NDArray[np.int32]:
    """Return samples of a random walk of up to three steps in each tick, shape (ticks, taxels)."""
    moves = np.random.default_rng(1).integers(-3 * step, 3 * step + 1, (ticks, taxels))
    return np.clip(moves.cumsum(axis=0), -full_scale, full_scale - 1).astype(np.int32)


def _words(samples: NDArray[Any], bits: int) -> list[int]:
    """Return the samples of every tick as one word, taxel 0 in the least significant bits."""
    return [packed(row.tolist(), bits) for row in samples]


def _events(config: Config) -> Play:
    """Return the testbench of a readout, also behind a bus."""
    bus = config if isinstance(config, BusConfig) else None
    readout = config.readout if isinstance(config, BusConfig) else config
    assert isinstance(readout, ReadoutConfig)
    clock, _ = clock_and_reset(config)
    transfers = _transfers(readout)
    start = START + ACCESS_CLOCKS * len(transfers)
    samples = _walk(readout.full_scale, readout.step, TICKS, readout.taxels)
    last = start + TICKS * readout.clocks_per_sample
    stimulus = Stimulus(
        samples=samples,
        sample_clock=start + np.arange(TICKS) * readout.clocks_per_sample,
        clocks=last + 3 * TICKS * readout.taxels * 2 * readout.protocol.clocks_per_event,
        enable_clock=np.zeros(1, np.int64),
        enable=np.ones((1, readout.taxels), bool),
        ready=np.array([1] if bus else READY, np.uint8),
        ack_delay=np.array([ACK_EIGHTHS]),
        settings=_settings(readout),
    )
    events = simulate(readout, stimulus)
    fields = {"column": readout.column_bits, "row": readout.row_bits, "polarity": int(readout.has_polarity)}
    shown, low = {}, 0
    for name, bits in fields.items():
        if bits:
            shown[f"{name} %0d"] = (low, bits)
        low += bits
    polarity = events["p"].astype(int) * readout.has_polarity
    values = (polarity << readout.row_bits | events["y"]) << readout.column_bits | events["x"]
    expected = list(zip(events["t"].tolist(), values.tolist(), strict=True))
    if bus is not None:
        shown = {f"{name} %0d": place for name, place in bus.fields().items()} | {"last %0d": (bus.data_bits, 1)}
        expected = _stream(bus, events)
    parts = [links.named(readout.link).receiver(readout) if bus is None else axi_stream.SINK]
    signal_bits, signals, after = readout.sample_bits, samples, []
    if readout.frontend == "analog":
        parts.append(_comparators(readout, top_block(readout).signature.members, clock))
        signal_bits, signals = signal_bits + SIGNAL_BITS_BEYOND, seen(readout, samples)
    end = max([last, *(time for time, _ in expected[-1:])]) + REST
    if transfers:
        (counter,) = (register.address for register in registers(readout) if register.name == "events")
        parts += [EXPECT, spi.HOST if bus is None else axi_lite.HOST]
        after = [
            f"while (clock < {end}) @(negedge {clock});",
            f"expect_register(15'h{counter:x}, 32'd{len(expected)});",
        ]
        end += ACCESS_CLOCKS + REST
    return Play(
        what="sample ticks",
        item="event" if bus is None else "transfer",
        strobe="sample_valid",
        period=readout.clocks_per_sample,
        start=start,
        end=end,
        wide=readout.taxels * signal_bits,
        ticks=_words(signals, signal_bits),
        shown=shown or {"no bits %0d": (0, 1)},
        expected=expected,
        parts=parts,
        before=transfers,
        after=after,
    )


def _transfers(config: ReadoutConfig) -> list[str]:
    """Return the register accesses before the first sample tick: a constant, and a resolution of one bit less."""
    if config.registers == "none":
        return []
    named = {register.name: register for register in registers(config)}
    identity, resolution = named["id"], named["resolution"]
    return [
        f"expect_register(15'h{identity.address:x}, 32'h{identity.reset:x});",
        f"transfer(1'b1, 15'h{resolution.address:x}, 32'd{_resolution(config)});",
        f"expect_register(15'h{resolution.address:x}, 32'd{_resolution(config)});",
    ]


def _resolution(config: ReadoutConfig) -> int:
    """Return the resolution that the host sets."""
    return max(1, config.resolution - 1)


def _settings(config: ReadoutConfig) -> NDArray[np.void]:
    """Return the settings behind the accesses of the host, which end before the first sample tick."""
    found = np.zeros(int(config.registers != "none"), SETTING_DTYPE)
    found["coarser"] = config.resolution - _resolution(config)
    for name in ("leak_shift", "leak_period", "window_period"):
        found[name] = getattr(config, name)
    return found


def _stream(config: BusConfig, events: NDArray[np.void]) -> list[tuple[int, int]]:
    """Return clock and {TLAST, TDATA} of every transfer to a sink that is always ready."""
    stream, found = AxiStream(config), []
    polarity = events["p"] * config.readout.has_polarity
    columns = (events["x"].tolist(), events["y"].tolist(), polarity.tolist())
    taken = {t: Event(*event) for t, *event in zip(events["t"].tolist(), *columns, strict=True)}
    for clock in range(max(taken, default=0) + REST):
        if stream.offered is not None:
            found.append((clock, stream.offered.last << config.data_bits | stream.offered.data))
        stream.clock(taken.get(clock), True)
    return found


def _comparators(config: ReadoutConfig, names: Collection[str], clock: str) -> str:
    """Return comparators that decide in the middle of a clock in which they must, and answer wrongly in all others."""
    half_width = str(config.step)
    if "step_code" in names:
        half_width = "step_code"
    elif "half_width" in names:
        half_width = f"half_width[taxel*{config.half_width_bits}+:{config.half_width_bits}]"
    word, signal = config.sample_bits, config.sample_bits + SIGNAL_BITS_BEYOND
    below = "      below[taxel] = !compare[taxel] || level < code - width;\n" if "below" in names else ""
    return f"""\
  // The comparators decide in the middle of a clock with compare. In other clocks they are wrong.
  reg [{config.taxels * signal - 1}:0] held = 0;
  integer taxel, level, code, width;
  always @(posedge {clock}) if (sample_valid) held <= sample;
  /* verilator lint_off WIDTHEXPAND */  // numbers are extended as Verilog defines it
  always @(negedge {clock})
    for (taxel = 0; taxel < {config.taxels}; taxel = taxel + 1) begin
      level = $signed(held[taxel*{signal}+:{signal}]);
      code = $signed(reference_code[taxel*{word}+:{word}]);
      width = {half_width};
      above[taxel] = !compare[taxel] || level >= code + width{" + 1" if config.encoder.strict else ""};
{below}    end
  /* verilator lint_on WIDTHEXPAND */
"""


def _frames(config: FrameConfig) -> Play:
    """Return the testbench of a frame readout."""
    draw = np.random.default_rng(1)
    full_scale = config.readout.full_scale
    samples = draw.integers(-full_scale, full_scale, (FRAMES, config.taxels), dtype=np.int32)
    period = config.clocks_per_frame + len(READY) * config.words_per_frame
    starts = START + period * np.arange(FRAMES, dtype=np.int64)
    last = START + period * FRAMES
    stimulus = frame.FrameStimulus(
        samples=np.concatenate([samples[:1], samples]),
        sample_clock=np.array([0, *starts]),
        frame_clock=starts,
        clocks=last,
        conversion=np.array([config.adc_clocks]),
        ready=np.array(READY, np.uint8),
    )
    words = frame.simulate(config, stimulus).words
    return Play(
        what="frames",
        item="word",
        strobe="frame_start",
        period=period,
        start=START,
        end=last + REST,
        wide=config.taxels * config.resolution,
        ticks=_words(adc_code(config, samples), config.resolution),
        shown={"word 0x%h": (0, config.word_bits), "first %0d": (config.word_bits, 1)},
        expected=[(int(t), int(sync) << config.word_bits | int(data)) for t, sync, data in words.tolist()],
        parts=[converter(config), RECEIVER],
        before=[],
        after=[],
    )
