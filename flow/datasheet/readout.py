"""Datasheet of the spiking readout."""

from typing import Any

from eskin.flow.datasheet.sheet import Picture, Sheet
from eskin.flow.datasheet.waves import ACK_DELAY, RESET_CLOCKS, STALL, TAXELS, TICK, latencies, reset_waves, waves
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, SETTABLE, fields_of
from eskin.model.links.link import ACK_QUANTA
from eskin.model.registers.description import NAME as REGISTERS
from eskin.rtl.delivery import DAC_OUT, DECISION_IN, ports


def sheet_of(config: ReadoutConfig, report: dict[str, Any] | None) -> Sheet:
    """Return the datasheet of a readout, optionally with netlist results."""
    event = Picture("event", "From a sample to its events", waves(config))
    reset = Picture("reset", "A reset while an event is on its way", reset_waves(config))
    names = [port["name"] for port in ports(config)]
    own = config.receptive_fields in ("own", SETTABLE)
    values = {
        "latencies": latencies(config),
        "requests": [*config.protocol.requests],
        "event": ", ".join(name for name in names if name.startswith("event_") and name != "event_ready"),
        "tick": TICK,
        "shown_taxels": TAXELS,
        "stall": STALL,
        "ack_delay": ACK_DELAY / ACK_QUANTA,
        "reset_clocks": RESET_CLOCKS,
        "registers": REGISTERS,
        "report": report,
        "dac_out": DAC_OUT,
        "decision_in": DECISION_IN,
        "codes": _codes(config),
        "choices": CHOICES,
        "receptive": [
            (f"{taxel}", ", ".join(map(str, field.taxels)) or "off", f"{field.shift}")
            for taxel, field in enumerate([] if own else fields_of(config))
        ],
    }
    what = f"{config.rows} x {config.columns} taxels, {config.encoding}, {config.resolution} b"
    what += f", {config.frontend} front end, link {config.link}"
    return Sheet(config, what, "readout.md", values, (event, reset))


def _codes(config: ReadoutConfig) -> list[tuple[str, str, str]]:
    """Return the range of every number on a pin or in a reference."""

    def row(what: str, low: int, high: int, step: int = 1) -> tuple[str, str, str]:
        by = f", in steps of {step}" if step > 1 else ""
        span = f"{low} to {high}{by}" if low != high else f"{low}"
        shares = [f"{value / config.full_scale:.6g}" for value in (low, high)]
        return what, span, " to ".join(shares) if low != high else shares[0]

    sample = "sample" if config.frontend == "digital" else "signal, on the scale"
    built = "" if config.registers == "none" else ", after reset"
    closing = config.closing_step if config.closes else config.step
    rows = [
        row(sample, -config.full_scale, config.full_scale - 1),
        row("reference", config.encoder.lowest(config), config.full_scale - config.grid, config.grid),
        row("step D", config.step, config.step),
        row(f"half width{built}", closing, config.step, closing),
    ]
    if config.registers != "none":
        rows.append(row("step D, powers of two that a host may set", config.step, config.full_scale // 4))
    return rows
