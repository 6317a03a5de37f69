"""Disturbances of scans, signals, comparators and events, for robustness tests and training.

Each disturbance changes the scene (the movement of the array over the texture), the signals at the outputs of the
analog front ends, the comparators, or the events, always before events are counted. Random disturbances draw from a
generator.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import EVENT_DTYPE, Events, taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import Dataset, Texture
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.scan import Signals, quantise
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.record import Tick, record, recorded, said_of
from eskin.snn.data.scans import ScanData, collect

Level = Literal["scene", "signals", "comparators", "events"]
Generator = np.random.Generator

SLOW_HZ = 97.0
"""Bandwidth of an AFE that passes only the frequencies of the textures (docs/results/power.md)."""

HOT_HZ = 1000.0
"""Events per second of a hot taxel."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance with its test strengths."""

    level: Level
    """Level that it changes."""
    unit: str
    help: str
    strengths: tuple[float, ...]
    """Strengths in rising order, without the clean scan."""
    apply: Callable[[Draft, float, Generator], None]
    """(Draft, strength, Generator) -> None: changes the draft of a recording in place."""


DISTURBANCES: dict[str, Disturbance] = {}
"""Disturbances by name; a recording meets the disturbances of a level in this order.

A new disturbance comes last in this file, because its place seeds its random numbers.
"""


def disturbance(name: str, level: Level, unit: str, help: str, *strengths: float) -> Callable[[Any], Any]:
    """Return a decorator that adds a function to DISTURBANCES."""

    def add(apply: Any) -> Any:
        DISTURBANCES[name] = Disturbance(level, unit, help, strengths, apply)
        return apply

    return add


@dataclass
class Draft:
    """A scan under construction, from the scene to the events; disturbances change each stage."""

    config: ReadoutConfig
    scan: PhysicalScan
    image: NDArray[Any]
    """Shape (height, width)."""
    height: float = 0.0
    """Position of the array on the image, from 0 (top) to 1; for vertical movements, from the left side."""
    quarter_turns: int = 0
    """Direction of the movement, counter-clockwise from left to right."""
    signals: Signals = field(default_factory=lambda: np.zeros((0, 0)))
    """Signals in full scales; one full scale is 1 V. Shape (ticks, taxels)."""
    noise_v: float = 0.0
    offset_v: float = 0.0
    """Noise of every comparator, rms per sample, and standard deviation of the comparators' offsets."""
    generator: Generator | None = None
    """For the comparators."""
    events: Events = field(default_factory=lambda: np.zeros(0, EVENT_DTYPE))
    duration: int = 0
    """Clocks."""


# -- scene -------------------------------------------------------------------------------------------


@disturbance("speed", "scene", "", "factor of the scan speed", 0.5, 0.8, 1.2, 1.5)
def _speed(draft: Draft, strength: float, _: Generator) -> None:
    draft.scan = dataclasses.replace(draft.scan, speed_m_per_s=draft.scan.speed_m_per_s * strength)


@disturbance("height", "scene", "", "position of the array on the texture, top 0 to bottom 1", 0.5, 1.0)
def _height(draft: Draft, strength: float, _: Generator) -> None:
    draft.height = strength


@disturbance("direction", "scene", "degrees", "direction of the movement; the array is not rotated", 90.0, 180.0, 270.0)
def _direction(draft: Draft, strength: float, _: Generator) -> None:
    if strength % 90:
        raise InputError(f"a direction is a multiple of 90 degrees, not {strength:g}")
    draft.quarter_turns = round(strength / 90) % 4


@disturbance("rotation", "scene", "degrees", "rotation of the texture under the array", 15.0, 45.0, 90.0, 180.0)
def _rotation(draft: Draft, strength: float, _: Generator) -> None:
    if strength % 90 == 0:
        draft.image = np.ascontiguousarray(np.rot90(draft.image, round(strength / 90)))
        return
    from scipy.ndimage import rotate

    draft.image = rotate(np.asarray(draft.image, float), strength, reshape=False, order=1, mode="mirror")


