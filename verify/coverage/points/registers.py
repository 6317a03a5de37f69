"""Coverage points of the registers: field limits, rejected words, test pattern and SPI."""

from __future__ import annotations

from collections.abc import Iterator

from eskin.model.config import ReadoutConfig
from eskin.model.registers import description
from eskin.model.registers.description import Field, Register
from eskin.verify.coverage.points.point import Named, Point, began, points_of
from eskin.verify.coverage.points.readout import some


def registers(config: ReadoutConfig) -> Iterator[Point]:
    """Yield the coverage points of a readout with registers, and of the host interface."""
    group = f"registers {config.encoding}"
    yield from points_of(group, "eskin_registers", *map(_register, description.registers(config)), _file(config))
    yield from points_of(f"test pattern {config.encoding}", "eskin_pattern", _pattern(config))
    yield from points_of("spi", "eskin_spi", _spi())
    yield from points_of(f"{group} {config.frontend}", "eskin_readout", _array(config))


def _plain(register: Register) -> str:
    return register.name if register.index is None else f"{register.name}_{register.index}"


def _register(register: Register) -> Named:
    """Yield the points of a register: limits and bits of every field, and rejected writes."""
    here = f"at_{_plain(register)}"
    name = register.key.replace("[", " ").replace("]", "")
    if not register.writable:
        yield f"{name} written in vain", f"write && {here}"
    for field in register.fields:
        if field.kind == "pulse":
            yield f"{name}.{field.name} told", register.signal(field)
        if field.kind == "setting" and field.bits:
            yield from _setting(register, field, f"{name}.{field.name}")


def _setting(register: Register, field: Field, name: str) -> Named:
    here = f"at_{_plain(register)}"
    low = field.bits * (register.index or 0)
    signal = register.signal(field)
    value = f"{signal}[{low} +: {field.bits}]" if field.bits > 1 else signal
    data = f"write_data[{field.low} +: {field.width}]"
    yield f"{name} at its least, {field.least}", f"!rst && {value} == {field.least}"
    yield f"{name} at its most, {field.most}", f"!rst && {value} == {field.most}"
    for bit in range(field.bits):
        if field.least <= 1 << bit <= field.most or field.bits > 1:
            own = f"{signal}[{low + bit}]" if field.bits > 1 else signal
            yield f"{name} bit {bit} set", f"!rst && {own}"
            yield f"{name} bit {bit} clear", f"!rst && !{own}"
    refused = f"write && {here} && !write_{_plain(register)}"
    if field.least:
        yield f"{name} below its least refused", f"{refused} && {data} == {field.least - 1}"
    if field.most < (1 << field.width) - 1:
        yield f"{name} above its most refused", f"{refused} && {data} == {field.most + 1}"


def _file(config: ReadoutConfig) -> Named:
    found = description.registers(config)
    holes = " && ".join(f"!at_{_plain(register)}" for register in found)
    yield "a hole written", f"write && {holes}"
    yield "a hole in front of the address", f"{holes} && !rst"
    for counter in ("events", "stalls"):
        yield f"{counter} counted", f"{counter}_count_counts && !clear && !rst"
        yield f"{counter} cleared in a clock to be counted", f"{counter}_count_counts && clear"
        yield f"{counter} cleared from above 0", f"{counter}_count_bits != 0 && clear"
    set_anew = began(f"resolution_bits != {config.resolution}") if config.resolution > 1 else "rst"
    yield "reset of what was set", set_anew


def _pattern(config: ReadoutConfig) -> Named:
    """Yield the points of the test pattern: modes, rates, first and last taxel, restarts."""
    for mode in (1, 2):
        yield f"mode {mode}: request taken", f"taken && mode == {mode}"
        yield f"mode {mode}: request waits", f"request && !taken && mode == {mode} && !restart"
        yield f"mode {mode}: next request as the one before is taken", f"rises && taken && mode == {mode}"
        yield f"mode {mode}: restart while a request waits", f"restart && request && mode == {mode}"
        yield f"mode {mode}: pause between requests", f"!request && count != 0 && mode == {mode}"
        last = f"row == {config.rows - 1} && column == {config.columns - 1}"
        yield f"mode {mode}: begun at the last taxel", f"restart && mode == {mode} && {last}"
    for interval in range(16):
        yield f"interval {interval}", f"rises && interval == {interval}"
    yield "round complete", "goes_on && last"
    yield "row complete", "goes_on && last_column && !last"
    for row in range(config.rows):
        for column in range(config.columns):
            yield f"request of taxel {row}, {column} taken", f"taken && at_row == {row} && at_column == {column}"
    yield "switched off while a request waits", "restart && request && mode == 0"
    if config.has_polarity:
        for mode in (1, 2):
            yield f"mode {mode}: polarity turns", f"taken && last && turns && mode == {mode}"
            yield f"mode {mode}: polarity stays", f"taken && last && !turns && mode == {mode}"
        yield "first event ON", "restart && on && mode != 0"
        yield "first event OFF", "restart && !on && mode != 0"


