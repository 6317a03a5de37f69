"""Comparators of the analog front end in the harness, with offset, noise and hysteresis."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig

FRACTION_BITS, SIGNAL_BITS_MORE = 4, 6
"""Bits of an analog signal below the LSB of a sample, and bits of an analog signal in addition to those of a sample."""


@dataclass(frozen=True)
class Comparators:
    """Comparators with non-ideal parameters in 1/16 code; ideal by default."""

    offset: NDArray[np.int64] | None = None  # of the comparators above and below, shape (2, taxels)
    noise: int = 0  # largest value of a uniform noise, drawn anew for every answer
    hysteresis: int = 0  # distance by which a signal must return before a high comparator falls
    seed: int = 1  # seed of the noise, not 0
    holds: bool = False  # hold the last answer while ``compare`` is low; otherwise answer wrongly

    def write(self, config: ReadoutConfig, folder: Path, record: bool) -> None:
        """Write comparators.bin for the harness (see harness.v)."""
        offset = np.zeros((2, config.taxels), np.int64) if self.offset is None else self.offset
        words = np.concatenate([[self.noise, self.hysteresis, self.seed, record, self.holds], offset.ravel()])
        (folder / "comparators.bin").write_bytes(words.astype(">i4").tobytes())


def ideal(config: ReadoutConfig, x: int, reference: int, half_width: int) -> tuple[bool, bool]:
    """Return the decisions, above and below, of ideal comparators."""
    above = x > reference + half_width if config.encoder.strict else x - reference >= half_width
    return above, config.has_polarity and x - reference < -half_width


def signal_of(samples: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return analog signals in 1/16 code: each sample plus a random fraction of a code."""
    fraction = np.random.default_rng(samples.size).integers(0, 1 << FRACTION_BITS, samples.shape)
    return (samples.astype(np.int64) << FRACTION_BITS) + fraction


def read_decisions(config: ReadoutConfig, folder: Path) -> NDArray[np.uint8]:
    """Return the recorded decisions of the comparators in every clock, shape (clocks, taxels)."""
    words = (folder / "decisions.txt").read_text().split()
    digits = -(-config.taxels // 4)
    nibbles = np.array([[int(digit, 16) for digit in word.zfill(digits)] for word in words], np.uint8)
    bits = (nibbles[:, ::-1, None] >> np.arange(4, dtype=np.uint8)) & 1
    found = bits.reshape(-1, 2, 4 * digits)[:, :, : config.taxels].astype(np.uint8)
    return np.asarray(found[:, 0] + 2 * found[:, 1], np.uint8)
