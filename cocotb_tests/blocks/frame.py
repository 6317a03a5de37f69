"""Compare the frame readout's RTL with the model in every clock, for all kinds of ADCs and receivers."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import Block, Checker, Simulator, Sink, job, report
from eskin.cocotb_tests.runner import block
from eskin.model.frame import FrameModel, FrameStimulus, Inputs, simulate
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


class FrameBench:
    """A frame readout with array, ADC and receiver, compared with the model in every clock.

    Independent of the model, the samples that the ADC took are collected, and in the end the received words must
    unpack to their codes: every one once and in order.
    """

    def __init__(self, dut: Any) -> None:
        self.config, self.rng = job(FrameConfig.from_dict)
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.model = FrameModel(self.config)
        self.samples: Callable[[int], NDArray[np.int64]] = lambda clock: np.zeros(self.config.taxels, np.int64)
        self.begin("fixed", "always")
        self.block.drive(frame_start=0, adc_done=0, adc_code=0, word_ready=0, rst=1)

    def begin(self, timing: str, sink: str) -> None:
        """Begin with a new idle ADC and a new receiver, and clear the records of words and samples."""
        self.adc = SarAdc(self.config, timing, self.rng)
        self.sink = Sink(sink, self.rng)
        self.words: list[tuple[int, int]] = []
        self.taken: list[tuple[int, int]] = []

    async def clock(self, start: bool = False, rst: bool = False) -> None:
        """Drive a clock, and compare all outputs just before its rising edge."""
        done, code = self.adc.outputs()
        inputs = Inputs(int(start), done, code, int(self.sink.ready()))
        self.block.drive(rst=rst, **inputs._asdict())
        if rst and self.config.reset == "async":
            self.model.reset()
        await self.block.settle()
        expected = self.model.outputs
        self.check.outputs(
            {key: value for key, value in vars(self.model).items() if key != "config"}, **expected._asdict()
        )
        taxel = self.model.taxel
        sample = int(self.samples(self.block.time)[taxel]) if taxel >= 0 else 0
        await self.block.edge()
        if rst:
            self.model.reset()
            return
        if expected.adc_start:
            self.taken.append((taxel, sample))
        if expected.word_valid and inputs.word_ready:
            self.words.append((expected.word_sync, expected.word_data))
        self.check.counts["overruns"] += expected.frame_overrun
        self.adc.clock(expected.adc_start, sample)
        self.model.clock(inputs)

    async def reset(self, clocks: int = 2) -> None:
        """Reset readout and ADC for a number of clocks."""
        self.begin(self.adc.timing, self.sink.name)
        for _ in range(clocks):
            await self.clock(start=True, rst=True)
        self.begin(self.adc.timing, self.sink.name)
        self.check.counts["resets"] += 1

    async def finish(self) -> None:
        """Wait until all words have left, and check that every sample left once and in order."""
        config = self.config
        while not self.model.idle:
            await self.clock()
        await self.clock()
        samples = np.array([sample for _, sample in self.taken], np.int64).reshape(-1, config.taxels)
        sync, data = np.array(self.words, np.uint64).reshape(-1, 2).T
        received = unpack(config, data, sync.astype(bool))
        in_order = [taxel for taxel, _ in self.taken] == [*range(config.taxels)] * len(samples)
        whole = in_order and len(data) == len(samples) * config.words_per_frame
        equal = whole and np.array_equal(received, adc_code(config, samples))
        self.check.holds("EverySampleOnceInOrder", equal, f"sampled {self.taken}, received {received}")
        self.check.counts["frames"] += len(received)
        self.check.counts["words"] += len(data)
        self.words, self.taken = [], []


@cocotb.test()
async def frames_equal_the_model(dut: Any) -> None:
    """Play all receivers and ADCs with early and late frame starts, moving signals, and resets."""
    bench = FrameBench(dut)
    config, rng = bench.config, bench.rng
    texture = np.load("samples.npy")
    edges = np.array([-config.readout.full_scale, -1, 0, config.readout.full_scale - 1])

    def moving(clock: int) -> Any:
        # The last but one of every 64 sample periods is at an edge of the range, all taxels.
        tick = clock // 37
        value = texture[tick % len(texture)]
        return np.full_like(value, edges[tick // 64 % 4]) if tick % 64 == 62 else value

    bench.samples = moving
    await bench.block.reset()
    await bench.reset()
    pairs = [(sink, timing) for sink in Sink.NAMES for timing in TIMINGS]
    if config.taxels > 100:  # one ADC per receiver, because a frame takes thousands of clocks
        pairs = [(sink, TIMINGS[number % 3]) for number, sink in enumerate(Sink.NAMES)]
    for sink, timing in pairs:
        bench.begin(timing, sink)
        for _ in range(min(400 + config.frame_clocks, 3000)):
            await bench.clock(start=rng.random() < (0.3 if bench.model.taxel < 0 else 0.02))
        await bench.finish()
        # Reset within a scan, at a place of its own every time, then a frame that must be whole.
        await bench.clock(start=True)
        for _ in range(rng.randrange(3, 3 + min(config.frame_clocks, 300))):
            await bench.clock(start=True)
        await bench.reset(1)
        await bench.clock(start=True)
        bench.check.counts["frames begun after reset"] += bench.model.taxel == 0
        if config.taxels <= 100:
            await bench.finish()
        else:
            await bench.reset(1)
    report(bench.check.counts)


def scanned_frames(config: FrameConfig) -> int:
    """Return the number of frames to play, fewer for a large array."""
    return 24 if config.taxels < 20 else 6


@cocotb.test()
async def texture_scan_gives_its_codes(dut: Any) -> None:
    """Play a scan over an embedded photograph, and compare words and their clocks with ``simulate``."""
    bench = FrameBench(dut)
    config = bench.config
    samples = np.load("samples.npy")
    await bench.block.reset()
    await bench.reset()
    begin = bench.block.time
    stimulus = FrameStimulus.from_samples(config, samples, drain=4)
    bench.samples = lambda clock: samples[min((clock - begin) // config.clocks_per_frame, len(samples) - 1)]
    times: list[int] = []
    for t in range(stimulus.clocks):
        await bench.clock(start=t % config.clocks_per_frame == 0 and t < len(samples) * config.clocks_per_frame)
        times += [t] * (len(bench.words) - len(times))
    expected = simulate(config, stimulus)
    sync, data = np.array(bench.words, np.uint64).T
    bench.check.holds("WordsOfSimulate", np.array_equal(data, expected.words["data"]), data)
    bench.check.holds("ClocksOfSimulate", times == expected.words["t"].tolist(), times)
    codes = unpack(config, data, sync.astype(bool))
    bench.check.holds("CodesOfTheScan", np.array_equal(codes, adc_code(config, samples)), codes)
    bench.check.counts["different codes"] = len(np.unique(codes))
    await bench.finish()
    report(bench.check.counts)


def cosimulate(
    config: FrameConfig, simulator: Simulator, test: str, folder: Path, seed: int, samples: NDArray[np.int64]
) -> Counter[str]:
    """Run one cocotb test of the frame readout, and return its counts."""
    np.save(folder / "samples.npy", samples)
    return block.cosimulate(config, simulator, "eskin_frame_readout", test, folder, seed, __name__)
