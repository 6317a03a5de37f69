"""Random configurations and stimuli from a seed, with optional fixed parts.

Every part has its own stream of random numbers, so that setting a part, for example to simplify a failure, does not
change the others.
"""

import dataclasses
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.stimuli import READY, ack_delays
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.encoders.fields import SETTABLE, most_shift
from eskin.model.readout import ANALOG_RANGE, Stimulus

MOST_TAXELS = 64
SINKS = tuple(READY)
SIGNALS = ("noise", "walk", "square", "hold", "near", "rare")
GAPS = (1, 3, 12, 70, 300)
"""Largest numbers of clocks between two sample ticks."""

FIELDS = frozenset(field.name for field in dataclasses.fields(ReadoutConfig))
MOST_GAP = 10**6
SIZES = ("rows", "columns", "sample_bits")
"""Fields that determine the ranges of other fields."""

PARTS = ("signal", "gap", "sink", "masks", "share")
Set = Mapping[str, Any]


@dataclass(frozen=True)
class Draw:
    """A random run; a shorter run is a prefix of a longer one."""

    seed: int
    clocks: int = 400
    run: int = 0  # number of the run of one configuration
    # parts that are not drawn: fields of the configuration, ``signal``, ``gap``, ``sink``, ``masks`` (how often the
    # mask changes in a thousand clocks), ``share`` (of the taxels that a mask enables, 0.7 if not set)
    set: Set = field(default_factory=dict)
    most_taxels: int = MOST_TAXELS

    def rng(self, part: str) -> np.random.Generator:
        """Return the random generator for a part of the stimulus."""
        return np.random.default_rng([self.seed, self.run, zlib.crc32(part.encode())])

    def _drawn(self, part: str, values: Any) -> Any:
        """Return the fixed value of a part, or a random choice from given values."""
        if part in self.set:
            return self.set[part]
        rng = np.random.default_rng([self.seed, zlib.crc32(part.encode())]) if part in FIELDS else self.rng(part)
        value = rng.choice(values)
        return value.item() if isinstance(value, np.generic) else value

    @property
    def config(self) -> ReadoutConfig:
        """Random configuration."""
        ReadoutConfig.from_dict({"resolution": 1} | {name: self.set[name] for name in SIZES if name in self.set})
        sides = [1, 1, 2, 3, 4, 5, 7, 8, 16, 33]
        rows = self._drawn("rows", [side for side in sides if side <= self.most_taxels])
        columns = self._drawn("columns", [side for side in sides if rows * side <= max(rows, self.most_taxels)])
        encoding = self._drawn("encoding", list(registry.NAMES))
        bits = self._drawn("sample_bits", [3, 4, 5, 6, 8, 12, 12, 16])
        fields = {
            "rows": rows,
            "columns": columns,
            "encoding": encoding,
            "sample_bits": bits,
            "resolution": self._drawn("resolution", np.arange(1, bits - 1)),
            "decide_every": self._drawn("decide_every", ["clock", "clock", "sample"]),
            "closing_shift": self._drawn("closing_shift", np.arange(6)),
            "window_period": self._drawn("window_period", [1, 2, 3, 5, 16, 64]),
            "leak_shift": self._drawn("leak_shift", np.arange(1, 9)),
            "leak_period": self._drawn("leak_period", [1, 2, 3, 7, 20, 63]),
            "fraction_bits": self._drawn("fraction_bits", np.arange(11)),
            "link": self._drawn("link", ["stream", "four_phase"]),
            "frontend": self._drawn("frontend", ["digital", "analog"]),
            "reset": self._drawn("reset", ["sync", "async"]),
            "registers": self._drawn("registers", ["none", "none", "spi"]),
            "fields": self._drawn("fields", ["own", "own", "neighbours", "both", "listed"]),
        }
        if "registers" not in self.set and registry.named(encoding).leaks and fields["leak_period"] < rows:
            fields["registers"] = "none"  # with registers, a leak period has at least one tick per row
        settable = np.random.default_rng([self.seed, 0, zlib.crc32(b"settable")]).choice([False, True])  # in all runs
        if fields["registers"] == "spi" and settable and "fields" not in self.set:
            fields["fields"] = SETTABLE
        if fields["fields"] == "listed":
            fields["fields"] = self._listed(rows * columns)
        if fields["registers"] == "spi" and registry.named(encoding).windowed and "closing_shift" not in self.set:
            room = fields["sample_bits"] - 2 - fields["resolution"]
            fields["closing_shift"] = min(fields["closing_shift"], room)  # of every resolution that a host sets
        config = ReadoutConfig.from_dict(fields)
        if "reference_reset" in self.set:
            return config.replace(reference_reset=self.set["reference_reset"])  # up to 2**24 levels take a while
        levels = np.arange(config.encoder.lowest(config), config.full_scale, config.grid)
        at_zero = np.zeros(len(levels), np.int64)
        return config.replace(reference_reset=self._drawn("reference_reset", np.concatenate([levels, at_zero])))

    def _listed(self, taxels: int) -> list[dict[str, Any]]:
        """Return a random receptive field for every taxel; several taxels are off."""
        rng = np.random.default_rng([self.seed, zlib.crc32(b"listed")])
        sizes = np.maximum(rng.integers(0, 7, taxels), np.arange(taxels) == 0)
        return [
            {"taxels": rng.integers(0, taxels, n).tolist(), "shift": int(rng.integers(0, most_shift(n) + 1))}
            for n in sizes.tolist()
        ]

    @property
    def mean_gap(self) -> float:
        """Mean number of clocks between sample ticks."""
        return (self._drawn("gap", GAPS) + 1) / 2

    @property
    def stimulus(self) -> Stimulus:
        """Random stimulus for the configuration."""
        config, clocks = self.config, self.clocks
        gap = self._drawn("gap", GAPS)
        signal = self._drawn("signal", SIGNALS)
        sink = self._drawn("sink", SINKS)
        masks = self._drawn("masks", [0, 0, 3, 100])
        share = self.set.get("share", 0.7)
        right = isinstance(gap, int) and isinstance(masks, int) and isinstance(share, int | float)
        right = right and 1 <= gap <= MOST_GAP and 0 <= masks <= 1000 and 0 <= share <= 1
        if signal not in SIGNALS or sink not in SINKS or not right:
            raise InputError(
                f"signal must be one of {', '.join(SIGNALS)}, sink one of {', '.join(SINKS)}, gap in 1..{MOST_GAP}, "
                f"masks in 0..1000 and share in 0..1, not {signal}, {sink}, {gap}, {masks}, {share}"
            )
        at = np.cumsum(self.rng("ticks").integers(1, gap + 1, clocks)) - 1
        at = at[at < clocks]
        changes = np.flatnonzero(self.rng("changes").random(clocks) < masks / 1000)
        enable_clock = np.unique(np.concatenate([[0], changes])).astype(np.int64)
        enable = self.rng("mask").random((len(enable_clock), config.taxels)) < share
        enable |= masks == 0
        return Stimulus(
            samples=self._samples(config, signal, len(at)),
            sample_clock=at.astype(np.int64),
            clocks=clocks,
            enable_clock=enable_clock,
            enable=enable,
            ready=READY[sink](self.rng("sink")),
            ack_delay=ack_delays(sink, self.rng("sink")),
        )

    def _samples(self, config: ReadoutConfig, signal: str, ticks: int) -> NDArray[np.int32]:
        """Return codes of all ticks and taxels; analog signals may exceed full scale."""
        scale = config.full_scale * (ANALOG_RANGE if config.frontend == "analog" else 1)
        samples = _MAKERS[signal](config, ticks, self.rng("samples"))
        if config.frontend == "analog":
            offset = self.rng("offset").integers(-config.step, config.step + 1)
            samples = samples * int(self.rng("range").choice([1, 2, ANALOG_RANGE])) + offset
        return np.clip(samples, -scale, scale - 1).astype(np.int32)


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
    zip(SIGNALS, (_noise, _walk, _square, _hold, _near, _rare), strict=True)
)
