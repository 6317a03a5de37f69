"""Coverage points of the registers: field limits, rejected words, test pattern and SPI."""

from collections.abc import Iterator

from eskin.model.config import ReadoutConfig
from eskin.model.registers import description
from eskin.model.registers.description import Field, Register
from eskin.verify.coverage.points.point import Named, Point, began, points_of, table
from eskin.verify.coverage.points.readout import some


def registers(config: ReadoutConfig) -> Iterator[Point]:
    """Yield the coverage points of a readout with registers, and of the host interface."""
    group = f"registers {config.encoding}"
    yield from points_of(group, "eskin_registers", *map(_register, description.registers(config)), _file(config))
    yield from points_of(f"test pattern {config.encoding}", "eskin_pattern", _pattern(config))
    yield from points_of("spi", "eskin_spi", table("spi"))
    yield from points_of(f"{group} {config.frontend}", "eskin_readout", _array(config))


def _plain(register: Register) -> str:
    return register.name if register.index is None else f"{register.name}_{register.index}"


def _register(register: Register) -> Named:
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
    yield from table("registers", holes=" && ".join(f"!at_{_plain(one)}" for one in description.registers(config)))
    set_anew = began(f"resolution_bits != {config.resolution}") if config.resolution > 1 else "rst"
    yield "reset of what was set", set_anew


def _pattern(config: ReadoutConfig) -> Named:
    yield from table("pattern")
    for mode in (1, 2):
        yield from table("pattern_mode", mode=mode, row=config.rows - 1, column=config.columns - 1)
    for interval in range(16):
        yield f"interval {interval}", f"rises && interval == {interval}"
    for row in range(config.rows):
        for column in range(config.columns):
            yield f"request of taxel {row}, {column} taken", f"taken && at_row == {row} && at_column == {column}"
    if config.has_polarity:
        yield from table("pattern_polarity")


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
    for bits in range(1, config.resolution + 1):
        step = 1 << config.resolution - bits
        yield f"a taxel asks at {bits} bits", f"host.step == {step} && {some(config, 'T.asks')}"
        for way, side in _beyond(config):
            beyond = f"a step {way} that would leave the scale at {bits} bits is not made"
            yield beyond, f"host.step == {step} && {side}"
    if config.frontend == "analog" and config.has_polarity:
        yield "both comparators fire", "|(above & below)"
    yield from table("settings")
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
