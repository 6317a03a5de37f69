"""Bipolar N-LCS: a leaky neuron with a signed reference and ON and OFF events (docs/specification.md, section 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from eskin.model.encoders.encoder import Constants
from eskin.model.encoders.nlcs import Nlcs, leaky_ticks

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

    ticks = staticmethod(leaky_ticks(bipolar=True))
