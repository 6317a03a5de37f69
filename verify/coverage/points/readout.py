"""Coverage points of the spiking readout, for every encoder, front end and link."""

from __future__ import annotations

from collections.abc import Iterator

from eskin.model.config import ReadoutConfig
from eskin.rtl.link import requests
from eskin.verify.coverage.points.point import Named, Point, any_of, began


def readout(config: ReadoutConfig) -> Iterator[Point]:
    """Yield the coverage points of a readout."""
    group = f"{config.encoding} {config.frontend} {config.link}"
    if config.decide_every == "sample":
        group += " by the sample"
    for part in (_holds, _arbiter, _taxel, _masks, _resets, _link, _ends, _window, _leak):
        for name, expression in part(config):
            yield Point(group, name, "eskin_readout", expression)


def _taxels(config: ReadoutConfig) -> list[tuple[int, int, str]]:
    """Return row, column and instance of every taxel."""
    places = [(row, column) for row in range(config.rows) for column in range(config.columns)]
    return [(row, column, f"row_{row}.taxel_{column}") for row, column in places]


def _kinds(config: ReadoutConfig) -> dict[str, str]:
    """Return the kinds of events, each with an expression that detects it."""
    return {"ON": "{}.polarity", "OFF": "!{}.polarity"} if config.has_polarity else {"event": "1'b1"}


def _holds(config: ReadoutConfig) -> Named:
    """Yield the points of each encoder: every kind of event with every reason for waiting."""
    served = "arbiter.event_valid && arbiter.event_ready"
    causes = {
        "the sink": "arbiter.event_valid && !arbiter.event_ready",
        "the burst of its own row": f"{served} && arbiter.event_row == {{row}} && !arbiter.granted[{{row}}]",
        "the burst of another row": f"{served} && arbiter.event_row != {{row}} && !arbiter.takes",
        "another row that is granted": "arbiter.takes && !arbiter.granted[{row}]",
    }
    if config.handshake:
        req = _requested(config)
        causes |= {
            "an address that settles": "link.setup",
            "ACK that is to rise": f"{req} && !aer_ack",
            "ACK that passes the flops": f"{req} && aer_ack && !link.ack_sync",
            "ACK that is to fall": f"!{req} && aer_ack",
        }
    for kind, own in _kinds(config).items():
        for cause, expression in causes.items():
            terms = [
                f"{taxel}.request && {own.format(taxel)} && {expression.format(row=row)}"
                for row, _, taxel in _taxels(config)
            ]
            yield f"{kind} held by {cause}", any_of(terms)


def _arbiter(config: ReadoutConfig) -> Named:
    """Yield the points of the arbiter: burst sizes, orders of rows, and the burst latch."""
    rows, columns = range(config.rows), range(1, config.columns + 1)
    for row in rows:
        for size in columns:
            taken = f"arbiter.granted[{row}] && $countones(arbiter.column_request) == {size}"
            yield f"burst of {size} in row {row}", taken
        for before in rows:
            way = "wraps" if row < before else "stays" if row == before else "moves on"
            yield (
                f"row {row} behind row {before}: the pointer {way}",
                (f"arbiter.granted[{row}] && arbiter.event_row == {before} && arbiter.event_valid"),
            )
    leaves = "arbiter.event_valid && arbiter.event_ready"
    yield "latch filled while empty", "arbiter.takes && !arbiter.event_valid"
    yield "latch filled as its last event leaves", f"arbiter.takes && {leaves}"
    yield "latch runs empty", f"{leaves} && arbiter.load && !arbiter.takes"
    yield "all rows request", "&arbiter.row_request"
    yield "all taxels request", " && ".join(f"{taxel}.request" for *_, taxel in _taxels(config))
    yield "nothing requests while a burst is drained", f"{leaves} && !(|arbiter.row_request)"


