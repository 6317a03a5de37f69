"""Random stimuli, sinks and masks for tests."""

import dataclasses
import random
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.host import Host, walk
from eskin.model.config import ReadoutConfig
from eskin.model.links.link import ACK_QUANTA
from eskin.model.readout import Stimulus, simulate, state_at

Samples = NDArray[np.int64]
MARGIN = 60
"""Clocks of a run after its last event, in which the RTL must send nothing."""
LARGE = 512
"""Number of taxels from which on only a few taxels move in a scenario, so that the array comes to rest."""


def step(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return one step per taxel to a random level."""
    level = rng.integers(-config.full_scale, config.full_scale, config.taxels)
    level[0] = config.full_scale - 1  # at least one step causes an event at any resolution
    start = rng.integers(1, max(ticks // 2, 2), config.taxels)
    return np.where(np.arange(ticks)[:, None] >= start, level, 0)


def ramp(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return ramps through the whole range, rising or falling."""
    up = np.linspace(-config.full_scale, config.full_scale - 1, ticks).astype(np.int64)[:, None]
    return np.where(rng.random(config.taxels) < 0.5, up, up[::-1])


def sine(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return sines of random phase, frequency and amplitude."""
    phase = rng.random(config.taxels) * 2 * np.pi
    turns = rng.uniform(1, 4, config.taxels)
    amplitude = rng.uniform(0.05, 1, config.taxels) * (config.full_scale - 1)
    amplitude[0] = config.full_scale - 1
    angle = np.linspace(0, 2 * np.pi, ticks)[:, None] * turns + phase
    return np.rint(amplitude * np.sin(angle)).astype(np.int64)


def noise(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return a new random code for every sample and taxel."""
    return rng.integers(-config.full_scale, config.full_scale, (ticks, config.taxels))


def square(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return full-scale square waves of all taxels."""
    high = (np.arange(ticks) // max(ticks // 6, 1)) % 2 == 0
    return np.where(high, config.full_scale - 1, -config.full_scale)[:, None].repeat(config.taxels, axis=1)


def constant(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return a constant level for every taxel, near its thresholds or far from its thresholds."""
    near = config.step + rng.integers(-1, 2, config.taxels)
    far = rng.integers(-config.full_scale, config.full_scale, config.taxels)
    level = np.where(rng.random(config.taxels) < 0.5, near, far)
    level[0] = config.full_scale - 1
    return level[None, :].repeat(ticks, axis=0)


def together(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return signals that cross the same levels in the same clock in all taxels, with pauses."""
    walk = np.cumsum(rng.integers(-2, 3, max(ticks // 4, 1))) * config.step
    walk[[0, -1]] = 4 * config.step
    walk = np.clip(walk, -config.full_scale, config.full_scale - 1)
    return np.resize(walk.repeat(4), ticks)[:, None].repeat(config.taxels, axis=1)


def texture(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return a scan over an embedded photograph, starting at a random place."""
    from eskin.cocotb_tests.bench.textures import random_scan

    return random_scan(config, ticks, rng)


Maker = Callable[[ReadoutConfig, int, np.random.Generator], Samples]

STIMULI: dict[str, Maker] = {f.__name__: f for f in (step, ramp, sine, noise, square, constant, together, texture)}

SINK_PERIOD = 4096
"""Clocks, or edges of REQ, after which the pattern of a sink repeats."""


def _ready_random(rng: np.random.Generator) -> NDArray[np.uint8]:
    return (rng.random(SINK_PERIOD) < 0.6).astype(np.uint8)


def _ready_stuck(rng: np.random.Generator) -> NDArray[np.uint8]:
    ready = _ready_random(rng)
    start = int(rng.integers(20, 200))
    ready[start : start + 600] = 0
    return ready


READY: dict[str, Callable[[np.random.Generator], NDArray[np.uint8]]] = {
    "always": lambda rng: np.ones(SINK_PERIOD, np.uint8),
    "random": _ready_random,
    "slow": lambda rng: (np.arange(SINK_PERIOD) % 7 == 6).astype(np.uint8),
    "stuck": _ready_stuck,
}
"""Sinks of the stream link: event_ready per clock."""


def ack_delays(sink: str, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the delays of a four-phase receiver, shape (4096,), in 1/8 clock."""
    high = {"always": 2, "random": 60, "slow": 200, "stuck": 40}[sink]
    delays = rng.integers(1, high, SINK_PERIOD)
    if sink == "stuck":
        delays[rng.integers(2, 8)] = 600 * ACK_QUANTA + 3
    return delays + (delays % ACK_QUANTA == 0)


def masks(config: ReadoutConfig, clocks: int, changes: int, rng: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Return clocks, shape (changes + 1,), and random masks, shape (changes + 1, taxels)."""
    at = np.unique(np.concatenate([[0], rng.integers(1, max(clocks, 2), changes)]))
    mask = rng.random((len(at), config.taxels)) < 0.7
    mask[-1] = True
    return at.astype(np.int64), mask


@dataclass(frozen=True)
class Scenario:
    """A test run: name, stimulus, and number of outstanding requests at its end."""

    name: str
    stimulus: Stimulus
    outstanding: int  # requests waiting in taxels or latch at the end of the run; 0 if all have left
    host: Host | None = None  # what sets the registers meanwhile


CUT_OFF, FEW, HOST = "noise, cut off", "few taxels", "host"
HOST_TICKS = 1600
"""Sample ticks of the run with a host, of 6 clocks on average: a write takes 200 clocks."""


def few(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> Samples:
    """Return a random level of two to eight steps, at most full scale, for every sample and taxel."""
    return np.minimum(rng.integers(2, 9, (ticks, config.taxels)) * config.step, config.full_scale - 1)


def _more(config: ReadoutConfig) -> dict[str, Maker]:
    cut_off: dict[str, Maker] = {CUT_OFF: noise}
    hosted = {HOST: walk} if config.registers != "none" else {}
    return cut_off | ({FEW: few} if config.taxels >= LARGE else {}) | hosted


def scenario_count(config: ReadoutConfig) -> int:
    """Return the number of scenarios that ``scenarios`` yields."""
    return len(STIMULI) + len(_more(config))


def scenarios(config: ReadoutConfig, seed: int, ticks: int = 40, limit: int = 3000) -> Iterator[Scenario]:
    """Yield every kind of stimulus with a sink and a mask, and a noise run interrupted by a reset.

    Every stimulus has another sink for every seed, and half of them switch taxels off and on during the run. A run ends
    ``MARGIN`` clocks after its last event, or at the latest after ``limit`` clocks. Large arrays have an additional run
    in which eight taxels change and then rest, and readouts with registers a longer one in which a host sets them.
    """
    sinks = list(READY)
    for number, (name, make) in enumerate([*STIMULI.items(), *_more(config).items()]):
        rng = np.random.default_rng([seed, zlib.crc32(config.to_json().encode()), number])
        sink = sinks[(number + seed) % len(sinks)]
        masked = bool((number + seed) // len(sinks) % 2)
        samples = make(config, HOST_TICKS if name == HOST else ticks, rng)
        if config.frontend == "analog" and number % 2:  # an analog signal has offsets and may exceed full scale
            samples = samples * 5 // 4 + rng.integers(-config.step, config.step + 1, config.taxels)
        samples = np.concatenate([samples, np.zeros((1, config.taxels), np.int64)])  # and rest
        clock = np.cumsum(rng.integers(1, 12, len(samples))) - 1
        at, mask = masks(config, int(clock[-1]) * 2 // 3, 6 if masked else 0, rng)
        if not masked:
            mask[:] = True
        if name == FEW:
            mask[:] = np.isin(np.arange(config.taxels), rng.choice(config.taxels, 8, replace=False))
        stimulus = Stimulus(
            samples=samples.astype(np.int32),
            sample_clock=clock.astype(np.int64),
            clocks=100 * limit,
            enable_clock=at,
            enable=mask,
            ready=READY[sink](rng),
            ack_delay=ack_delays(sink, rng),
        )
        title = f"{name}, sink {sink}{', masked' if masked else ''}"
        if name == HOST:
            stimulus = dataclasses.replace(stimulus, clocks=int(clock[-1]))
            host = Host.play(config, stimulus, random.Random(number + seed))
            yield Scenario(title, stimulus, outstanding(config, host.run.stimulus), host)
            continue
        times = simulate(config, stimulus)["t"]
        if name != CUT_OFF:
            clocks = min(max([*times[-1:].tolist(), int(clock[-1]), int(at[-1])]) + MARGIN, limit)
        else:
            clocks = _busy_clock(config, stimulus, times[times < limit])
        stimulus = dataclasses.replace(stimulus, clocks=clocks)
        yield Scenario(title, stimulus, outstanding(config, stimulus))


def settled(config: ReadoutConfig, samples: NDArray[np.integer[Any]]) -> Stimulus:
    """Return a stimulus of a scan, extended until the model sends no more events.

    A leaky taxel may fire forever on the last sample. The run therefore ends after 5,000 more clocks, or for arrays
    larger than 12 x 16 after 26 clocks per taxel.
    """
    limit = max(5000, 26 * config.taxels)
    end = len(samples) * config.clocks_per_sample
    stimulus = Stimulus.from_samples(config, samples, clocks=end + limit)
    last = int(simulate(config, stimulus)["t"][-1:].max(initial=0))
    return dataclasses.replace(stimulus, clocks=min(max(end, last + MARGIN), end + limit))


def outstanding(config: ReadoutConfig, stimulus: Stimulus, clock: int | None = None) -> int:
    """Return the number of requests that wait in taxels and latch just before a clock."""
    state = state_at(config, stimulus, stimulus.clocks if clock is None else clock)
    return int(state.pending.sum()) + state.latch_columns.bit_count()


def _busy_clock(config: ReadoutConfig, stimulus: Stimulus, times: NDArray[np.int64]) -> int:
    """Return a clock in the second half of a run, just after an event, in which requests wait."""
    for time in times[len(times) // 2 :].tolist():
        if outstanding(config, stimulus, time + 1):
            return int(time) + 1
    return int(times[-1]) + 1