def _spi() -> Named:
    """Yield the points of complete, aborted and blocked SPI transfers."""
    ends = "spi_miso_enable && cs_n[1]"
    yield "transfer begins", "starts"
    yield "word written", "write"
    yield "word read, its top bit 1", "falls && reads && count == 0 && read_data[31]"
    yield "word read, its top bit 0", "falls && reads && count == 0 && !read_data[31]"
    yield "further word of a transfer", "rises && last && in_data"
    yield "address behind the last is the first", "rises && last && in_data && address == 15'h7ffc"
    yield "ended without a bit", f"{ends} && !in_data && count == 0"
    yield "broken off in the command", f"{ends} && !in_data && count != 0"
    yield "ended behind whole words", f"{ends} && in_data && count == 0"
    yield "broken off in a word", f"{ends} && in_data && count != 0"
    yield "broken off in the last bit of a word", f"{ends} && in_data && count == 31"
    yield "broken off with SCK high", f"{ends} && sck[1]"
    yield "locked out by a short CS", "!spi_miso_enable && !cs_n[1] && sck[1] && !sck[2] && !rst"
    yield "SCK runs with CS high", "cs_n[1] && cs_n[2] && sck[1] && !sck[2]"
    yield "shortest SCK", "sck == 3'b010 || sck == 3'b101"
    yield "reset within a transfer", began("spi_miso_enable")


def _beyond(config: ReadoutConfig) -> Named:
    """Return the directions in which a step can be requested beyond the scale."""
    if config.frontend == "digital":
        return
    if not config.has_polarity:
        yield "up", some(config, "T.enable && T.above && !T.on && !T.pending")
        return
    yield "up", some(config, "T.enable && T.above && !T.fits && !T.pending")
    yield "down", some(config, "T.enable && T.below && !T.above && !T.fits && !T.pending")


def _array(config: ReadoutConfig) -> Named:
    """Yield the points of settings that change in each state of the array."""
    waits = "arbiter.event_valid && !arbiter.event_ready"
    file = "host.registers"
    for bits in range(1, config.resolution + 1):
        step = 1 << config.resolution - bits
        yield f"a taxel asks at {bits} bits", f"host.step == {step} && {some(config, 'T.asks')}"
        for way, side in _beyond(config):
            beyond = f"a step {way} that would leave the scale at {bits} bits is not made"
            yield beyond, f"host.step == {step} && {side}"
    if config.frontend == "analog" and config.has_polarity:
        yield "both comparators fire", "|(above & below)"
    yield "resolution written while an event waits for the sink", f"{file}.resolution_bits_written && {waits}"
    yield "resolution written while a request waits", f"{file}.resolution_bits_written && |arbiter.row_request"
    yield "cleared while bursting", f"{file}.control_clear && $countones(arbiter.waiting) > 1"
    yield "cleared while a request waits", f"{file}.control_clear && $past(|arbiter.row_request)"
    tested = "host.pattern.testing && !$past(host.pattern.testing)"
    yield "test pattern begins while a burst of the array is drained", f"{tested} && arbiter.event_valid"
    yield "test pattern begins while a request of the array waits", f"{tested} && $past(|arbiter.row_request)"
    yield "event of the test pattern waits for the sink", f"host.pattern.testing && {waits}"
    ends = "!host.pattern.testing && $past(host.pattern.testing)"
    yield "test pattern ends while its event is latched", f"{ends} && arbiter.event_valid"
    yield "mask of the host alone silences", "|(taxel_enable & ~host.enabled) && !host.pattern.testing"
    yield "mask from outside alone silences", "|(~taxel_enable & host.registers.mask_rest_taxels)"
    if config.encoder.leaks:
        yield "leak restarted in the clock of a tick", "ticks.restart && ticks.tick"
        for shift in range(1, config.leak_shift + 1):
            yield f"leak with k = {shift}", f"|ticks.decay && host.decay_shift == {shift}"
        for period in range(config.rows, config.leak_period + 1):
            yield f"leak with P = {period}", f"|ticks.decay && host.decay_period == {period}"
    if config.closes:
        for period in range(1, config.window_period + 1):
            closes = some(config, "T.window.tick && T.window.last && !T.window.closed")
            yield f"window closes with a period of {period}", f"host.window_period == {period} && {closes}"
