"""Conversion of samples to ADC codes, and of codes to output words (docs/reference/frame.md)."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.frame_config import FrameConfig


def adc_code(config: FrameConfig, samples: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the signed ADC codes of samples of any shape: the upper N of W bits, rounded down."""
    values = np.asarray(samples, np.int64)
    high = config.readout.full_scale
    if values.size and not -high <= values.min() <= values.max() < high:
        raise InputError(
            f"samples must be in {-high}..{high - 1} ({config.sample_bits} bits), not {values.min()}..{values.max()}"
        )
    return values >> (config.sample_bits - config.resolution)


def pack(config: FrameConfig, codes: NDArray[np.integer]) -> NDArray[np.uint64]:
    """Return the output words of frames, packed from the lowest bit; every frame starts a new word.

    ``codes``, shape (frames, taxels), are ADC codes, signed or their N bits. The words have the shape (frames,
    words_per_frame).
    """
    values = np.asarray(codes, np.int64)
    if values.ndim != 2 or values.shape[1] != config.taxels:
        raise InputError(f"codes must have shape (frames, {config.taxels}), not {values.shape}")
    low, high = -(1 << (config.resolution - 1)), 1 << config.resolution
    if values.size and not low <= values.min() <= values.max() < high:
        raise InputError(
            f"codes must be in {low}..{high - 1} ({config.resolution} bits), not {values.min()}..{values.max()}"
        )
    bits = (values[:, :, None] >> np.arange(config.resolution)) & 1
    used, length = config.taxels * config.resolution, config.words_per_frame * config.word_bits
    bits = np.pad(bits.reshape(len(values), used), ((0, 0), (0, length - used)))
    return _from_bits(bits.reshape(len(values), config.words_per_frame, config.word_bits))


def unpack(config: FrameConfig, words: NDArray[np.integer], sync: NDArray[Any] | None = None) -> NDArray[np.int64]:
    """Return the signed ADC codes packed in output words, shape (frames, taxels).

    ``words`` have the shape (frames, words_per_frame), or (words,) with their ``sync``. An incomplete frame at the end
    of a stream is left out. Frames that do not begin at a ``sync``, or do not end in zeros, raise InputError.
    """
    values, length = np.asarray(words, np.uint64), config.words_per_frame
    if sync is not None:
        if values.ndim != 1 or np.shape(sync) != values.shape:
            raise InputError(f"words and sync must have one shape (words,), not {values.shape} and {np.shape(sync)}")
        wrong = np.flatnonzero(np.asarray(sync, bool) != (np.arange(len(values)) % length == 0))
        if len(wrong):
            raise InputError(f"word {wrong[0]}: a frame of {length} words must not begin here, or sync is missing")
        values = values[: len(values) // length * length].reshape(-1, length)
    if values.ndim != 2 or values.shape[1] != length:
        raise InputError(f"words must have shape (frames, {length}), not {values.shape}")
    bits = (values[:, :, None] >> np.arange(config.word_bits, dtype=np.uint64)) & np.uint64(1)
    bits = bits.reshape(len(values), length * config.word_bits)
    used = config.taxels * config.resolution
    if bits[:, used:].any():
        raise InputError("the bits after the last code of a frame must be 0; check the configuration")
    codes = _from_bits(bits[:, :used].reshape(len(values), config.taxels, config.resolution)).astype(np.int64)
    return codes - (codes >> (config.resolution - 1) << config.resolution)


def _from_bits(bits: NDArray[Any]) -> NDArray[np.uint64]:
    """Return integers for arrays of bits, least significant bit first."""
    weights = np.uint64(1) << np.arange(bits.shape[-1], dtype=np.uint64)
    return np.asarray((bits.astype(np.uint64) * weights).sum(axis=-1), np.uint64)


def bit_positions(config: FrameConfig) -> int:
    """Return the greatest common divisor of N and the word length, the alignment of codes in words."""
    return math.gcd(config.resolution, config.word_bits)
