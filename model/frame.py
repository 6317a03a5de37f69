"""Cycle-accurate model of the frame readout: one ADC converts all taxels in turn (docs/reference/frame.md).

This is the golden model of ``rtl/frame.py``, without bit slices.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code

WORD_DTYPE = np.dtype([("t", np.int64), ("sync", np.bool_), ("data", np.uint64)])
"""An output word: clock of the transfer since the end of reset, frame sync, and the word."""


class Inputs(NamedTuple):
    """Values of the input ports in one clock; ``adc_code`` has N bits, unsigned."""

    frame_start: int = 0
    adc_done: int = 0
    adc_code: int = 0
    word_ready: int = 1


class Outputs(NamedTuple):
    """Values of the output ports in one clock, as unsigned integers."""

    row_select: int
    column_select: int
    adc_start: int
    word_valid: int
    word_data: int
    word_sync: int
    frame_overrun: int


class FrameModel:
    """State of the frame readout, updated at each rising edge."""

    def __init__(self, config: FrameConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Set all registers to their state after reset."""
        self.taxel = -1  # index r * columns + c of the taxel at the ADC; -1 between frames
        self.countdown = 0  # clocks that the multiplexer still needs to settle
        self.converting = False
        self.overrun = False  # a frame_start was missed in the clock before
        self.held: tuple[int, int] | None = None  # the sample on its way to the packer: taxel and code
        self.bits, self.fill = 0, 0  # bits of the frame that do not make a word yet, and how many
        self.opening = False  # the next word is the first of its frame
        self.flush = False  # the frame has ended; its last bits make a word by themselves
        self.word, self.valid, self.sync = 0, False, False  # the output word

    @property
    def idle(self) -> bool:
        """True if no taxel is selected and no sample or word is waiting."""
        return self.taxel < 0 and self.held is None and not self.flush and not self.valid

    @property
    def outputs(self) -> Outputs:
        """Values of the output ports just before the next rising edge."""
        row, column = divmod(self.taxel, self.config.columns)
        starts = self.taxel >= 0 and not self.converting and self.countdown == 0 and self.held is None
        return Outputs(
            row_select=1 << row if self.taxel >= 0 else 0,
            column_select=1 << column if self.taxel >= 0 else 0,
            adc_start=int(starts),
            word_valid=int(self.valid),
            word_data=self.word,
            word_sync=int(self.sync),
            frame_overrun=int(self.overrun),
        )

    def clock(self, inputs: Inputs) -> None:
        """Apply a rising edge with reset low."""
        starts = bool(self.outputs.adc_start)
        passes = self._packer(inputs)
        self.overrun = bool(inputs.frame_start) and self.taxel >= 0
        if passes:
            self.held = None
        if starts:
            self.converting = True
        elif self.taxel < 0:
            if inputs.frame_start:
                self.taxel, self.countdown = 0, self.config.settle_clocks
        elif self.converting:
            if inputs.adc_done:
                self.held = (self.taxel, inputs.adc_code)
                self.converting, self.countdown = False, self.config.settle_clocks
                self.taxel = self.taxel + 1 if self.taxel + 1 < self.config.taxels else -1
        elif self.countdown:
            self.countdown -= 1

    def _packer(self, inputs: Inputs) -> bool:
        """Apply a rising edge to the packer; return True if the packer took the waiting sample."""
        free = not self.valid or bool(inputs.word_ready)
        if not free:
            return False
        self.valid = False
        if self.flush:
            self._emit(self.bits)
            self.bits, self.fill, self.flush = 0, 0, False
            return False
        if self.held is None:
            return False
        taxel, code = self.held
        self.opening = self.opening or taxel == 0
        self.bits |= code << self.fill
        self.fill += self.config.resolution
        if self.fill >= self.config.word_bits:
            self._emit(self.bits & (1 << self.config.word_bits) - 1)
            self.bits >>= self.config.word_bits
            self.fill -= self.config.word_bits
        self.flush = taxel == self.config.taxels - 1 and self.fill > 0
        return True

    def _emit(self, word: int) -> None:
        self.word, self.valid, self.sync = word, True, self.opening
        self.opening = False