def _taxel(config: ReadoutConfig) -> Named:
    """Yield the points of new requests in the clock in which the old request is granted."""
    kinds = _kinds(config)
    for old, was in kinds.items():
        for new, is_now in kinds.items():
            terms = [
                f"$past({t}.pending && {t}.granted && {t}.asks && {was.format(t)}) && {t}.pending && {is_now.format(t)}"
                for *_, t in _taxels(config)
            ]
            yield f"{new} raised in the clock in which {old} is taken", any_of(terms)
    if config.frontend == "analog" and config.has_polarity:
        yield "both comparators fire", "|(above & below)"
    if config.frontend == "digital" or config.needs_tick:
        yield "samples in two clocks running", "sample_valid && $past(sample_valid)"
        yield "sample in the first clock behind a reset", "sample_valid && !rst && $past(rst)"
        waits = any_of(f"{taxel}.pending && !{taxel}.granted" for *_, taxel in _taxels(config))
        yield "sample while a request waits", f"sample_valid && {waits}"
        taken = any_of(f"{taxel}.request && {taxel}.granted" for *_, taxel in _taxels(config))
        yield "sample in the clock in which a request is taken", f"sample_valid && {taken}"


def _masks(config: ReadoutConfig) -> Named:
    taxels = _taxels(config)
    yield "disabled while its request waits", any_of(f"{t}.pending && !{t}.enable && !{t}.granted" for *_, t in taxels)
    yield (
        "disabled in the clock in which its row is granted",
        any_of(f"{t}.pending && !{t}.enable && {t}.granted" for *_, t in taxels),
    )
    yield (
        "disabled while its event is latched",
        any_of(f"arbiter.waiting[{column}] && arbiter.event_row == {row} && !{t}.enable" for row, column, t in taxels),
    )
    yield "disabled at rest", any_of(f"{t}.enabled && !{t}.pending && !{t}.enable" for *_, t in taxels)
    yield (
        "disabled for a single clock",
        any_of(f"{t}.enable && !$past({t}.enable) && $past({t}.enable, 2)" for *_, t in taxels),
    )
    crossed = "({0}.above || {0}.below)" if config.has_polarity else "{0}.above"
    yield (
        "disabled in the clock in which it would ask",
        any_of(
            f"!{t}.enable && $past({t}.enable && !{t}.pending && !{t}.asks) && {crossed.format(t)}" for *_, t in taxels
        ),
    )
    yield "all taxels disabled", "!rst && taxel_enable == 0"
    yield "one taxel alone enabled", "!rst && $onehot(taxel_enable)"


def _resets(config: ReadoutConfig) -> Named:
    yield "reset while bursting", began("$countones(arbiter.waiting) > 1")
    yield "reset while a request waits", began(any_of(f"{t}.pending" for *_, t in _taxels(config)))
    yield "reset at rest", began("!arbiter.awake && !arbiter.event_valid")
    if config.link == "stream":
        yield "reset while the sink stalls", began("event_valid && !event_ready")


def _requested(config: ReadoutConfig) -> str:
    return f"({' || '.join(f'link.{name}' for name in requests(config))})"


def _link(config: ReadoutConfig) -> Named:
    """Yield the points of the four-phase link: conditions that coincide with an ACK edge."""
    if not config.handshake:
        return
    news = any_of(f"{t}.pending && !$past({t}.pending)" for *_, t in _taxels(config))
    for edge, now, before in (("rises", "aer_ack", "!aer_ack"), ("falls", "!aer_ack", "aer_ack")):
        yield f"ACK {edge} in the clock of a new request", f"{now} && $past({before}) && {news}"
    fallen = "!link.ack_sync && $past(link.ack_sync) && !rst && !$past(rst)"
    yield "ACK has fallen while the next event waits", f"{fallen} && link.event_valid"
    yield "ACK has fallen and no event waits", f"{fallen} && !link.event_valid"
    yield "event offered to a link at rest", "link.event_valid && link.event_ready && !$past(link.event_valid)"
    for name, state in (
        ("an address settles", "link.setup"),
        ("REQ is high", f"{_requested(config)} && !link.ack_sync"),
        ("ACK is high", "aer_ack"),
    ):
        yield f"reset while {name}", began(state)