def _scene_signals(draft: Draft) -> Signals:
    """Return the signals of the scene for a movement to the right, up, left or down."""
    config, turns = draft.config, draft.quarter_turns
    image = np.rot90(draft.image, -turns)  # rotate an upward movement to the right
    rows, columns = (config.columns, config.rows) if turns % 2 else (config.rows, config.columns)
    turned = config.replace(rows=rows, columns=columns)
    place = draft.height if turns < 2 else 1 - draft.height
    start_row = draft.scan.start_rows(turned, image.shape, 2)[1] * place
    signals = draft.scan.signals(turned, image, start_row).reshape(-1, rows, columns)
    return np.rot90(signals, turns, axes=(1, 2)).reshape(-1, config.taxels)


# -- signals -----------------------------------------------------------------------------------------


@disturbance("noise", "signals", "V", "AFE output noise, rms", 0.001, 0.005, 0.01, 0.02)
def _noise(draft: Draft, strength: float, generator: Generator) -> None:
    draft.signals = noisy(draft.signals, strength, generator)


def noisy(signals: Signals, noise_v: float, generator: Generator, pole: float | None = None) -> Signals:
    """Return signals with additive noise of a given rms in full scales, white or low-pass filtered.

    - ``signals``: shape (ticks, taxels).
    - ``pole``: its frequency by the sample rate.
    """
    from scipy.signal import lfilter

    noise = generator.normal(0.0, noise_v, signals.shape)
    if pole is not None:
        kept = math.exp(-2 * math.pi * pole)
        noise[1:] *= math.sqrt(1 - kept**2)
        noise = lfilter([1.0], [1.0, -kept], noise, axis=0)
    return signals + noise


@disturbance("gain", "signals", "", "factor of all signals", 0.7, 0.9, 1.2, 1.5)
def _gain(draft: Draft, strength: float, _: Generator) -> None:
    draft.signals = draft.signals * strength


@disturbance("offset", "signals", "V", "offset of every taxel, deviation", 0.05, 0.1)
def _offset(draft: Draft, strength: float, generator: Generator) -> None:
    draft.signals = draft.signals + generator.normal(0.0, strength, draft.signals.shape[1])


@disturbance("mismatch", "signals", "", "gain of every taxel, deviation", 0.1, 0.2, 0.4)
def _mismatch(draft: Draft, strength: float, generator: Generator) -> None:
    draft.signals = draft.signals * np.maximum(1 + generator.normal(0.0, strength, draft.signals.shape[1]), 0.0)


# -- comparators -------------------------------------------------------------------------------------


@disturbance("comparator-noise", "comparators", "V", "noise of every comparator, rms", 0.005, 0.01, 0.02)
def _comparator_noise(draft: Draft, strength: float, generator: Generator) -> None:
    draft.noise_v, draft.generator = strength, generator


@disturbance("comparator-offset", "comparators", "V", "offset of every comparator, deviation", 0.01, 0.02)
def _comparator_offset(draft: Draft, strength: float, generator: Generator) -> None:
    draft.offset_v, draft.generator = strength, generator


def compare(config: ReadoutConfig, signals: Signals, noise_v: float, offset_v: float, generator: Generator) -> Events:
    """Return the events of LCS taxels with non-ideal comparators.

    Every sample and comparator (above, below) has independent noise, and every comparator an offset. A taxel sends at
    most one event a clock; the arbiter is left out, which delays events by microseconds.
    """
    if config.encoding != "lcs":
        raise InputError(f"comparators with noise and offset are only modelled for lcs, not for {config.encoding}")
    codes = quantise(signals, config.sample_bits)[0].astype(np.float64)
    shape, full = codes.shape, config.full_scale
    errors = [
        full * (generator.normal(0.0, noise_v, shape) + generator.normal(0.0, offset_v, shape[1])) for _ in range(2)
    ]
    counts = _cross(codes, errors[0], errors[1], config.step, config.clocks_per_sample)
    tick, taxel = np.nonzero(counts)
    many = np.abs(counts[tick, taxel])
    events = np.empty(int(many.sum()), EVENT_DTYPE)
    within = np.arange(len(events)) - np.repeat(np.cumsum(many) - many, many)
    events["t"] = np.repeat(tick, many) * config.clocks_per_sample + within
    events["y"], events["x"] = np.divmod(np.repeat(taxel, many), config.columns)
    events["p"] = np.repeat(counts[tick, taxel] > 0, many)
    return np.sort(events, order="t", kind="stable")


