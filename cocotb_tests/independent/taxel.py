"""The taxels of all encoders, one object per taxel."""

from eskin.cocotb_tests.independent.settings import Settings


class Taxel:
    """Common parts of all taxels: newest sample, reference, and at most one request.

    Attributes
    ----------
    sample : the newest sample, in codes
    reference : u, in codes (N-LCS: in units of 2**-F codes)
    request : None, or the polarity of the request that waits (1 ON, 0 OFF)
    strobe : the analog comparators are asked in this clock
    """

    leaks, has_off = False, True

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """Reset the taxel."""
        self.sample = 0
        self.reference = self.settings.reference_reset
        self.request: int | None = None
        self.strobe = self.was_enabled = False

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
        ask: bool = False,
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
        ask : new samples come, or a host wrote a register in the clock before (analog front end)
        """
        if not enabled:
            self.reset()
            return
        every_clock = self.settings.decide_every == "clock"
        before = self.half_width()
        if decisions is None:
            look = every_clock or tick
            above, below = self.compare()
        else:
            look = self.strobe
            above, below = decisions
        wish = self.wish(above, below) if look else None
        free = self.request is None or taken
        if free:
            self.request = wish
            self.move(wish, tick, leak)
        moved = free and ((leak and self.leaks) or self.half_width() != before)
        self.strobe = ask or (every_clock and (not self.was_enabled or wish is not None or moved))
        self.was_enabled = True
        if sample is not None:
            self.sample = sample

    def wish(self, above: bool, below: bool) -> int | None:
        """Return the polarity of the step that the comparators ask for; None if there is none on the scale."""
        width = self.half_width()
        code = self.reference_code()
        if above:
            return 1 if code + width <= self.settings.top else None
        return 0 if self.has_off and below and code - width >= self.settings.bottom else None

    def move(self, wish: int | None, tick: bool, leak: bool) -> None:
        """Make the step of a wish, and what a tick and a leak do to a free taxel."""
        raise NotImplementedError


class LcsTaxel(Taxel):
    """Level crossing: up by h for x - u >= h, down by h for x - u < -h, where the half-width h is D."""

    def move(self, wish: int | None, tick: bool, leak: bool) -> None:
        if wish is not None:
            self.reference += self.half_width() if wish else -self.half_width()


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

    def move(self, wish: int | None, tick: bool, leak: bool) -> None:
        super().move(wish, tick, leak)
        if wish is not None:
            self.window.open()
        elif tick:
            self.window.tick()


class NlcsTaxel(Taxel):
    """Leaky neuron: up by D for x - u > D; u leaks at the decay ticks of its row."""

    leaks, has_off = True, False

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

    def move(self, wish: int | None, tick: bool, leak: bool) -> None:
        old = self.reference
        if wish is not None:
            self.reference += self.settings.step * self.unit
        if leak:
            k = self.settings.leak_shift
            self.reference -= (old + 2 ** (k - 1)) // 2**k


class BipolarNlcsTaxel(NlcsTaxel):
    """Leaky neuron with a signed reference: OFF if x is more than D below u, rounded down; u leaks to zero.

    A step towards zero takes the place of the leak.
    """

    has_off = True

    def compare(self) -> tuple[bool, bool]:
        difference = self.sample - self.reference_code()
        return difference > self.settings.step, difference < -self.settings.step

    def move(self, wish: int | None, tick: bool, leak: bool) -> None:
        old = self.reference
        if wish is not None:
            self.reference += self.settings.step * self.unit * (1 if wish else -1)
        nearer = self.reference > old if old < 0 else self.reference < old
        if leak and not nearer:
            k = self.settings.leak_shift
            self.reference -= (old + 2 ** (k - 1)) // 2**k


KINDS = {"nlcs-bipolar": BipolarNlcsTaxel, "lcs": LcsTaxel, "cw-lcs": CwLcsTaxel, "nlcs": NlcsTaxel}