def _ends(config: ReadoutConfig) -> Named:
    """Yield the points of samples and references at both ends of the scale."""
    taxels, bits = [t for *_, t in _taxels(config)], config.sample_bits
    if config.frontend == "digital":
        codes = [f"sample[{index * bits} +: {bits}]" for index in range(config.taxels)]
        top, bottom = f"{bits}'d{config.full_scale - 1}", f"{bits}'d{config.full_scale}"
        yield "highest code", f"sample_valid && {any_of(f'{code} == {top}' for code in codes)}"
        yield "lowest code", f"sample_valid && {any_of(f'{code} == {bottom}' for code in codes)}"
    if config.encoder.leaks:
        low = (config.step - 1).bit_length() + config.fraction_bits
        high = bits - 2 + config.fraction_bits
        sign = f"{{0}}.charge[{high + 1}] && " if config.has_polarity else ""
        full, empty = f"{sign.replace('{0}', '!{0}')}&{{0}}.charge[{high}:{low}]", f"{sign}~|{{0}}.charge[{high}:{low}]"
        yield "charge 0 behind a charge", any_of(f"{t}.charge == 0 && $past({t}.charge) != 0 && !rst" for t in taxels)
        if config.frontend == "analog":
            yield (
                "a step up that would leave the scale is not made",
                any_of(f"{t}.above && {t}.enable && {full.format(t)}" for t in taxels),
            )
        if config.frontend == "analog" and config.has_polarity:
            yield (
                "a step down that would leave the scale is not made",
                any_of(f"{t}.below && !{t}.above && {t}.enable && {empty.format(t)}" for t in taxels),
            )
        return
    width = bits - (config.grid - 1).bit_length()
    name = "reference_code" if config.frontend == "analog" and config.grid == 1 else "reference"
    top, bottom = f"{width}'h{(1 << width - 1) - 1:x}", f"{width}'h{1 << width - 1:x}"
    lowest = bottom if config.frontend == "analog" else f"{width}'h{(1 << width - 1) + 1:x}"
    yield "reference at the top level", any_of(f"{t}.{name} == {top}" for t in taxels)
    yield "reference at the lowest level that is asked for", any_of(f"{t}.{name} == {lowest}" for t in taxels)
    if config.frontend == "analog":
        for side, level in (("above", top), ("below", bottom)):
            way = "up" if side == "above" else "down"
            yield (
                f"a step {way} that would leave the scale is not made",
                any_of(f"{t}.{side} && {t}.enable && !{t}.fits && {t}.{name} == {level}" for t in taxels),
            )


def _window(config: ReadoutConfig) -> Named:
    """Yield the points of CW-LCS: every window width, and conditions that coincide with a tick."""
    if not config.closes:
        return
    taxels = [t for *_, t in _taxels(config)]
    for width in range(1, (1 << config.closing_levels_log2) + 1):
        yield f"window {width} steps wide", any_of(f"{t}.window.half_width == {width}" for t in taxels)
        yield (
            f"event in a window {width} steps wide",
            any_of(f"{t}.asks && {t}.moves && {t}.window.half_width == {width}" for t in taxels),
        )
    yield (
        "event in the clock in which the window would close",
        any_of(f"{t}.window.open && {t}.window.tick && {t}.window.last && !{t}.window.closed" for t in taxels),
    )
    yield "tick while a request waits", any_of(f"{t}.tick && {t}.request && !{t}.granted" for t in taxels)
    yield "tick in a closed window", any_of(f"{t}.window.tick && {t}.window.closed" for t in taxels)
    yield "closed window opened by the mask", any_of(f"{t}.window.closed && {t}.enabled && !{t}.enable" for t in taxels)


def _leak(config: ReadoutConfig) -> Named:
    """Yield the points of the leaks of every row, and of conditions that coincide with a leak."""
    if not config.encoder.leaks:
        return
    taxels = [t for *_, t in _taxels(config)]
    for row in range(config.rows):
        yield f"leak in row {row}", f"row_{row}.decay"
    yield "event and leak in one clock", any_of(f"{t}.decay && {t}.moves && {t}.asks && {t}.enabled" for t in taxels)
    yield "leak while a request waits", any_of(f"{t}.decay && {t}.request && !{t}.granted" for t in taxels)
    leaks = "{0}.decay && {0}.moves && !{0}.asks && {0}.enable"
    bit = config.leak_shift - 1
    yield "leak rounded up", any_of(f"{leaks.format(t)} && {t}.charge[{bit}]" for t in taxels)
    yield "leak rounded down", any_of(f"{leaks.format(t)} && !{t}.charge[{bit}] && {t}.share != 0" for t in taxels)
    yield "leak at the floor", any_of(f"{leaks.format(t)} && {t}.share == 0 && {t}.charge != 0" for t in taxels)