@njit(cache=True)
def _cross(codes: Any, above: Any, below: Any, step: float, cap: int) -> Any:
    """Return the signed number of steps of every taxel at every sample, at most ``cap``."""
    counts = np.zeros(codes.shape, np.int64)
    for j in range(codes.shape[1]):
        u = 0.0
        for i in range(codes.shape[0]):
            for _ in range(cap):
                if codes[i, j] + above[i, j] - u >= step:
                    u += step
                    counts[i, j] += 1
                elif codes[i, j] + below[i, j] - u < -step:
                    u -= step
                    counts[i, j] -= 1
                else:
                    break
    return counts


# -- events ------------------------------------------------------------------------------------------


def _some_taxels(draft: Draft, part: float, generator: Generator) -> NDArray[np.int64]:
    return generator.permutation(draft.config.taxels)[: round(part * draft.config.taxels)]


@disturbance("dead", "events", "", "share of the taxels that send no events", 0.05, 0.1, 0.2, 0.4)
def _dead(draft: Draft, strength: float, generator: Generator) -> None:
    dead = _some_taxels(draft, strength, generator)
    draft.events = draft.events[~np.isin(taxel_of(draft.events, draft.config), dead)]


@disturbance("hot", "events", "", "share of the taxels that send 1000 additional events/s", 0.05, 0.2)
def _hot(draft: Draft, strength: float, generator: Generator) -> None:
    hot = _some_taxels(draft, strength, generator)
    number = generator.poisson(HOT_HZ * draft.duration / draft.config.clock_hz, len(hot))
    more = np.empty(int(number.sum()), EVENT_DTYPE)
    more["t"] = generator.integers(0, draft.duration, len(more))
    more["y"], more["x"] = np.divmod(np.repeat(hot, number), draft.config.columns)
    more["p"] = generator.random(len(more)) < 0.5 if draft.config.has_polarity else True
    draft.events = _in_order(np.concatenate((draft.events, more)))


@disturbance("lost", "events", "", "share of lost events", 0.1, 0.3, 0.5)
def _lost(draft: Draft, strength: float, generator: Generator) -> None:
    draft.events = draft.events[generator.random(len(draft.events)) >= strength]


@disturbance("jitter", "events", "s", "time of every event, deviation", 0.001, 0.004)
def _jitter(draft: Draft, strength: float, generator: Generator) -> None:
    events = draft.events.copy()
    moved = np.rint(generator.normal(0.0, strength * draft.config.clock_hz, len(events))).astype(np.int64)
    events["t"] = np.clip(events["t"] + moved, 0, draft.duration - 1)
    draft.events = _in_order(events)


@disturbance("late", "events", "s", "delay from the touch to the start of the recording", 0.01, 0.05)
def _late(draft: Draft, strength: float, _: Generator) -> None:
    events = draft.events[draft.events["t"] >= round(strength * draft.config.clock_hz)].copy()
    events["t"] -= round(strength * draft.config.clock_hz)
    draft.events = events


@disturbance("short", "events", "s", "duration of the touch", 0.05, 0.1, 0.2)
def _short(draft: Draft, strength: float, _: Generator) -> None:
    draft.events = draft.events[draft.events["t"] < round(strength * draft.config.clock_hz)]


@disturbance("slow-noise", "signals", "V", "AFE output noise below 97 Hz, rms", 0.005, 0.01, 0.02)
def _slow_noise(draft: Draft, strength: float, generator: Generator) -> None:
    draft.signals = noisy(draft.signals, strength, generator, SLOW_HZ / draft.config.sample_rate_hz)


