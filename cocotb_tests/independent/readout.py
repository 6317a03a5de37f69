"""Array, arbiter and link, clock by clock."""

from collections.abc import Sequence
from typing import Any

from eskin.cocotb_tests.independent.arbiter import Arbiter
from eskin.cocotb_tests.independent.fields import on, signals
from eskin.cocotb_tests.independent.link import LINKS
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import KINDS


class Readout:
    """A readout of `rows` x `columns` taxels.

    In each clock look at `outputs`, then call `clock` with the inputs of the same clock.

    Attributes
    ----------
    time : clocks since the end of the last reset
    events : all that were transferred: (time, column, row, polarity)
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.on = on(settings)
        kind = KINDS[settings.encoding]
        self.taxels = [[kind(settings) for _ in range(settings.columns)] for _ in range(settings.rows)]
        self.arbiter = Arbiter(settings.rows, settings.columns)
        self.link = LINKS[settings.link]()
        self.events: list[tuple[int, int, int, int]] = []
        self.reset()

    def reset(self) -> None:
        """Reset the readout; sent events remain recorded."""
        for row in self.taxels:
            for taxel in row:
                taxel.reset()
        self.arbiter.reset()
        self.link.reset()
        self.time = 0
        self.new_samples = False
        self.ticks = 0

    def outputs(self) -> dict[str, Any]:
        """Return the outputs in this clock by port name."""
        return self.link.outputs(self.arbiter.output())

    def thresholds(self) -> list[tuple[int, int]]:
        """Return (reference_code, half_width) of every taxel for analog comparators."""
        return [(taxel.reference_code(), taxel.half_width()) for row in self.taxels for taxel in row]

    def strobes(self) -> list[bool]:
        """Return which taxels ask their analog comparators in this clock."""
        return [taxel.strobe for row in self.taxels for taxel in row]

    def clock(
        self,
        *,
        sample_valid: bool = False,
        sample: Sequence[int] | None = None,
        enable: Sequence[bool] | None = None,
        ready: bool = True,
        ack: int = 0,
        decisions: Sequence[tuple[bool, bool]] | None = None,
        rst: bool = False,
    ) -> None:
        """Apply a rising edge with the inputs of this clock.

        Parameters
        ----------
        sample_valid : the sample tick's input
        sample : codes of all taxels, index row * columns + column (digital front end)
        enable : mask bits of all taxels, default all 1
        ready : event_ready (link stream)
        ack : aer_ack (asynchronous receiver)
        decisions : (above, below) of all taxels (analog front end)
        rst : the reset
        """
        if rst:
            self.reset()
            return
        digital = {"digital": True, "analog": False}[self.settings.frontend]
        if sample is not None:
            sample = signals(self.settings, sample)
        enabled = [has and (enable is None or bool(enable[i])) for i, has in enumerate(self.on)]
        tick = self.new_samples
        taken = self._clock_arbiter(ready, ack, enabled)
        codes = sample if sample_valid and digital else None
        self._clock_taxels(tick, taken, codes, enabled, decisions, sample_valid)
        if tick:
            self.ticks += 1
        self.new_samples = sample_valid
        self.time += 1

    def requests(self, enable: Sequence[bool]) -> list[list[int | None]]:
        """Return the requests of enabled taxels: a polarity or None for each row and column."""
        columns = self.settings.columns
        return [
            [taxel.request if enable[r * columns + c] else None for c, taxel in enumerate(row)]
            for r, row in enumerate(self.taxels)
        ]

    def _clock_arbiter(self, ready: bool, ack: int, enable: Sequence[bool]) -> list[tuple[int, int]]:
        """Advance the arbiter; return the latched requests."""
        offered = self.arbiter.output()
        ready = self.link.ready(ready)
        left = self.link.clock(offered, ack, ready)
        if left is not None:
            row, column, polarity = left
            self.events.append((self.time, column, row, polarity))
        return self.arbiter.clock(self.requests(enable), ready)

    def _clock_taxels(
        self,
        tick: bool,
        taken: list[tuple[int, int]],
        sample: Sequence[int] | None,
        enable: Sequence[bool],
        decisions: Sequence[tuple[bool, bool]] | None,
        new: bool,
    ) -> None:
        settings = self.settings
        for r in range(settings.rows):
            leak = tick and self.ticks % settings.leak_period == r * settings.leak_period // settings.rows
            for c in range(settings.columns):
                i = r * settings.columns + c
                self.taxels[r][c].clock(
                    enabled=enable[i],
                    taken=(r, c) in taken,
                    sample=None if sample is None else int(sample[i]),
                    tick=tick,
                    leak=leak,
                    decisions=None if decisions is None else decisions[i],
                    ask=new,
                )
