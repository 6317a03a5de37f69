"""Bipolar N-LCS: a leaky neuron with a signed reference and ON and OFF events (docs/specification.md, section 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from eskin.model.decay import leak_of, leaking
from eskin.model.encoders.encoder import Constants
from eskin.model.encoders.nlcs import Nlcs

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class NlcsBipolarRule(Constants):
    """Constants of bipolar N-LCS."""


class NlcsBipolar(Nlcs):
    """Leaky-neuron level crossing with a signed reference that leaks towards zero.

    A step towards zero replaces the leak of its clock. Therefore all events of a tick have the same sign, however large
    the leak is. After a step towards zero the sample is still beyond the reference. Any other step moves the reference
    away from zero, and the leak moves it back.
    """

    name, title, colour, marker, code = "nlcs-bipolar", "bipolar N-LCS", "#009e73", "v", 3
    polarity = timed = True
    Rule = NlcsBipolarRule

    def error_bound(self, config: ReadoutConfig) -> tuple[float, float]:
        """Return -D - 1 < x - u <= D, widened by a leak at both ends for one decision per tick.

        OFF compares with the reference rounded down to a code, hence the 1.
        """
        leak = self.largest_leak(config) if config.decisions_per_tick == 1 else 0
        return -config.step - 1 + 2.0**-config.fraction_bits - leak, config.step + leak

    @staticmethod
    def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
        """Compare the sample with both thresholds, exclusive; the reference is rounded down to a code."""
        d = (taxel.x - (taxel.u >> rule.fraction_bits)) << rule.fraction_bits
        return d > rule.step, d < -rule.step

    @staticmethod
    def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
        """Move the reference by D at an event, and apply the leak unless D moves it towards zero."""
        inward = (on and taxel.u < 0) or (off and taxel.u >= 0)
        leak = leak_of(taxel.u, rule.leak_shift) if leaks and not inward else 0
        taxel.u += (rule.step if on else -rule.step if off else 0) - leak
        return leaks

    @staticmethod
    def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
        """Write the event counts of every tick; u and D are in units of 2**-F codes.

        The order is: the first decision; the leak of the old u, if due and if the step did not lead towards zero; then
        ON while x - u > D, or OFF while x - u <= -D - 1 code. In a tick without a leak these events are all events.
        """
        (u,) = state
        word = u.dtype.type
        fraction, step_shift, one = word(rule.fraction_bits), word(rule.step_log2), word(1 << rule.fraction_bits)
        upper, lower = word(1 << rule.step_log2), word(-(1 << rule.step_log2) - (1 << rule.fraction_bits))
        most, high, none = word(rule.cap), word(rule.cap - 1), word(0)
        for i in range(x.shape[0]):
            zero, leak_from, leak_to, end = leaking(phase, (tick + i) % rule.leak_period)
            for low, up in ((zero, leak_from), (leak_to, end)):
                for j in range(low, up):
                    d = word(np.left_shift(word(x[i, j]), fraction) - u[j])
                    ups = min(max(np.right_shift(word(d - 1), step_shift), none), most)
                    downs = min(max(np.right_shift(word(word(-d) - one), step_shift), none), most)
                    n = word(ups - downs)
                    u[j] = word(u[j] + np.left_shift(n, step_shift))
                    counts[i, j] = n
                    if timed:
                        late[i, j] = False
            for j in range(leak_from, leak_to):
                d = word(np.left_shift(word(x[i, j]), fraction) - u[j])
                first = word(word(d > upper) - word(d <= lower))
                outward = (first == none) | ((first > none) == (u[j] >= none))
                leak = word(leak_of(u[j], rule.leak_shift)) if outward else none
                move = word(np.left_shift(first, step_shift) - leak)
                d = word(d - move)
                ups = min(max(np.right_shift(word(d - 1), step_shift), none), high)
                downs = min(max(np.right_shift(word(word(-d) - one), step_shift), none), high)
                more = word(ups - downs)
                u[j] = word(u[j] + word(move + np.left_shift(more, step_shift)))
                counts[i, j] = word(first + more)
                if timed:
                    late[i, j] = (first == 0) & (more != 0)
