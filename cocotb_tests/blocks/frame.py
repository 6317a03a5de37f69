"""Compare the frame readout's RTL with the model in every clock, for all kinds of ADCs and receivers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import Simulator, Sink, job, report
from eskin.cocotb_tests.bench.frame import FrameBench, SarAdc
from eskin.cocotb_tests.runner import block
from eskin.model.frame import FrameStimulus, simulate
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code, unpack


@cocotb.test()
async def frames_equal_the_model(dut: Any) -> None:
    """Play all receivers and ADCs with early and late frame starts, moving signals, and resets."""
    config, rng = job(FrameConfig.from_dict)
    bench = FrameBench(dut, config, rng)
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
    pairs = [(sink, timing) for sink in Sink.NAMES for timing in SarAdc.TIMINGS]
    if config.taxels > 100:  # one ADC per receiver, because a frame takes thousands of clocks
        pairs = [(sink, SarAdc.TIMINGS[number % 3]) for number, sink in enumerate(Sink.NAMES)]
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
    config, rng = job(FrameConfig.from_dict)
    bench = FrameBench(dut, config, rng)
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
