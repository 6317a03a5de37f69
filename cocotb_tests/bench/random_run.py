"""Random runs of readouts: a configuration, and a stimulus that a seed and few parameters determine."""

from __future__ import annotations

import dataclasses
import json
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.stimuli import READY, ack_delays
from eskin.model.cases import configurations
from eskin.model.config import ReadoutConfig
from eskin.model.readout import ANALOG_RANGE, Stimulus

if TYPE_CHECKING:  # for tests only, so imported by the function that needs it
    from hypothesis import strategies as st

SINKS = tuple(READY)
SIGNALS = ("hold", "noise", "walk", "square", "near", "rare")
GAPS = (1, 3, 12, 70, 300)
MASKS = (0, 3, 100)
RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, 2**64),
    "clocks": (1, 10**9),
    "gap": (1, 10**6),
    "masks": (0, 1000),
    "share": (0, 1),
}

MAX_SAMPLES = 4_000_000
"""Largest number of samples of a drawn run, over all taxels."""


@dataclass(frozen=True)
class RandomRun:
    """A run with a random stimulus; a shorter run is a prefix of a longer one."""

    config: ReadoutConfig
    seed: int = 0
    clocks: int = 400
    signal: str = "noise"
    gap: int = 1  # largest number of clocks between two sample ticks
    sink: str = "always"
    masks: int = 0  # mean number of changes of the mask in 1000 clocks; 0 leaves all taxels on
    share: float = 0.7  # of the taxels that a mask enables
    noisy: bool = False  # whether the comparators of an analog front end decide at random

    def __post_init__(self) -> None:
        for name, values in (("signal", SIGNALS), ("sink", SINKS)):
            if (value := getattr(self, name)) not in values:
                raise InputError(f"{name} must be one of {', '.join(values)}, not {value!r}")
        for name, (low, high) in RANGES.items():
            value, kinds = getattr(self, name), (int, float) if name == "share" else (int,)
            if type(value) not in kinds or not low <= value <= high:
                raise InputError(f"{name} must be in {low}..{high}, not {value!r}")

    def to_json(self) -> str:
        """Return the run as one line of JSON, without defaults."""
        standard = ReadoutConfig().to_dict()
        config = {name: value for name, value in self.config.to_dict().items() if standard.get(name) != value}
        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "config"}
        return json.dumps({"config": config} | own)

    @classmethod
    def from_json(cls, text: str) -> RandomRun:
        """Return the run of a line of JSON."""
        try:
            fields = json.loads(text)
            return cls(**fields | {"config": ReadoutConfig.from_dict(fields["config"])})
        except (ValueError, TypeError, KeyError, RecursionError) as wrong:
            if isinstance(wrong, InputError):
                raise
            raise InputError(f"a run is a line of JSON, as a difference is printed: {wrong}") from None

    def rng(self, part: str) -> np.random.Generator:
        """Return the random numbers of a part of the stimulus."""
        return np.random.default_rng([self.seed, zlib.crc32(part.encode())])

    @property
    def stimulus(self) -> Stimulus:
        """Stimulus of the run."""
        config, clocks = self.config, self.clocks
        at = np.cumsum(self.rng("ticks").integers(1, self.gap + 1, clocks)) - 1
        at = at[at < clocks]
        changes = np.flatnonzero(self.rng("changes").random(clocks) < self.masks / 1000)
        enable_clock = np.unique(np.concatenate([[0], changes])).astype(np.int64)
        enable = self.rng("mask").random((len(enable_clock), config.taxels)) < self.share
        enable |= self.masks == 0
        decisions = None
        if self.noisy and config.frontend == "analog":
            decisions = self.rng("decisions").integers(0, 4, (clocks, config.taxels), dtype=np.uint8)
            decisions &= 3 if config.has_polarity else 1
        return Stimulus(
            samples=self._samples(len(at)),
            sample_clock=at.astype(np.int64),
            clocks=clocks,
            enable_clock=enable_clock,
            enable=enable,
            ready=READY[self.sink](self.rng("sink")),
            ack_delay=ack_delays(self.sink, self.rng("sink")),
            decisions=decisions,
        )

    def _samples(self, ticks: int) -> NDArray[np.int32]:
        """Return codes of all ticks and taxels; analog signals may exceed full scale."""
        config = self.config
        scale = config.full_scale * (ANALOG_RANGE if config.frontend == "analog" else 1)
        samples = _MAKERS[self.signal](config, ticks, self.rng("samples"))
        if config.frontend == "analog":
            offset = self.rng("offset").integers(-config.step, config.step + 1)
            samples = samples * int(self.rng("range").choice([1, 2, ANALOG_RANGE])) + offset
        return np.clip(samples, -scale, scale - 1).astype(np.int32)


def runs(
    clocks: int, most_taxels: int = 64, noisy: bool = False, **axes: Iterable[Any]
) -> st.SearchStrategy[RandomRun]:
    """Return a Hypothesis strategy over random runs of all legal configurations; ``axes`` limits their fields.

    A run has at most ``clocks`` clocks, and so many that its samples fit into memory.
    """
    from hypothesis import strategies as st

    @st.composite
    def drawn(draw: st.DrawFn) -> RandomRun:
        config, gap = draw(configurations(most_taxels, **axes)), draw(st.sampled_from(GAPS))
        most = MAX_SAMPLES * (gap + 1) // (2 * config.taxels)
        return RandomRun(
            config=config,
            seed=draw(st.integers(0, 2**16)),
            clocks=draw(st.integers(1, min(clocks, most))),
            signal=draw(st.sampled_from(SIGNALS)),
            gap=gap,
            sink=draw(st.sampled_from(SINKS)),
            masks=draw(st.sampled_from(MASKS)),
            noisy=noisy and config.frontend == "analog" and draw(st.booleans()),
        )

    return drawn()


def _noise(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    return rng.integers(-config.full_scale, config.full_scale, (ticks, config.taxels), dtype=np.int32)


def _walk(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    """Return random walks in steps of up to two D, folded at the ends of the scale."""
    steps = rng.integers(-2 * config.step, 2 * config.step + 1, (ticks, config.taxels), dtype=np.int32)
    turn = 4 * config.full_scale
    place = np.cumsum(steps, axis=0, dtype=np.int64) % turn
    return np.abs(place - turn // 2) - config.full_scale


def _square(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    high = (np.arange(ticks) // int(rng.integers(1, 40))) % 2 == 0
    return np.where(high, config.full_scale - 1, -config.full_scale)[:, None].repeat(config.taxels, axis=1)


def _hold(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    return np.repeat(_noise(config, ticks // 50 + 1, rng), 50, axis=0)[:ticks]


def _near(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    """Return codes next to the thresholds around the reference's reset value."""
    steps, beside = np.divmod(rng.integers(0, 15, (ticks, config.taxels)), 3)
    return config.reference_reset + config.step * (steps - 2) + beside - 1


def _rare(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.integer]:
    """Return mostly constant codes in which single taxels move occasionally."""
    moves = np.where(rng.random((ticks, config.taxels)) < 0.3 / config.taxels, 1, 0)
    return np.cumsum(moves, axis=0) * 3 * config.step % config.full_scale


_MAKERS: dict[str, Callable[[ReadoutConfig, int, np.random.Generator], NDArray[np.integer]]] = dict(
    zip(SIGNALS, (_hold, _noise, _walk, _square, _near, _rare), strict=True)
)
