"""Bit flips in the frame readout: wrong frames, and recovery."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from eskin.model.frame import FrameModel
from eskin.model.frame import Inputs as ModelInputs
from eskin.model.frame_config import FrameConfig
from eskin.rtl.frame import FrameReadout
from eskin.verify.faults.bench import ADC_CLOCKS, bench_gates, inside
from eskin.verify.faults.gates import last_clock, upset_runs
from eskin.verify.faults.outcomes import CHANGED, MOVED, NEVER, UnlikeModel, Upset, classify_effects
from eskin.verify.faults.scenario import RESET

FRAMES, UPSET_FRAMES = 7, 3
"""Number of frames of a run, and number of first frames with bit flips."""


def upsets(config: FrameConfig, stride: int, flops: str) -> Iterator[Upset]:
    """Flip every flop of a frame readout in every clock of several frames, one per run; yield the outcomes.

    An outcome is "others changed" where words are wrong, with their frames as ``lost``, and "others moved" where they
    are right but come at other clocks. See ``eskin.verify.faults.outcomes.upsets``.
    """
    gates = bench_gates(FrameReadout(config))
    period = config.taxels * (config.settle_clocks + ADC_CLOCKS + 4) + 3 * config.words_per_frame + 12
    inputs = _inputs(config, period)
    clocks = range(RESET, RESET + UPSET_FRAMES * period, stride)
    expected = _model(config, inputs)
    for part, outputs in upset_runs(gates, inputs, clocks, inside(gates, flops)):
        taken = (outputs["word_valid"] & inputs["word_ready"].astype(np.int64)) != 0
        words = np.where(taken, 1 + outputs["word_data"] * 2 + outputs["word_sync"], 0)
        if not np.array_equal(words[:, 0], expected):
            raise UnlikeModel("the gates of the frame readout do not give the model's words")
        wrong = _hashes(words, period)
        wrong = wrong[:, 1:] != wrong[:, :1]
        moved = (words[:, 1:] != words[:, :1]).any(axis=0)
        lost, last = wrong.sum(axis=0), last_clock(wrong)  # frames
        ticks = np.where(lost, last - [(clock - RESET) // period for clock, _ in part], -1)
        yield from classify_effects(
            part, {NEVER: last >= FRAMES - 2, CHANGED: lost > 0, MOVED: moved}, ticks=ticks, lost=lost
        )


def _inputs(config: FrameConfig, period: int) -> dict[str, NDArray[np.uint8]]:
    """Return a stimulus with a frame start in every period, varying codes, and random stalls."""
    rng = np.random.default_rng(0)
    total = RESET + FRAMES * period
    since = np.arange(total) - RESET
    salt = rng.integers(0, 1 << config.resolution, FRAMES)[np.maximum(since, 0) // period]
    return {
        "rst": (since < 0).astype(np.uint8)[:, None],
        "frame_start": ((since >= 0) & (since % period == 0)).astype(np.uint8)[:, None],
        "word_ready": (rng.random(total) < 0.7).astype(np.uint8)[:, None],
        "salt": (salt[:, None] >> np.arange(config.resolution) & 1).astype(np.uint8),
    }


def _model(config: FrameConfig, inputs: dict[str, NDArray[np.uint8]]) -> NDArray[np.int64]:
    """Return the words of the golden model; 0 in clocks without a word."""
    model, left, code = FrameModel(config), 0, 0
    words = np.zeros(len(inputs["rst"]), np.int64)
    salts = inputs["salt"] @ (1 << np.arange(config.resolution))
    for clock in range(RESET, len(words)):
        start, ready = (int(inputs[name][clock, 0]) for name in ("frame_start", "word_ready"))
        out = model.outputs
        if out.word_valid and ready:
            words[clock] = 1 + out.word_data * 2 + out.word_sync
        model.clock(ModelInputs(start, int(left == 1), code, ready))
        if out.adc_start:
            left = ADC_CLOCKS
            place = out.row_select.bit_length() - 1 + config.rows + out.column_select.bit_length() - 1
            code = int(salts[clock] + place) % (1 << config.resolution)
        elif left:
            left -= 1
    return words


def _hashes(words: NDArray[np.int64], period: int) -> NDArray[np.uint64]:
    """Return a hash of the words of each frame, independent of their clocks, shape (FRAMES, runs)."""
    found = np.zeros((FRAMES, words.shape[1]), np.uint64)
    for clock in range(RESET, len(words)):
        row = found[(clock - RESET) // period]
        word = words[clock].astype(np.uint64)
        row[:] = np.where(word != 0, row * np.uint64(6364136223846793005) + word, row)
    return found
