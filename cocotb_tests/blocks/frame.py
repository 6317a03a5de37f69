"""Steps of the frame readout, compared with its model, for all kinds of ADCs and receivers."""

import functools
import itertools
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import Simulator, Sink, Step
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.frame import FrameModel, Inputs
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code, unpack

TIMINGS = ("fixed", "random", "level")


class SarAdc:
    """Behavioural SAR ADC: samples at the end of ``adc_start``, then answers after a number of clocks.

    The timing "fixed" takes N + 1 clocks, and "random" 1 to 2 N clocks. "level" takes N + 1 clocks, and holds
    ``adc_done`` and the code until the next start. While no code is valid, the code is random.
    """

    def __init__(self, config: FrameConfig, timing: str, rng: random.Random) -> None:
        self.config, self.timing, self.rng = config, timing, rng
        self.remaining = 0
        self.code: int | None = None

    def outputs(self) -> tuple[int, int]:
        """Return adc_done and adc_code in this clock."""
        if self.remaining == 0 and self.code is not None:
            return 1, self.code
        return 0, self.rng.getrandbits(self.config.resolution)

    def clock(self, start: int, sample: int) -> None:
        """Apply a rising edge; ``sample`` is the signal at the multiplexer's output."""
        if self.remaining:
            self.remaining -= 1
        elif self.timing != "level":
            self.code = None
        if start:
            bits = self.config.resolution
            self.code = self.convert(sample)
            self.remaining = (self.rng.randint(1, 2 * bits) if self.timing == "random" else bits + 1) - 1

    def convert(self, sample: int) -> int:
        """Return the N-bit code, by one comparison of the sample with the DAC per bit."""
        weight = self.config.readout.full_scale
        dac, code = -weight, 0
        for _ in range(self.config.resolution):
            above = sample >= dac + weight
            dac += weight if above else 0
            code = code << 1 | above
            weight >>= 1
        return code ^ 1 << (self.config.resolution - 1)  # two's complement


class FrameSteps:
    """Steps of a frame readout with array, ADC and receiver, computed by the model.

    The samples that the ADC took are collected, and in the end the words must unpack to their codes: every one once and
    in order.
    """

    def __init__(
        self, config: FrameConfig, rng: random.Random, counts: Counter[str], texture: NDArray[np.int64]
    ) -> None:
        self.config, self.rng, self.counts, self.texture = config, rng, counts, texture
        self.model = FrameModel(config)
        self.time = 0
        self.begin("fixed", "always")

    def __iter__(self) -> Iterator[Step]:
        """Yield all receivers and ADCs with early and late frame starts, moving signals, and resets."""
        config, rng = self.config, self.rng
        yield from self.reset(2)
        pairs = [(sink, timing) for sink in Sink.NAMES for timing in TIMINGS]
        if config.taxels > 100:  # one ADC per receiver, because a frame takes thousands of clocks
            pairs = list(zip(Sink.NAMES, itertools.cycle(TIMINGS), strict=False))
        for sink, timing in pairs:
            self.begin(timing, sink)
            for _ in range(min(400 + config.frame_clocks, 3000)):
                yield self.clock(start=rng.random() < (0.3 if self.model.taxel < 0 else 0.02))
            yield from self.finish()
            # Reset within a scan, at a place of its own every time, then a frame that must be whole.
            for _ in range(rng.randrange(4, 4 + min(config.frame_clocks, 300))):
                yield self.clock(start=True)
            yield from self.reset(1)
            yield self.clock(start=True)
            self.counts["frames begun after reset"] += self.model.taxel == 0
            yield from self.finish()

    def begin(self, timing: str, sink: str) -> None:
        """Begin with a new idle ADC and a new receiver, and clear the records of words and samples."""
        self.adc = SarAdc(self.config, timing, self.rng)
        self.sink = Sink(sink, self.rng)
        self.words: list[tuple[int, int]] = []
        self.taken: list[tuple[int, int]] = []

    def sample(self, taxel: int) -> int:
        """Return the signal of a taxel; the last but one of every 64 sample periods is at an end of the range."""
        tick, high = self.time // 37, self.config.readout.full_scale
        if tick % 64 == 62:
            return (-high, -1, 0, high - 1)[tick // 64 % 4]
        return int(self.texture[tick % len(self.texture), taxel])

    def clock(self, start: bool = False, rst: bool = False) -> Step:
        """Return the step of a clock, and advance model, ADC and receiver."""
        done, code = self.adc.outputs()
        inputs = Inputs(int(start), done, code, int(self.sink.ready()))
        if rst and self.config.reset == "async":
            self.model.reset()
        outputs, taxel = self.model.outputs, self.model.taxel
        state = {name: value for name, value in vars(self.model).items() if name != "config"}
        step = Step({"rst": rst, **inputs._asdict()}, outputs._asdict(), str(state))
        self.time += 1
        if rst:
            self.model.reset()
            return step
        sample = self.sample(taxel) if taxel >= 0 else 0
        if outputs.adc_start:
            self.taken.append((taxel, sample))
        if outputs.word_valid and inputs.word_ready:
            self.words.append((outputs.word_sync, outputs.word_data))
        self.counts["overruns"] += outputs.frame_overrun
        self.adc.clock(outputs.adc_start, sample)
        self.model.clock(inputs)
        return step

    def reset(self, clocks: int) -> Iterator[Step]:
        """Yield a reset of readout and ADC."""
        self.begin(self.adc.timing, self.sink.name)
        for _ in range(clocks):
            yield self.clock(start=True, rst=True)
        self.begin(self.adc.timing, self.sink.name)
        self.counts["resets"] += 1

    def finish(self) -> Iterator[Step]:
        """Yield the clocks until all words have left, and check that every sample left once and in order."""
        config = self.config
        while not self.model.idle:
            yield self.clock()
        yield self.clock()
        samples = np.array([sample for _, sample in self.taken], np.int64).reshape(-1, config.taxels)
        sync, data = np.array(self.words, np.uint64).reshape(-1, 2).T
        received = unpack(config, data, sync.astype(bool))
        assert [taxel for taxel, _ in self.taken] == [*range(config.taxels)] * len(samples)
        assert len(data) == len(samples) * config.words_per_frame
        assert np.array_equal(received, adc_code(config, samples))
        self.counts["frames"] += len(received)
        self.counts["words"] += len(data)
        self.words, self.taken = [], []


def play(
    config: FrameConfig, simulator: Simulator, folder: Path, seed: int, samples: NDArray[np.int64]
) -> Counter[str]:
    """Compare a frame readout with the model on samples, shape (ticks, taxels), and return the counts."""
    steps = functools.partial(FrameSteps, texture=samples)
    return play_steps(config, simulator, "eskin_frame_readout", steps, folder, seed)
