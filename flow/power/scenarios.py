"""Stimuli for power measurements: idle, one event, an event in every clock, a texture.

With the closing window of CW-LCS "nothing" is two things: it rests once all windows are closed, and before that they
count.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.textures import scan
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate, strobes

IDLE, CLOSING, LONE, SATURATED, TEXTURE = "idle", "closing", "lone", "saturated", "texture"
TEXTURE_START = 60
"""Sample tick of a scan at which its window begins: the sensor has settled."""
LONE_TICKS = 16
MAX_SATURATED = 512
MAX_TO_CLOSE = 1000
"""Largest number of sample ticks until windows are closed; the gates are simulated in these ticks, too."""


@dataclass(frozen=True)
class Scenario:
    """A stimulus, and the window of clocks in which power is measured."""

    name: str
    stimulus: Stimulus
    start: int
    clocks: int
    events: Events  # events of the model in the whole run

    @property
    def events_inside(self) -> int:
        """Number of events in the window."""
        return self.inside(self.events)

    def inside(self, events: Events) -> int:
        """Return the number of given events in the window."""
        return int(np.count_nonzero((events["t"] >= self.start) & (events["t"] < self.start + self.clocks)))


def comparisons(config: ReadoutConfig, scenario: Scenario) -> int:
    """Return the strobes of all taxels in the window of a scenario (analog front end)."""
    window = slice(scenario.start, scenario.start + scenario.clocks)
    return int(strobes(config, scenario.stimulus)[window].sum())


def scenarios(config: ReadoutConfig, ticks: int = 30) -> list[Scenario]:
    """Return all scenarios for a readout; the texture scenario has a given number of sample ticks."""
    rest = closing_ticks(config)
    quiet = [_idle(config, rest)]
    if rest:  # the ticks of lone events: other activity of their taxels cancels out
        quiet.append(_idle(config, 0, min(2 * LONE_TICKS + 1, max(1, rest - 4))))
    return [*quiet, _lone(config), _saturated(config), _texture(config, ticks)]


def closing_ticks(config: ReadoutConfig) -> int:
    """Return the number of quiet ticks after which an open window is closed; 0 for encoders without closing window."""
    return ((1 << config.closing_levels_log2) - 1) * config.window_period if config.closes else 0


def _whole(name: str, config: ReadoutConfig, samples: NDArray[np.integer], lead: int) -> Scenario:
    """Return a scenario of samples; the first ``lead`` sample periods are not measured.

    The window begins and ends between two samples. It ends before the run, whose last edge masks all taxels and resets.
    """
    stimulus, events = _run(config, samples)
    period = config.clocks_per_sample
    return Scenario(name, stimulus, lead * period - (period + 1) // 2, (len(samples) - lead) * period, events)


def _run(config: ReadoutConfig, samples: NDArray[np.integer], spare: int = 0) -> tuple[Stimulus, Events]:
    """Return a stimulus and its events, extended beyond the last sample."""
    clocks = (len(samples) + spare) * config.clocks_per_sample
    stimulus = Stimulus.from_samples(config, samples, clocks=clocks)
    return stimulus, simulate(config, stimulus)


def texture_samples(config: ReadoutConfig, ticks: int) -> NDArray[np.int32]:
    """Return samples of the first embedded texture, shape (ticks, taxels), after the sensor has settled."""
    found = scan(config.rows, config.columns, config.sample_bits, 0)[TEXTURE_START:]
    return found[np.arange(ticks) % len(found)]


def _idle(config: ReadoutConfig, rest: int, ticks: int = 10) -> Scenario:
    """Return the idle scenario: constant samples and no pending request.

    The samples are slightly above zero, or zero for encoders that do not rest there. Windows are open after reset: they
    close within ``rest`` ticks, or during the measurement.
    """
    if rest > MAX_TO_CLOSE:
        raise InputError(f"windows take {rest} samples to close, more than {MAX_TO_CLOSE}; choose a shorter period")
    level = np.zeros((1, config.taxels), np.int32) if config.encoder.late else texture_samples(config, 1) % config.step
    name = CLOSING if rest < closing_ticks(config) else IDLE
    chosen = _whole(name, config, level.repeat(3 + rest + ticks, axis=0), 3 + rest)
    assert not len(chosen.events)
    return chosen


def _lone(config: ReadoutConfig) -> Scenario:
    """Return the scenario in which one taxel at a time sends an event while all others are quiet."""
    samples = np.zeros((2 * LONE_TICKS + 4, config.taxels), np.int32)
    order = np.arange(LONE_TICKS) * 7 % config.taxels if config.taxels % 7 else np.arange(LONE_TICKS) % config.taxels
    for number, taxel in enumerate(order):
        at = 3 + 2 * number
        if config.encoder.leaks:  # its reference leaks: it fires once, and rests before it would again
            samples[at, taxel] = 2 * config.step
        else:
            samples[at:, taxel] = config.step if samples[at - 1, taxel] <= 0 else -1
    chosen = _whole(LONE, config, samples, 3)
    if not chosen.events_inside:
        raise InputError("the window period is too short for a lone event; choose a longer one")
    return chosen


def _saturated(config: ReadoutConfig) -> Scenario:
    """Return the scenario with a link that is always busy: all samples are far from their references."""
    most = MAX_SATURATED + 64  # what follows the window is not played
    ticks = 2 + -(-min(config.full_scale // config.step * config.taxels, most) // config.clocks_per_sample)
    stimulus, events = _run(config, np.full((ticks, config.taxels), config.full_scale - 1, np.int32), spare=1)
    link = config.protocol
    breaks = np.flatnonzero(np.diff(events["t"]) > link.clocks_per_event + link.asynchronous)
    begins, ends = (events["t"][np.concatenate(at)] for at in (([0], breaks + 1), (breaks, [len(events) - 1])))
    longest = int(np.argmax(ends - begins))  # interval without a larger gap between events
    start = int(begins[longest]) + 8
    clocks = min(int(ends[longest]) - int(begins[longest]) - 16, MAX_SATURATED)
    if clocks < 8:
        raise InputError(f"resolution {config.resolution} is too low for a saturated stretch; choose a higher one")
    return Scenario(SATURATED, stimulus, start, clocks, events)


def _texture(config: ReadoutConfig, ticks: int) -> Scenario:
    """Return the texture scenario: a scan of the first embedded texture, without its first samples."""
    lead = 3
    samples = texture_samples(config, lead + ticks)
    samples = np.clip(samples - samples[0], -config.full_scale, config.full_scale - 1)
    chosen = _whole(TEXTURE, config, samples, lead)
    if not chosen.events_inside:
        raise InputError(f"no event in {ticks} samples of the texture; measure more of them")
    return chosen
