"""N-LCS: a leaky neuron with one comparator and a decaying threshold (docs/specification.md, section 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from eskin.base.errors import InputError
from eskin.model.decay import leak_of, leaking
from eskin.model.encoders.encoder import Constants, Encoder

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class NlcsRule(Constants):
    """Constants of N-LCS."""


def leaky_ticks(bipolar: bool) -> Any:
    """Return ``Encoder.ticks`` of N-LCS, with OFF events if bipolar."""

    def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
        """Write the event counts of every tick; u and D are in units of 2**-F codes.

        The order is: the first decision; the leak of the old u, if due and if the step did not lead towards zero; then
        ON while x - u > D, which are ceil((x - u) / D) - 1, or OFF while x - u <= -D - 1 code. In a tick without a leak
        these events are all events.
        """
        (u,) = state
        word = u.dtype.type
        fraction, step_shift, code = word(rule.fraction_bits), word(rule.step_log2), word(1 << rule.fraction_bits)
        upper, lower = word(1 << rule.step_log2), word(-(1 << rule.step_log2) - (1 << rule.fraction_bits))
        most, high, none, one = word(rule.cap), word(rule.cap - 1), word(0), word(1)
        for i in range(x.shape[0]):
            zero, leak_from, leak_to, end = leaking(phase, (tick + i) % rule.leak_period)
            for low, up in ((zero, leak_from), (leak_to, end)):
                for j in range(low, up):
                    d = word(np.left_shift(word(x[i, j]), fraction) - u[j])
                    n = min(max(np.right_shift(word(d - one), step_shift), none), most)
                    if bipolar:
                        n = word(n - min(max(np.right_shift(word(word(-d) - code), step_shift), none), most))
                    u[j] = word(u[j] + np.left_shift(n, step_shift))
                    counts[i, j] = n
                    if timed:
                        late[i, j] = False
            for j in range(leak_from, leak_to):
                d = word(np.left_shift(word(x[i, j]), fraction) - u[j])
                first, leak = word(d > upper), word(leak_of(u[j], rule.leak_shift))
                if bipolar:
                    first = word(first - word(d <= lower))
                    leak = leak if (first == none) | ((first > none) == (u[j] >= none)) else none
                move = word(np.left_shift(first, step_shift) - leak)
                d = word(d - move)
                more = min(max(np.right_shift(word(d - one), step_shift), none), high)
                if bipolar:
                    more = word(more - min(max(np.right_shift(word(word(-d) - code), step_shift), none), high))
                u[j] = word(u[j] + word(move + np.left_shift(more, step_shift)))
                counts[i, j] = word(first + more)
                if timed:
                    late[i, j] = (first == 0) & (more != 0)

    return ticks


class Nlcs(Encoder):
    """Leaky-neuron level crossing."""

    name, title, colour, marker, code = "nlcs", "N-LCS", "#d55e00", "^", 2
    parameters = ("leak_shift", "leak_period", "fraction_bits")
    polarity, leaks, strict = False, True, True
    Rule: ClassVar[Any] = NlcsRule

    def grid(self, config: ReadoutConfig) -> int:
        """Return one code; a leak may move the reference to any code."""
        return 1

    def check(self, config: ReadoutConfig) -> None:
        """Check that the reference fits 32 bits, and that a period set by a host covers all rows."""
        most = 31 - config.sample_bits
        if not 0 <= config.fraction_bits <= most:
            raise InputError(f"fraction_bits must be in 0..31 - sample_bits = {most}, not {config.fraction_bits}")
        if config.registers != "none" and config.leak_period < config.rows:
            raise InputError(
                f"leak_period must be at least the number of rows, {config.rows}, with registers={config.registers}, "
                f"not {config.leak_period}"
            )

    def error_bound(self, config: ReadoutConfig) -> tuple[float, float]:
        """Return the bounds: x - u <= D plus a leak at one decision per tick, and a lower bound for slow falls.

        No event follows a fall: u stays below the leaky peak hold of x, which leaks like u and is never below x. If x
        falls less between two decay ticks than its own level leaks, the peak hold is within one leak of x. This lower
        bound is returned. For other inputs the lower bound is minus full scale, and lower for negative inputs.
        """
        leak = self.largest_leak(config)
        return -leak, config.step + (leak if config.decisions_per_tick == 1 else 0)

    def slope_limit(self, config: ReadoutConfig) -> float:
        """Return D times the usable decisions per tick, minus the leak.

        With several decisions, one of them waits for the leak, and the others must make up for it. A negative limit
        means that the leak of a full-scale reference alone is too large.
        """
        return config.step * max(config.decisions_per_tick - 1, 1) - self.largest_leak(config)

    def largest_leak(self, config: ReadoutConfig) -> float:
        """Return the leak of a full-scale reference, in codes."""
        top = config.full_scale << config.fraction_bits
        return float(leak_of(top, config.leak_shift)) / 2**config.fraction_bits

    @staticmethod
    def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
        """Compare the sample with the upper threshold, exclusive."""
        return (taxel.x << rule.fraction_bits) - taxel.u > rule.step, False

    @staticmethod
    def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
        """Move the reference by D at an event, and apply the leak of the old reference unless D moves it to zero."""
        inward = (on and taxel.u < 0) or (off and taxel.u >= 0)
        leak = leak_of(taxel.u, rule.leak_shift) if leaks and not inward else 0
        taxel.u += (rule.step if on else -rule.step if off else 0) - leak
        return leaks

    ticks = staticmethod(leaky_ticks(bipolar=False))
