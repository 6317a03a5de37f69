"""Code samples by their changes: a frame ``CHANGES`` contains the bits of whole ticks (docs/reference/board.md)."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.board.serial_frames import MAX_PAYLOAD, Kind
from eskin.model.config import ReadoutConfig

JUMP_BITS = 3  # number of ones before a whole code; fewer ones and a zero stand for a step or for no change
MAX_TICKS = 255
MAX_BITS = 8 * (MAX_PAYLOAD - 1)  # of all ticks of a frame; the first byte is their number
BLOCK_TICKS = 4096  # ticks that are coded at once


def unread_bits(readout: ReadoutConfig) -> int:
    """Return the number of low bits of a sample that the encoder does not read.

    An encoder compares samples in units of its grid. A sum of several samples needs all bits.
    """
    return (readout.grid - 1).bit_length() if readout.receptive_fields == "own" else 0


class Part(NamedTuple):
    """A frame with samples."""

    kind: Kind  # ``CHANGES`` or ``SAMPLES``
    payload: bytes
    ticks: int  # that end in this frame


class ChangeCoder:
    """Coder that converts all samples after a ``RESTART`` to frames."""

    def __init__(self, readout: ReadoutConfig) -> None:
        self.low = unread_bits(readout)
        self.bits = readout.sample_bits - self.low
        self._codes: NDArray[Any] = np.zeros(readout.taxels, np.int32)
        self._falling: NDArray[Any] = np.zeros(readout.taxels, np.int8)

    def feed(self, samples: NDArray[Any]) -> Iterator[Part]:
        """Yield the frames of samples, shape (ticks, taxels).

        A tick whose changes may need more bits than its samples, or more than a frame has, is sent as samples.
        """
        for at in range(0, len(samples), BLOCK_TICKS):
            yield from self._block(samples[at : at + BLOCK_TICKS])

    def _block(self, samples: NDArray[Any]) -> Iterator[Part]:
        codes = samples.astype(np.int32) >> self.low
        moved = np.diff(codes, axis=0, prepend=self._codes[None])
        jumps = np.abs(moved) > 1
        steps = (moved != 0) & ~jumps
        most = (1 + 2 * steps + (2 + self.bits) * jumps).sum(1)
        whole = most > min(MAX_BITS, 16 * codes.shape[1])
        turns = steps & (self._directions(moved, steps & ~whole[:, None]) != (moved < 0))
        length = 1 + 1 * steps + 1 * turns + (JUMP_BITS - 1 + self.bits) * jumps
        raw = (1 << JUMP_BITS) - 1 | (codes & (1 << self.bits) - 1) << JUMP_BITS
        value = np.where(jumps, raw, 1 * steps + 2 * turns)
        place = np.arange(JUMP_BITS + self.bits)
        stream = (value[..., None] >> place & 1).astype(np.uint8)[place < length[..., None]]
        ends = np.cumsum(length.sum(1))
        self._codes = codes[-1]
        yield from _frames(samples, stream, ends, whole)

    def _directions(self, moved: NDArray[Any], steps: NDArray[Any]) -> NDArray[Any]:
        """Return, for each tick and taxel, whether the previous step was a fall."""
        ticks = np.arange(len(moved))[:, None]
        last = np.maximum.accumulate(np.where(steps, ticks, -1), axis=0)
        after = np.where(last < 0, self._falling, np.take_along_axis(moved < 0, np.maximum(last, 0), axis=0))
        before = np.vstack([self._falling[None], after[:-1]])
        self._falling = after[-1]
        return before


def _frames(
    samples: NDArray[Any], stream: NDArray[np.uint8], ends: NDArray[Any], whole: NDArray[np.bool_]
) -> Iterator[Part]:
    """Yield the frames of a block, each with as many ticks as fit."""
    first = begun = 0
    for tick in range(len(ends) + 1):
        here = begun if tick == 0 else int(ends[tick - 1])  # where the bits of this tick begin
        last = tick == len(ends)
        if tick > first and (last or whole[tick] or tick - first == MAX_TICKS or int(ends[tick]) - begun > MAX_BITS):
            bits = np.packbits(stream[begun:here], bitorder="little").tobytes()
            yield Part(Kind.CHANGES, bytes([tick - first]) + bits, tick - first)
            first, begun = tick, here
        if not last and whole[tick]:
            yield from whole_tick(samples[tick])
            first, begun = tick + 1, int(ends[tick])


def whole_tick(codes: NDArray[Any]) -> Iterator[Part]:
    """Yield the frames of one tick, with 16 bits for each sample."""
    size = MAX_PAYLOAD // 2
    for at in range(0, len(codes), size):
        yield Part(Kind.SAMPLES, codes[at : at + size].astype("<i2").tobytes(), int(at + size >= len(codes)))
