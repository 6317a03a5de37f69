"""Properties of the taxel: requests, reference movement, masks and waiting requests."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from amaranth.hdl import Const, Module, Mux, Signal, Value, signed
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.rtl.logic import or_tree
from eskin.rtl.taxel import Taxel
from eskin.verify.proofs.checker import Checker, Promises, at_most_one, before, implies


def _analog(config: ReadoutConfig) -> bool:
    return config.frontend == "analog"


def _leaks(config: ReadoutConfig) -> bool:
    return config.encoder.leaks


@dataclass
class Now:
    """Next state of a taxel by the specification; references in codes with all fraction bits."""

    # those of this clock
    reference: Value
    half_width: Value
    wants_event: Value  # the taxel decides, and a comparator is high, on the scale or off it
    allowed: Value  # the step of the comparators stays on the scale
    acts: Value  # the taxel raises an event at the end of this clock
    up: Value  # direction of the step
    then: Value  # the reference after this clock, as an integer of more bits than the scale


class TaxelChecker(Checker[ReadoutConfig]):
    """Checker of one taxel; samples, comparators, grants, mask, ticks and settings are free."""

    block = Taxel
    only: ClassVar = {
        "ends_do_nothing": _analog,
        "approaches": lambda config: not _analog(config) and not _leaks(config),
        "polarity_of_step": lambda config: config.has_polarity,
        "window_opens": lambda config: config.closes,
        "leak_is_monotone": _leaks,
        "leak_reaches_floor": _leaks,
        "asks_exactly": _analog,
        "seen_at_ticks": _analog,
        "holding_is_enough": lambda config: config.asks_between_ticks,
        "code_is_floor": lambda config: _leaks(config) and _analog(config),
    }

    def __init__(self, config: ReadoutConfig) -> None:
        if config.registers != "none":
            self.assumptions = {  # type: ignore[misc]  # one that only such a taxel has
                "settings_in_range": "D is one-hot, the leak and the window's period are at least 1"
            }
        super().__init__(config)

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive the settings with any values in the ranges of their registers."""
        if self.config.registers == "none":
            return set()
        coarser = free("coarser", len(self.step))
        found = Mux(coarser < len(self.step), Const(1) << coarser, 1)
        m.d.comb += self.step.eq(found)
        names = {"leak_shift": self.config.leak_shift, "window_period": self.config.window_period}
        for name in filter(self.has, names):
            value = free(name, len(getattr(self, name)))
            m.d.comb += getattr(self, name).eq(Mux((value == 0) | (value > names[name]), names[name], value))
        return {"step", *filter(self.has, names)}

    def inner(self, config: ReadoutConfig) -> dict[str, Any]:
        """Return reference and half-width if no ports show all their bits."""
        if _leaks(config):
            bits = config.sample_bits + config.fraction_bits
            return {"charge": In(signed(bits) if config.has_polarity else bits - 1)}
        if _analog(config):
            return {}
        own = {"reference": In(signed(config.sample_bits - (config.grid - 1).bit_length()))}
        return own | ({"window_half_width": In(config.closing_levels_log2 + 1)} if config.closes else {})

    def check(self, m: Module) -> Promises:
        self._settings(m)
        now = self._now(m)
        yield from self._requests(m, now)
        yield from self._moves(m, now)
        yield from self._stillness(m, now)
        if _analog(self.config):
            yield from self._strobe(m, now)

    @property
    def _fraction(self) -> int:
        return self.config.encoder.fraction_bits(self.config)

    @property
    def _init(self) -> int:
        return self.config.reference_reset << self._fraction

    def _settings(self, m: Module) -> None:
        """Set D in codes and the leak shift, now and one clock ago."""
        config = self.config
        if config.registers == "none":
            self._d = self._d_before = config.step
            self._k = self._k_before = config.leak_shift
            self._same: Any = Const(1)
            return
        step = Signal(range(config.full_scale), name="d")
        units = [Mux(unit, config.step << place, 0) for place, unit in enumerate(self.step)]
        m.d.comb += step.eq(or_tree(units))
        self._d, self._d_before = step, before(m, step, "d")
        self._same = self._d == self._d_before
        holds: Any = at_most_one(self.step) & self.step.any()
        self._k = self._k_before = config.leak_shift
        if _leaks(config):
            self._k, self._k_before = self.leak_shift, before(m, self.leak_shift, "k")
            holds &= self.leak_shift != 0
        if config.closes:
            holds &= self.window_period != 0
        self.suppose(m, "settings_in_range", holds)

    def _shifted(self, value: Any, shift: Any) -> Any:
        """Return a value shifted right by k, fixed or set by a host."""
        if isinstance(shift, int):
            return value >> shift
        found: Any = value >> 1
        for number in range(2, self.config.leak_shift + 1):
            found = Mux(shift == number, value >> number, found)
        return found

    def _now(self, m: Module) -> Now:
        config, fraction = self.config, self._fraction
        wide = signed(config.sample_bits + fraction + 4)
        reference, half_width, then = (Signal(wide, name=name) for name in ("u", "h", "u_then"))
        if _leaks(config):
            m.d.comb += reference.eq(self.charge)
        else:
            m.d.comb += reference.eq(self.reference_code if _analog(config) else self.reference * config.grid)
        m.d.comb += half_width.eq(self._d << fraction)
        if config.closes and _analog(config):
            m.d.comb += half_width.eq(self.half_width)
        elif config.closes:  # of the D that is set, as many closing steps as the window shows
            m.d.comb += half_width.eq((self.window_half_width * self._d) >> config.closing_levels_log2)

        free = self.enable & (~self.request | self.granted)
        decides = free & (self.tick if config.decide_every == "sample" and not _analog(config) else Const(1))
        if _analog(config):
            decides &= self.compare
        above, below = self._comparators(m, reference, half_width)
        up = Value.cast(above)
        moved = Mux(up, reference + half_width, reference - half_width)
        top, bottom = config.full_scale << fraction, config.encoder.lowest(config) << fraction
        wants_event = decides & (above | below)
        allowed = (moved >= bottom) & (moved < top)
        acts = wants_event & allowed
        leak: Any = 0
        if _leaks(config):
            leak = Mux(free & self.decay, self._shifted(reference + self._floor(self._k), self._k), 0)
            if config.has_polarity:  # a step towards zero replaces the leak
                leak = Mux(acts & (up == (reference < 0)), 0, leak)
        m.d.comb += then.eq(reference + Mux(acts, Mux(up, half_width, -half_width), 0) - leak)
        return Now(reference, half_width, wants_event, allowed, acts, up, then)

    def _floor(self, shift: Any) -> Any:
        return 1 << (shift - 1) if isinstance(shift, int) else (Const(1) << shift) >> 1

    def _comparators(self, m: Module, reference: Signal, half_width: Signal) -> tuple[Any, Any]:
        """Return the comparator decisions by the specification."""
        config = self.config
        if _analog(config):
            return self.above, self.below if config.has_polarity else Const(0)
        sample = Signal(signed(config.sample_bits), name="x")
        # To a taxel without polarity, whose reference never is below zero, a sample below zero is as good as zero.
        newest = self.sample if config.has_polarity else Mux(self.sample < 0, 0, self.sample)
        if Taxel(config).sleeps:  # that of the block is kept, and not heard until there is a new one
            kept, known = Signal(sample.shape(), name="x_kept"), Signal(name="x_known")
            with m.If(self.enable & self.sample_valid):
                m.d.sync += kept.eq(newest)
            m.d.sync += known.eq(self.enable & (known | self.sample_valid))
            m.d.comb += sample.eq(Mux(known, kept, 0))
        else:
            self.keep(m, sample, ~self.enable, self.sample_valid, newest)
        self._sample = sample
        gap = Signal(signed(config.sample_bits + 4), name="gap")
        m.d.comb += gap.eq(sample - (reference >> self._fraction))
        half_width = half_width >> self._fraction
        above = gap > half_width if config.encoder.strict else gap >= half_width
        return above, gap < -half_width if config.has_polarity else Const(0)

    def _requests(self, m: Module, now: Now) -> Promises:
        taken = self.request & self.granted
        due = Signal()
        m.d.sync += due.eq(self.enable & (now.acts | (self.request & ~self.granted)))
        acted = before(m, now.acts, "acted")
        yield "decides_exactly", self.request == (due & self.enable), self.request & acted
        again = before(m, taken & now.acts, "again")
        yield "asks_again", implies(again & self.enable, self.request), again & self.enable
        stopped = before(m, now.wants_event & ~now.acts, "stopped")
        still = now.reference == before(m, now.reference, "u") if not _leaks(self.config) else Const(1)
        yield "ends_do_nothing", implies(stopped, ~self.request & still), stopped
        if self.config.has_polarity:
            up = before(m, now.up, "up")
            yield "polarity_of_step", implies(acted & self.request, self.polarity == up), acted & ~up

    def _moves(self, m: Module, now: Now) -> Promises:
        config = self.config
        expected = Signal(now.reference.shape(), init=self._init, name="u_expected")
        m.d.sync += expected.eq(Mux(self.enable, now.then, self._init))
        acted, old = before(m, now.acts, "acted"), before(m, now.reference, "u")
        yield "reference_exact", now.reference == expected, acted
        # A wrap is a jump over the whole scale. Near the end one more step of this size would leave it.
        jump = now.reference - old
        step = self._d_before << self._fraction
        size = _magnitude(m, old, "size") if _leaks(config) else None
        down: Any = self._shifted(size, self._k_before) + 1 if _leaks(config) else step
        up: Any = step
        if _leaks(config) and config.has_polarity:
            up = down = step + down
        near = acted & (now.reference + step >= config.full_scale << self._fraction)
        on = before(m, self.enable, "on")
        yield "never_wraps", implies(on, (jump <= up) & (jump >= -down)), on & near
        if not _analog(config) and not _leaks(config):
            sample = before(m, self._sample, "x")
            after, ahead = (_magnitude(m, sample - u, name) for u, name in ((now.reference, "after"), (old, "ahead")))
            yield "approaches", implies(acted, after < ahead), acted
        if config.closes:
            yield "window_opens", implies(acted, now.half_width == self._d), acted
        if _leaks(config):
            floor = self._floor(self._k_before)
            quiet = before(m, self.enable & ~now.acts, "quiet")
            inward = now.reference <= old
            if config.has_polarity:
                inward = Mux(old < 0, (now.reference >= old) & (now.reference <= 0), inward & (now.reference >= 0))
            yield "leak_is_monotone", implies(quiet, inward), quiet & (now.reference < old)
            leaked = quiet & before(m, self.decay & (~self.request | self.granted), "leaked")
            lower = Mux(old >= floor, now.reference < old, Mux(old < -floor, now.reference > old, now.reference == old))
            # From the top of a wide reference the floor is hundreds of leaks away.
            near_floor = now.reference < floor if self.config.leak_shift < 4 else now.reference < old
            yield "leak_reaches_floor", implies(leaked, lower), leaked & (old >= floor) & near_floor
            if _analog(config):
                floor_code = now.reference >> self._fraction
                yield "code_is_floor", self.reference_code == floor_code, floor_code != 0

    def _stillness(self, m: Module, now: Now) -> Promises:
        waited = before(m, self.enable & self.request & ~self.granted, "waited")
        state = [now.reference, now.half_width, *([self.polarity] if self.config.has_polarity else [])]
        same: Any = ~self.enable | self.request
        for number, value in enumerate(state):  # a half-width follows the D that a host sets
            kept = value == before(m, value, f"state_{number}")
            same &= kept | ~self._same if value is now.half_width else kept
        yield "waits_unchanged", implies(waited, same), waited & self.enable
        asked = before(m, self.request, "asked")
        yield "disabled_is_silent", implies(~self.enable, ~self.request), asked & ~self.enable
        off = before(m, ~self.enable, "off")
        reset = (now.reference == self._init) & ~self.request
        if self.config.closes:
            reset &= now.half_width == self._d
        yield "disabled_is_reset", implies(off, reset), off & (before(m, now.reference, "u_off") != self._init)

    def _strobe(self, m: Module, now: Now) -> Promises:
        """Check when the comparators are asked.

        ``holding_is_enough`` is why the strobe changes no event of a signal that changes only at sample ticks: a
        comparator's answer depends on signal, reference and half-width, so an answer of this clock would be the last
        answer. The last answer allowed no step, and a readout that asks in every clock does nothing either. A host
        changes D and fields only together with ``ask`` (``HostChecker``).
        """
        config = self.config
        below = self.below if config.has_polarity else Const(0)
        answered = self.compare & (self.above | below) & now.allowed
        on = before(m, self.enable, "enabled")
        asked, ended = before(m, self.enable & self.ask, "asked"), before(m, self.enable & ~on, "ended")
        expected: Any = asked
        if config.asks_between_ticks:
            free = ~self.request | self.granted
            leaks = free & self.decay if _leaks(config) else Const(0)
            narrower = (now.half_width < before(m, now.half_width, "h")) & self._same if config.closes else Const(0)
            again = before(m, self.enable & (answered | leaks), "answered_or_leaked")
            expected = asked | ended | again | (narrower & on)
        known = self._same if config.closes else Const(1)  # another D also changes the width
        seen = self.compare & ~asked if config.asks_between_ticks else asked
        yield "asks_exactly", implies(known, self.compare == expected), seen
        crossed = before(m, asked & now.acts, "crossed")
        yield "seen_at_ticks", implies(asked, self.compare) & implies(crossed & self.enable, self.request), crossed
        if config.asks_between_ticks:
            last = Signal(now.reference.shape(), name="u_last"), Signal(now.half_width.shape(), name="h_last")
            stepped, steady = Signal(), Signal()
            with m.If(self.compare):
                m.d.sync += [last[0].eq(now.reference), last[1].eq(now.half_width), stepped.eq(answered)]
            m.d.sync += steady.eq(self.compare | (steady & self._same))
            held = (now.reference == last[0]) & (now.half_width == last[1]) & ~stepped & ~before(m, self.ask, "ask")
            rests = self.enable & on & ~self.compare
            yield "holding_is_enough", implies(rests & steady & self._same, held), rests & self.request


def _magnitude(m: Module, value: Value, name: str) -> Signal:
    size = Signal(len(value), name=name)
    m.d.comb += size.eq(Mux(value < 0, -value, value))
    return size
