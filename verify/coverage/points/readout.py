"""Coverage points of the spiking readout, for every encoder, front end and link."""

from collections.abc import Iterator
from functools import partial

from eskin.model.config import ReadoutConfig
from eskin.verify.coverage.points.point import Named, Point, any_of, began, points_of, table


def readout(config: ReadoutConfig) -> Iterator[Point]:
    """Return the coverage points of a readout."""
    group = f"{config.encoding} {config.frontend} {config.link}"
    if config.decide_every == "sample":
        group += " by the sample"
    parts = (_holds, _arbiter, _taxel, _masks, _link, _ends, _window, _leak)
    return points_of(group, "eskin_readout", *(part(config) for part in parts))


def some(config: ReadoutConfig, expression: str) -> str:
    """Return an expression that is true if a given expression is true for any taxel ``T`` in ``ROW`` and ``COLUMN``."""
    places = [(str(row), str(column)) for row in range(config.rows) for column in range(config.columns)]
    return any_of(
        expression.replace("T.", f"row_{row}.taxel_{column}.").replace("ROW", row).replace("COLUMN", column)
        for row, column in places
    )


def _kinds(config: ReadoutConfig) -> dict[str, str]:
    """Return the kinds of events, each with an expression that detects it."""
    return {"ON": "T.polarity", "OFF": "!T.polarity"} if config.has_polarity else {"event": "1'b1"}


def _holds(config: ReadoutConfig) -> Named:
    """Yield the points of each encoder: every kind of event with every reason for waiting."""
    served = "arbiter.event_valid && arbiter.event_ready"
    causes = {
        "the sink": "arbiter.event_valid && !arbiter.event_ready",
        "the burst of its own row": f"{served} && arbiter.event_row == ROW && !arbiter.granted[ROW]",
        "the burst of another row": f"{served} && arbiter.event_row != ROW && !arbiter.takes",
        "another row that is granted": "arbiter.takes && !arbiter.granted[ROW]",
    }
    if config.protocol.asynchronous:
        req = _requested(config)
        causes |= {
            "an address that settles": "link.setup",
            "ACK that is to rise": f"{req} && !aer_ack",
            "ACK that passes the flops": f"{req} && aer_ack && !link.ack_sync",
            "ACK that is to fall": f"!{req} && aer_ack",
        }
    for kind, own in _kinds(config).items():
        for cause, expression in causes.items():
            yield f"{kind} held by {cause}", some(config, f"T.request && {own} && {expression}")


def _arbiter(config: ReadoutConfig) -> Named:
    rows, columns = range(config.rows), range(1, config.columns + 1)
    for row in rows:
        for size in columns:
            taken = f"arbiter.granted[{row}] && $countones(arbiter.column_request) == {size}"
            yield f"burst of {size} in row {row}", taken
        for before in rows:
            way = "wraps" if row < before else "stays" if row == before else "moves on"
            follows = f"arbiter.granted[{row}] && arbiter.event_row == {before} && arbiter.event_valid"
            yield f"row {row} behind row {before}: the pointer {way}", follows
    taxels = [f"row_{row}.taxel_{column}" for row in rows for column in range(config.columns)]
    yield "all taxels request", " && ".join(f"{taxel}.request" for taxel in taxels)
    yield from table("arbiter")


def _taxel(config: ReadoutConfig) -> Named:
    kinds = _kinds(config)
    for old, was in kinds.items():
        for new, is_now in kinds.items():
            raised = f"$past(T.pending && T.granted && T.asks && {was}) && T.pending && {is_now}"
            yield f"{new} raised in the clock in which {old} is taken", some(config, raised)
    if config.frontend == "analog" and config.has_polarity:
        yield "both comparators fire", "|(above & below)"
    if config.frontend == "digital" or config.needs_tick:
        yield "samples in two clocks running", "sample_valid && $past(sample_valid)"
        yield "sample in the first clock behind a reset", "sample_valid && !rst && $past(rst)"
        yield "sample while a request waits", f"sample_valid && {some(config, 'T.pending && !T.granted')}"
        taken = some(config, "T.request && T.granted")
        yield "sample in the clock in which a request is taken", f"sample_valid && {taken}"


