"""Properties of the whole readout at its ports: one event per step of a reference, no event of a masked taxel."""

from collections.abc import Generator
from typing import Any, ClassVar

from amaranth.hdl import Array, Cat, Const, Module, Signal, signed
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.rtl.readout import Readout
from eskin.verify.proofs.checker import Checker, Promises, before, implies, pick


def shows_steps(config: ReadoutConfig) -> bool:
    """Return True if every step of a reference is visible at the ports."""
    return config.frontend == "analog" and not (config.encoder.leaks or config.closes)


class ReadoutChecker(Checker[ReadoutConfig]):
    """Checker of the readout and of one taxel in it; samples, comparators and masks are free.

    A step is a move of the reference, where the ports show it (``shows_steps``). Else it is the taxel's own decision:
    ``TaxelChecker`` proves that the reference moves with it.
    """

    block = Readout
    only: ClassVar = {
        "leaves_in_time": lambda config: config.protocol.streams,
        "masked_for_good": lambda config: config.protocol.streams,
        "masked_is_reset": shows_steps,
        "deaf_unless_asked": shows_steps,
        "asks_at_ticks": lambda config: config.frontend == "analog",
        "others_do_not_move": shows_steps,
    }

    def constants(self, config: ReadoutConfig) -> dict[str, int]:
        return {"watch": config.taxels}

    def check(self, m: Module) -> Promises:
        config = self.config
        enable = pick([*self.taxel_enable], self.watch)
        event, polarity = self._event(m)
        if shows_steps(config):
            step, up = yield from self._steps_at_ports(m, enable)
        else:
            step, up = self._steps_within(m)
        yield from self._queue(m, enable, step, up, event, polarity)
        yield from self._masked(m, enable, event)
        if config.frontend == "analog":
            asks = pick([*self.compare], self.watch)
            ticked = before(m, enable & self.sample_valid, "ticked")
            yield "asks_at_ticks", implies(ticked, asks), ticked
            if shows_steps(config):
                yield "deaf_unless_asked", implies(step, before(m, asks, "asked")), step

    def inner(self, config: ReadoutConfig) -> dict[str, Any]:
        return dict.fromkeys(self.places(config), In(1))

    def places(self, config: ReadoutConfig) -> dict[str, str]:
        """Return the internal signals that show the decisions of each taxel, unless the ports show them."""
        wires = [] if shows_steps(config) else ["asks", "moves", *(["polarity"] if config.has_polarity else [])]
        taxels = [divmod(taxel, config.columns) for taxel in range(config.taxels)]
        return {f"{wire}_{r}_{c}": f"row_{r}.taxel_{c}.{wire}" for wire in wires for r, c in taxels}

    def _steps_within(self, m: Module) -> tuple[Any, Any]:
        """Return whether the watched taxel stepped one clock before, and whether it stepped up."""
        found = {}
        for wire in ("asks", "moves", "polarity"):
            own = [getattr(self, name) for name in self.places(self.config) if name.startswith(f"{wire}_")]
            found[wire] = pick(own, self.watch) if own else Const(1)
        return before(m, found["asks"] & found["moves"], "decided"), found["polarity"]

    def _steps_at_ports(self, m: Module, enable: Any) -> Generator[tuple[str, Any, Any], None, tuple[Any, Any]]:
        """Return whether the watched reference moved one clock before, and whether it moved up."""
        config = self.config
        reference = Signal(signed(config.sample_bits), name="u")
        words = [self.reference_code[i * config.sample_bits :][: config.sample_bits] for i in range(config.taxels)]
        m.d.comb += reference.eq(pick(words, self.watch).as_signed())
        old, on = before(m, reference, "u"), before(m, enable, "enable")
        known = before(m, Const(1, 1), "known")
        step, size = on & (reference != old), reference - old
        exact = (size == 0) | (size == config.step) | (size == -config.step)
        yield "others_do_not_move", implies(on, exact), step
        off = known & ~on
        start = config.reference_reset
        yield "masked_is_reset", implies(off, reference == start), off & (old != start)
        return step, reference > old

    def _event(self, m: Module) -> tuple[Any, Any]:
        """Return whether an event of the watched taxel leaves in this clock, and its polarity."""
        config, link = self.config, self.config.protocol
        shown = link.shown(config, self.port, lambda word, low, width: word[low:][:width])
        leaves = shown.high[0]
        if link.rule().late:
            req = Cat(shown.high).any()
            leaves = req & ~before(m, req, "req")
        return leaves & (shown.row * config.columns + shown.column == self.watch), shown.polarity

    def _queue(self, m: Module, enable: Any, step: Any, up: Any, event: Any, polarity: Any) -> Promises:
        """Queue the signs of steps whose events have not left yet."""
        depth = 2 + self.config.protocol.holds
        steady, count, signs = Signal(init=1), Signal(range(depth + 2)), Signal(depth + 1)
        m.d.sync += steady.eq(steady & enable)
        # A step that is seen in this clock was made at the end of the one before: its event may not leave yet.
        now = count + (step & (count <= depth))
        held = (signs | (up << count) & step.replicate(depth + 1))[: depth + 1]
        m.d.sync += [
            count.eq(now - (event & (now != 0))),
            signs.eq(Cat(Array([held, Cat(held[1:], Const(0, 1))])[event])),
        ]
        right, falls = count != 0, Const(1)
        if self.config.has_polarity:
            right, falls = right & (polarity == signs[0]), ~polarity
        yield "one_event_per_step", implies(event & steady, right), event & steady & falls
        yield "none_outstanding", implies(steady, now <= depth), steady & (now == depth)
        if self.config.protocol.streams:
            bound = (self.config.rows + 1) * self.config.columns + 2
            clocks = self.count_to(m, bound, event | (now == 0), self.event_ready)
            yield "leaves_in_time", implies(steady, clocks < bound), event & steady & (clocks >= self.config.columns)

    def _masked(self, m: Module, enable: Any, event: Any) -> Promises:
        most = 1 + self.config.protocol.holds
        left = self.count_to(m, most + 1, enable, event)
        yield "masked_is_silent", left <= most, ~enable & (left == most)
        if self.config.protocol.streams:
            bound = self.config.columns + 1
            clocks = self.count_to(m, bound, enable, self.event_ready)
            yield "masked_for_good", implies(~enable & (clocks == bound), ~event), ~enable & event