def _in_order(events: Events) -> Events:
    return events[np.argsort(events["t"], kind="stable")]


def check_strength(name: str, strength: float) -> None:
    """Check that a disturbance exists and its strength is valid."""
    if name not in DISTURBANCES:
        raise InputError(f"disturbances are {', '.join(DISTURBANCES)}, not {name!r}")
    if not (math.isfinite(strength) and strength >= 0):
        raise InputError(f"the strength of {name} must be a number from 0, not {strength!r}")


TRAINING: dict[str, tuple[float, float, float]] = {
    "speed": (0.3, 0.8, 1.25),
    "direction": (0.6, 0.0, 360.0),
    "rotation": (0.4, 0.0, 360.0),
    "noise": (0.5, 0.0, 0.015),
    "gain": (0.5, 0.8, 1.25),
    "mismatch": (0.5, 0.0, 0.2),
    "dead": (0.5, 0.0, 0.3),
    "lost": (0.3, 0.0, 0.3),
}
"""Random disturbances of training scans: probability, and range of the strength."""


def draw_strengths(generator: Generator) -> dict[str, float]:
    """Return random strengths of randomly chosen disturbances for a training scan."""
    found = {}
    for name, (probability, low, high) in TRAINING.items():
        drawn, strength = generator.random() < probability, float(generator.uniform(low, high))
        if name == "direction":
            strength = 90.0 * (strength // 90)
        if drawn:
            found[name] = strength
    return found


def disturbed_dataset(
    dataset: Dataset,
    scan: PhysicalScan,
    config: ReadoutConfig,
    bins: BinConfig,
    count: int,
    progress: Tick | None = None,
) -> ScanData:
    """Return the event counts of all textures: one clean scan, then ``count`` disturbed scans at random heights."""
    recordings = []
    for number, texture in enumerate(dataset):
        recordings.append(record(texture, dataset.name, scan, config))
        for repeat in range(count):
            generator = np.random.default_rng([number, repeat])
            height, strengths = float(generator.random()), draw_strengths(generator)
            recordings.append(
                record_disturbed(texture, dataset.name, scan, config, strengths, generator, height=height)
            )
            if progress is not None:
                progress()
    return collect(recordings, bins, dataset.class_names)


def record_disturbed(
    texture: Texture,
    dataset_name: str,
    scan: PhysicalScan,
    config: ReadoutConfig,
    strengths: Mapping[str, float],
    generator: Generator,
    *,
    height: float = 0.0,
) -> Recording:
    """Return the events of a scan of a texture under disturbances.

    - ``texture``, ``dataset_name``, ``scan``, ``config``: same as for ``eskin.snn.data.record.record``; without a
      disturbance the events are equal.
    - ``strengths``: strength by name of DISTURBANCES.
    - ``height``: position of the array on the texture, unless ``strengths`` give it.
    """
    for name, strength in strengths.items():
        check_strength(name, strength)
    draft = Draft(config, scan, texture.load(), height)

    def disturb(level: Level) -> None:
        for name, one in DISTURBANCES.items():
            if name in strengths and one.level == level:
                one.apply(draft, strengths[name], generator)

    disturb("scene")
    draft.signals = _scene_signals(draft)
    disturb("signals")
    disturb("comparators")
    draft.duration = len(draft.signals) * config.clocks_per_sample
    if draft.generator is None:
        draft.events = recorded(config, quantise(draft.signals, config.sample_bits)[0], {}).events
    else:
        draft.events = compare(config, draft.signals, draft.noise_v, draft.offset_v, draft.generator)
        draft.events = draft.events[draft.events["t"] < draft.duration]
    disturb("events")
    metadata = said_of(texture, dataset_name, scan) | {"disturbed": dict(strengths), "source": "model"}
    return Recording(draft.events, config, draft.duration, metadata=metadata)
