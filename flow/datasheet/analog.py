"""Datasheet section on the inputs: samples, comparators and DACs, with drivers, timing and number formats."""

from __future__ import annotations

from eskin.flow.datasheet.sheet import markdown, si
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, SETTABLE, fields_of
from eskin.rtl.delivery import DAC_OUT, DECISION_IN, ports


def of_signals(config: ReadoutConfig) -> list[str]:
    """Return the datasheet section on samples, or on comparators and DACs."""
    codes = markdown(("number", "codes", "of full scale"), _codes(config))
    what = _samples(config) if config.frontend == "digital" else _macros(config)
    return [*what, *_fields(config), "", *codes]


def _fields(config: ReadoutConfig) -> list[str]:
    """Return the paragraph on receptive fields; empty if every taxel uses only its own sample."""
    if config.fields == "own":
        return []
    digital = config.frontend == "digital"
    where = (
        "`eskin_fields` adds them in front of the taxels, without a register."
        if digital
        else ("The array makes them: the comparators of a taxel see the signal of its field.")
    )
    if config.fields == SETTABLE:
        how = (
            "`eskin_fields` adds samples in front of the taxels."
            if digital
            else "`field_select` selects it, from flops."
        )
        return ["", f"Receptive fields: a host chooses for every taxel among {', '.join(CHOICES)}. {how}"]
    rows = [
        (f"{taxel}", ", ".join(map(str, field.taxels)) or "off", f"{field.shift}")
        for taxel, field in enumerate(fields_of(config))
    ]
    return [
        "",
        f"Receptive fields: an encoder sees the sum of the samples of some taxels, divided by 2^shift. {where}",
        "",
        *markdown(("taxel", "its field", "shift"), rows),
    ]


def _samples(config: ReadoutConfig) -> list[str]:
    return [
        f"A converter drives `sample`, {config.sample_bits} bits for each of {config.taxels} taxels, and "
        f"`sample_valid`, one clock in {config.clocks_per_sample}. All samples are taken with the edge that ends it; "
        "what they are in the others does not matter.",
    ]


def _macros(config: ReadoutConfig) -> list[str]:
    """Return the drivers of the analog front end pins, and their timing within a clock."""
    period_s = 1 / config.clock_hz
    meanings = {port["name"]: port["meaning"] for port in ports(config)}
    out = [name for name in ("reference_code", "half_width") if name in meanings]
    decided = [name for name in ("above", "below") if name in meanings]
    leave, settle, early = 1 - DAC_OUT, DAC_OUT + DECISION_IN - 1, 1 - DECISION_IN
    table = [
        (f"{_named(out)} at the pin", "the readout, from flops", f"0 to {leave:.1f} T", leave),
        ("DAC and comparator settle", "the macros", f"{leave:.1f} T to {DECISION_IN:.1f} T", settle),
        (f"{_named(decided)} settled", "the macros", f"{DECISION_IN:.1f} T to T, the next rising edge", early),
    ]
    lines = [
        "Every taxel has its comparators and DAC, clocked macros outside. From one rising edge to the next, T is "
        f"{si(period_s, 's')}:",
        "",
        *markdown(
            ("what", "who", "when", "time for it"),
            ((what, who, when, si(share * period_s, "s")) for what, who, when, share in table),
        ),
        "",
        "These shares stand in `eskin_readout.sdc`. References move at the edge that raises a request and hold still "
        "while it waits. The decision of the clock behind that edge sees them moved. "
        + " ".join(f"`{name}`: {meanings[name]}." for name in decided),
    ]
    if "sample_valid" in meanings:
        base = f"`sample_valid` is the time base, one clock in {config.clocks_per_sample}; "
        lines += ["", base + "the decisions of the clock after it are those of the tick."]
    if "step_code" in meanings:
        lines += ["", "`step_code` changes with a setting only; it moves the comparators' offset."]
    return lines


def _codes(config: ReadoutConfig) -> list[tuple[str, str, str]]:
    """Return the range of every number on a pin or in a reference."""

    def row(what: str, low: int, high: int, step: int = 1) -> tuple[str, str, str]:
        by = f", in steps of {step}" if step > 1 else ""
        span = f"{low} to {high}{by}" if low != high else f"{low}"
        shares = [f"{value / config.full_scale:.6g}" for value in (low, high)]
        return what, span, " to ".join(shares) if low != high else shares[0]

    rows = [
        row(
            "sample" if config.frontend == "digital" else "signal, on the scale",
            -config.full_scale,
            config.full_scale - 1,
        ),
        row("reference", config.encoder.lowest(config), config.full_scale - config.grid, config.grid),
        row("step D", config.step, config.step),
    ]
    built = "" if config.registers == "none" else ", after reset"
    if config.closes:
        rows.append(row(f"half width{built}", config.closing_step, config.step, config.closing_step))
    else:
        rows.append(row(f"half width{built}", config.step, config.step))
    if config.registers != "none":
        rows.append(row("step D, powers of two that a host may set", config.step, config.full_scale // 4))
    return rows


def _named(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
