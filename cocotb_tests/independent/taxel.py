"""The taxels of all encoders, one object per taxel."""

from eskin.cocotb_tests.independent.settings import Settings


class Taxel:
    """Common parts of all taxels: newest sample, reference, and at most one request.

    Attributes
    ----------
    sample : the newest sample, in codes
    reference : u, in codes (N-LCS: in units of 2**-F codes)
    request : None, or the polarity of the request that waits (1 ON, 0 OFF)
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """Reset the taxel."""
        self.sample = 0
        self.reference = self.settings.reference_reset
        self.request: int | None = None

    def reference_code(self) -> int:
        """Return the reference for analog comparators, in codes."""
        return self.reference

    def half_width(self) -> int:
        """Return the half-width of the window for analog comparators, in codes."""
        return self.settings.step

    def compare(self) -> tuple[bool, bool]:
        """Return (above, below) for the stored sample."""
        difference = self.sample - self.reference_code()
        return difference >= self.half_width(), difference < -self.half_width()

    def clock(
        self,
        *,
        enabled: bool,
        taken: bool,
        sample: int | None,
        tick: bool,
        leak: bool,
        decisions: tuple[bool, bool] | None,
    ) -> None:
        """Apply a rising edge.

        Parameters
        ----------
        enabled : the mask bit in this clock
        taken : the arbiter takes the request in this clock
        sample : a new sample in codes, or None
        tick : this clock has the first look at a new sample
        leak : this tick is a decay tick of the taxel's row
        decisions : (above, below) of analog comparators, or None
        """
        if not enabled:
            self.reset()
            return
        if self.request is None or taken:
            self.request = None
            above, below = decisions if decisions is not None else self.compare()
            look = self.settings.decide_every == "clock" or tick
            self.decide(look and above, look and below, tick, leak)
        if sample is not None:
            self.sample = sample

    def decide(self, above: bool, below: bool, tick: bool, leak: bool) -> None:
        """Decide on a request and a step."""
        raise NotImplementedError


class LcsTaxel(Taxel):
    """Level crossing: up by h for x - u >= h, down by h for x - u < -h, where the half-width h is D."""

    def decide(self, above: bool, below: bool, tick: bool, leak: bool) -> None:
        width = self.half_width()
        if above and self.reference + width <= self.settings.top:
            self.reference += width
            self.request = 1
        elif not above and below and self.reference - width >= self.settings.bottom:
            self.reference -= width
            self.request = 0


class Window:
    """Window that closes by a step after a number of ticks without an event.

    Attributes
    ----------
    width : half-width, in codes
    quiet : ticks since it opened or closed
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.open()

    def open(self) -> None:
        """Open the window fully."""
        self.width = self.settings.step
        self.quiet = 0

    def tick(self) -> None:
        """Count a tick without an event."""
        self.quiet += 1
        if self.quiet == self.settings.window_period:
            self.quiet = 0
            self.width = max(self.width - self.settings.closing_step, self.settings.closing_step)


class CwLcsTaxel(LcsTaxel):
    """Level crossing with a window that closes while no event occurs."""

    def reset(self) -> None:
        super().reset()
        self.window = Window(self.settings)

    def half_width(self) -> int:
        return self.window.width

    def decide(self, above: bool, below: bool, tick: bool, leak: bool) -> None:
        super().decide(above, below, tick, leak)
        if self.request is not None:
            self.window.open()
        elif tick:
            self.window.tick()


class NlcsTaxel(Taxel):
    """Leaky neuron: up by D for x - u > D; u leaks at the decay ticks of its row."""

    def reset(self) -> None:
        super().reset()
        self.reference = self.settings.reference_reset * self.unit

    @property
    def unit(self) -> int:
        return 1 << self.settings.fraction_bits

    def reference_code(self) -> int:
        return self.reference // self.unit

    def compare(self) -> tuple[bool, bool]:
        return self.sample * self.unit - self.reference > self.settings.step * self.unit, False

    def decide(self, above: bool, below: bool, tick: bool, leak: bool) -> None:
        old = self.reference
        if above and old + self.settings.step * self.unit < (self.settings.top + 1) * self.unit:
            self.reference += self.settings.step * self.unit
            self.request = 1
        if leak:
            k = self.settings.leak_shift
            self.reference -= (old + 2 ** (k - 1)) // 2**k


class BipolarNlcsTaxel(NlcsTaxel):
    """Leaky neuron with a signed reference: OFF if x is more than D below u, rounded down; u leaks to zero.

    A step towards zero takes the place of the leak.
    """

    def compare(self) -> tuple[bool, bool]:
        difference = self.sample - self.reference_code()
        return difference > self.settings.step, difference < -self.settings.step

    def decide(self, above: bool, below: bool, tick: bool, leak: bool) -> None:
        old = self.reference
        rise = self.settings.step * self.unit
        bottom = self.settings.bottom * self.unit
        if above and old + rise < (self.settings.top + 1) * self.unit:
            self.reference += rise
            self.request = 1
        elif not above and below and old - rise >= bottom:
            self.reference -= rise
            self.request = 0
        nearer = self.reference > old if old < 0 else self.reference < old
        if leak and not nearer:
            k = self.settings.leak_shift
            self.reference -= (old + 2 ** (k - 1)) // 2**k


KINDS = {"nlcs-bipolar": BipolarNlcsTaxel, "lcs": LcsTaxel, "cw-lcs": CwLcsTaxel, "nlcs": NlcsTaxel}
