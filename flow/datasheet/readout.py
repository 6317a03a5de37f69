"""Datasheet of the spiking readout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from eskin.flow.datasheet.analog import of_signals
from eskin.flow.datasheet.asic_results import of_netlist
from eskin.flow.datasheet.latencies import Latencies
from eskin.flow.datasheet.sheet import RESETS, Picture, Sheet, shown, si, time_table
from eskin.flow.datasheet.waves import ACK_DELAY, RESET_CLOCKS, STALL, TAXELS, TICK, reset_waves, waves
from eskin.model.config import ReadoutConfig
from eskin.model.link import ACK_QUANTA
from eskin.model.registers.description import NAME as REGISTERS
from eskin.rtl.delivery import ports
from eskin.rtl.link import requests

TOP = "eskin_readout"


def sheet_of(config: ReadoutConfig, report: dict[str, Any] | None) -> Sheet:
    """Return the datasheet of a readout, optionally with netlist results."""
    latencies = Latencies.of(config)
    event = Picture("event", "From a sample to its events", waves(config))
    reset = Picture("reset", "A reset while an event is on its way", reset_waves(config))
    sections: dict[str, Iterable[str]] = {
        "Blocks": ["```text", *_blocks(config), "```"],
        "Clock": _clock(config),
        "Reset": _reset(config),
        "Latency, throughput and the longest wait": _times(config, latencies),
        "Timing": _timing(config, event, reset),
        "Signals in": of_signals(config),
        "Registers": _registers(config),
        "Area, power and highest clock": of_netlist(report),
    }
    what = f"{config.rows} x {config.columns} taxels, {config.encoding}, {config.resolution} b"
    what += f", {config.frontend} front end, link {config.link}"
    return Sheet(config, what, sections, (event, reset))


def _blocks(config: ReadoutConfig) -> Iterator[str]:
    """Yield the lines of the block diagram as text."""
    names = _names(config)
    inward = [port for port in ("sample", "above", "below", "sample_valid") if port in names]
    outward = ", ".join(port for port in ("reference_code", "half_width") if port in names)
    edge, up = ("|", f"          ^ {outward}") if outward else ("-", "")
    yield f"  {', '.join(inward)}, taxel_enable"
    if config.fields != "own" and config.frontend == "digital":
        yield "          |"
        yield "  +-------v---------------------+"
        yield "  | adders of receptive fields  |"
        yield "  +-------+---------------------+"
    yield f"          |{up}"
    yield f"  +-------v----------{edge}----------------------+ request +---------+"
    yield f"  | {f'{config.rows} rows of {config.columns} taxels':<40}|-------->| arbiter |---+"
    yield f"  | {_taxel(config):<40}|<--------|         |   |"
    yield f"  +{'-' * 41}+  grant  +---------+   |"
    if config.handshake:
        pad = " " * 35
        outs = ", ".join(name for name in ("aer_addr", *requests(config)) if name in names)
        yield f"{pad}+---------------------+          |"
        yield f"{outs:>27} <-----| link, four-phase    |<----------+"
        yield f"{'aer_ack':>27} ----->| two flops take ACK  |"
        yield f"{pad}+---------------------+"
    else:
        event = ", ".join(name for name in names if name.startswith("event_") and name != "event_ready")
        yield f"  {event} <{'-' * (64 - len(event))}+"
        yield "  event_ready -----> arbiter and taxels, in the same clock"
    if config.registers != "none":
        yield "  spi_* <----------> registers: settings of taxels, counters of events"


def _names(config: ReadoutConfig) -> list[str]:
    """Return the names of the ports."""
    return [port["name"] for port in ports(config)]


def _taxel(config: ReadoutConfig) -> str:
    """Return the parts of a taxel as one line of text, for the block diagram."""
    parts = ["sample", "comparator"] if config.frontend == "digital" else []
    parts += ["reference", *(["window"] if config.closes else []), "request"]
    return ", ".join(parts)


def _clock(config: ReadoutConfig) -> list[str]:
    """Return the section on the clock."""
    period, tick = si(1 / config.clock_hz, "s"), si(1 / config.sample_rate_hz, "s")
    lines = [
        f"One clock, rising edge: {si(config.clock_hz, 'Hz')}, a period T of {period}. "
        f"A sample tick comes every {config.clocks_per_sample} clocks, {tick}.",
    ]
    if "sample_valid" in _names(config):
        lines[0] += " It is the time base: `sample_valid` high for one clock. No counter in here makes it."
    else:
        lines[0] += " No port needs it: a taxel decides in every clock, and there is no time in its encoder."
    woken = ""
    if config.handshake:
        woken = "`eskin_link` listens to `aer_ack` in every clock and stays out of it. "
    if config.registers != "none":
        woken += "What listens to SPI stays out of it too. "
    return [
        *lines,
        "",
        "The internal wire `awake` of the top is low in a clock at whose end no register changes: a gate on it may "
        f"stop the array. Rows and arbiter have one each. {woken}"
        "It is a function of the state and the inputs of the same clock, so no event comes later.",
    ]


def _reset(config: ReadoutConfig) -> list[str]:
    """Return the section on the reset."""
    lines = [
        f"{RESETS[config.reset]} Every flop has it, none relies on an initial value. "
        f"After it every reference is {config.reference_reset} codes, no request waits, and row 0 comes first.",
    ]
    if config.handshake:
        lines[0] += (
            " Requests fall with it; ACK counts as high until it has been seen low. "
            "Let a reset last until a handshake that it breaks off has ended."
        )
    return lines


def _times(config: ReadoutConfig, latencies: Latencies) -> list[str]:
    """Return the table of latencies."""
    end = "`event_valid`" if config.link == "stream" else "the edge that raises `aer_req`"
    taken = "the sink always ready" if config.link == "stream" else "ACK following REQ within a clock"

    rows = [
        *([(f"sample tick to {end}, array idle", latencies.latency)] if "sample_valid" in _names(config) else []),
        (f"decision of a taxel to {end}", latencies.latency - 1),
        (f"from one event to the next, {taken}", latencies.clocks_per_event),
        (f"longest wait of a request for its event, bound, {taken}", latencies.bound_clocks),
        ("longest time between two events of one taxel while all ask, simulated", latencies.longest_gap),
    ]
    rate = si(config.clock_hz / latencies.clocks_per_event, "events/s")
    return [
        f"Throughput: {rate}, {taken}. The simulation is that of the golden model, to which the RTL is bit-exact.",
        "",
        *time_table(rows, config.clock_hz),
        "",
        f"Whatever the sink does, the event of a request is among the next {latencies.bound_events} that leave.",
    ]


def _timing(config: ReadoutConfig, event: Picture, reset: Picture) -> list[str]:
    """Return the timing diagrams with their captions."""
    first = f"The sample tick is at clock {TICK}; " if "sample_valid" in _names(config) else ""
    first += f"{min(TAXELS, config.taxels)} of the taxels cross a level in clock {TICK + 1}, from a reference of 0. "
    if config.link == "stream":
        first += f"The sink takes nothing in the clocks {STALL[0]} and {STALL[-1]}: the event stands still."
    else:
        first += f"ACK follows every edge of REQ in {ACK_DELAY / ACK_QUANTA:g} clock."
    return [
        shown(TOP, event),
        "",
        first,
        "",
        shown(TOP, reset),
        "",
        f"A reset of {RESET_CLOCKS} clocks takes the event that is on its way; behind it the same inputs come again.",
    ]


def _registers(config: ReadoutConfig) -> Iterable[str]:
    """Return a reference to the register description."""
    if config.registers == "none":
        return ["None: the configuration is built in. `registers=spi` puts them beside the array."]
    return [f"Over SPI: [{REGISTERS}.md]({REGISTERS}.md), with the times of SPI; [{REGISTERS}.h]({REGISTERS}.h) for C."]