def _masks(config: ReadoutConfig) -> Named:
    crossed = "(T.above || T.below)" if config.has_polarity else "T.above"
    yield from table("taxel", partial(some, config), crossed=crossed)
    if config.protocol.streams:
        yield "reset while the sink stalls", began("event_valid && !event_ready")


def _requested(config: ReadoutConfig) -> str:
    return f"({' || '.join(f'link.{name}' for name in config.protocol.requests)})"


def _link(config: ReadoutConfig) -> Named:
    if not config.protocol.asynchronous:
        return
    news = some(config, "T.pending && !$past(T.pending)")
    for edge, now, before in (("rises", "aer_ack", "!aer_ack"), ("falls", "!aer_ack", "aer_ack")):
        yield f"ACK {edge} in the clock of a new request", f"{now} && $past({before}) && {news}"
    yield from table("link", req=_requested(config))


def _ends(config: ReadoutConfig) -> Named:
    bits = config.sample_bits
    if config.frontend == "digital":
        codes = [f"sample[{index * bits} +: {bits}]" for index in range(config.taxels)]
        top, bottom = f"{bits}'d{config.full_scale - 1}", f"{bits}'d{config.full_scale}"
        yield "highest code", f"sample_valid && {any_of(f'{code} == {top}' for code in codes)}"
        yield "lowest code", f"sample_valid && {any_of(f'{code} == {bottom}' for code in codes)}"
    not_made = "a step {} that would leave the scale is not made"
    if config.encoder.leaks:
        low = (config.step - 1).bit_length() + config.fraction_bits
        high = bits - 2 + config.fraction_bits
        sign = f"T.charge[{high + 1}] && " if config.has_polarity else ""
        full, empty = f"{'!' * bool(sign)}{sign}&T.charge[{high}:{low}]", f"{sign}~|T.charge[{high}:{low}]"
        yield "charge 0 behind a charge", some(config, "T.charge == 0 && $past(T.charge) != 0 && !rst")
        if config.frontend == "analog":
            yield not_made.format("up"), some(config, f"T.above && T.enable && {full}")
        if config.frontend == "analog" and config.has_polarity:
            yield not_made.format("down"), some(config, f"T.below && !T.above && T.enable && {empty}")
        return
    width = bits - (config.grid - 1).bit_length()
    name = "reference_code" if config.frontend == "analog" and config.grid == 1 else "reference"
    top, bottom = f"{width}'h{(1 << width - 1) - 1:x}", f"{width}'h{1 << width - 1:x}"
    lowest = bottom if config.frontend == "analog" else f"{width}'h{(1 << width - 1) + 1:x}"
    yield "reference at the top level", some(config, f"T.{name} == {top}")
    yield "reference at the lowest level that is asked for", some(config, f"T.{name} == {lowest}")
    if config.frontend == "analog":
        for way, side, level in (("up", "above", top), ("down", "below", bottom)):
            yield not_made.format(way), some(config, f"T.{side} && T.enable && !T.fits && T.{name} == {level}")


def _window(config: ReadoutConfig) -> Named:
    if not config.closes:
        return
    for width in range(1, (1 << config.closing_levels_log2) + 1):
        yield f"window {width} steps wide", some(config, f"T.window.half_width == {width}")
        event = f"T.asks && T.moves && T.window.half_width == {width}"
        yield f"event in a window {width} steps wide", some(config, event)
    yield from table("window", partial(some, config))


def _leak(config: ReadoutConfig) -> Named:
    if not config.encoder.leaks:
        return
    for row in range(config.rows):
        yield f"leak in row {row}", f"row_{row}.decay"
    yield from table("leak", partial(some, config), bit=config.leak_shift - 1)