# -- whole runs --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FrameStimulus:
    """Inputs of a frame readout, starting at the end of reset."""

    samples: NDArray[np.integer]
    """W-bit codes, shape (ticks, taxels); the ADC sees the newest of the selected taxel when it starts."""
    sample_clock: NDArray[np.int64]  # clock from which each entry is valid, rising from 0, shape (ticks,)
    frame_clock: NDArray[np.int64]  # clocks with ``frame_start``, rising, shape (frames,)
    clocks: int  # length of the run
    conversion: NDArray[np.int64]
    """Clocks from adc_start to adc_done of one conversion after the other, repeated; at least 1, shape (pattern,)."""
    ready: NDArray[np.uint8] = field(default_factory=lambda: np.ones(1, np.uint8))  # ``word_ready`` per clock, repeated

    @classmethod
    def from_samples(cls, config: FrameConfig, samples: NDArray[np.integer], *, drain: int = 0) -> FrameStimulus:
        """Return a stimulus with one frame per row of samples at the frame rate, and ``drain`` clocks at the end."""
        start = np.arange(len(samples), dtype=np.int64) * config.clocks_per_frame
        return cls(
            samples=np.asarray(samples),
            sample_clock=start,
            frame_clock=start,
            clocks=len(samples) * config.clocks_per_frame + drain,
            conversion=np.array([config.adc_clocks]),
        )

    def check(self, config: FrameConfig) -> None:
        """Check that a stimulus fits a configuration."""
        if self.samples.ndim != 2 or self.samples.shape[1] != config.taxels:
            raise InputError(
                f"samples must have shape (ticks, {config.taxels}) for {config.rows} x {config.columns} taxels, "
                f"not {self.samples.shape}"
            )
        rising = (np.diff(self.sample_clock) > 0).all() and (np.diff(self.frame_clock) > 0).all()
        if self.sample_clock.shape != self.samples.shape[:1] or not rising or self.sample_clock[:1].any():
            raise InputError("sample_clock and frame_clock must rise from 0, with one clock for every row of samples")
        if not self.conversion.size or (self.conversion < 1).any() or not self.ready.size:
            raise InputError("conversion must be at least 1 clock; conversion and ready must not be empty")


@dataclass(frozen=True)
class FrameRun:
    """Words, conversion starts and missed frame starts of one simulated run."""

    words: NDArray[np.void]  # of WORD_DTYPE, shape (words,)
    starts: NDArray[np.int64]  # clock of every adc_start, and the index of the taxel, shape (conversions, 2)
    overruns: NDArray[np.int64]  # clocks of every frame_start that was missed (one before ``frame_overrun``)
    idle: bool  # whether the readout was idle at the end


def simulate(config: FrameConfig, stimulus: FrameStimulus) -> FrameRun:
    """Simulate the frame readout with an ideal ADC that rounds down (``adc_code``)."""
    stimulus.check(config)
    codes = adc_code(config, stimulus.samples) & ((1 << config.resolution) - 1)
    model = FrameModel(config)
    words: list[tuple[int, int, int]] = []
    starts: list[tuple[int, int]] = []
    overruns: list[int] = []
    conversions = itertools.cycle(stimulus.conversion.tolist())
    frames = iter([*stimulus.frame_clock.tolist(), -1])
    next_frame, tick, done_at, code = next(frames), -1, -1, 0
    for t, ready in zip(range(stimulus.clocks), itertools.cycle(stimulus.ready.tolist()), strict=False):
        while tick + 1 < len(codes) and stimulus.sample_clock[tick + 1] <= t:
            tick += 1
        outputs = model.outputs
        if outputs.frame_overrun:
            overruns.append(t - 1)
        if outputs.word_valid and ready:
            words.append((t, outputs.word_sync, outputs.word_data))
        inputs = Inputs(int(t == next_frame), int(t == done_at), code, ready)
        if t == next_frame:
            next_frame = next(frames)
        if outputs.adc_start:
            starts.append((t, model.taxel))
            done_at, code = t + next(conversions), int(codes[tick, model.taxel]) if len(codes) else 0
        model.clock(inputs)
    return FrameRun(
        np.array(words, WORD_DTYPE),
        np.array(starts, np.int64).reshape(-1, 2),
        np.array(overruns, np.int64),
        model.idle,
    )
