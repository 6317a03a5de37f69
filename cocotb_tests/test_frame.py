"""The frame readout's RTL against the model in every clock and word, with ADCs and receivers of all kinds."""

from __future__ import annotations

import json
import os
import random
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cocotb
import numpy as np
import pytest
from numpy.typing import NDArray

from cocotb_tests.bench.block import JOB, Sink, report
from cocotb_tests.bench.frame import FrameBench, SarAdc
from cocotb_tests.bench.textures import random_scan, scan
from model.config import ReadoutConfig
from model.frame import FrameStimulus, simulate
from model.frame_config import FrameConfig
from model.frame_words import adc_code, unpack

if TYPE_CHECKING:
    from cocotb_tests.session.runners import Simulator


def job() -> tuple[FrameConfig, random.Random]:
    """Return, within the simulator, the configuration of the test and its source of randomness."""
    fields = json.loads(os.environ[JOB])
    return FrameConfig.from_dict(fields["config"]), random.Random(fields["seed"])


@cocotb.test()
async def frames_equal_the_model(dut: Any) -> None:
    """All receivers and ADCs, frame starts that come early or late, moving signals, resets in mid-stream."""
    config, rng = job()
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
    if config.taxels > 100:  # one pair a receiver and an ADC: a frame takes thousands of clocks
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
    """Return how many frames of a scan are played: fewer of a large array."""
    return 24 if config.taxels < 20 else 6


@cocotb.test()
async def texture_scan_gives_its_codes(dut: Any) -> None:
    """A scan over an embedded photograph at the frame rate: the words and their clocks are those of ``simulate``."""
    config, rng = job()
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


PROPERTIES = (
    "OneTaxelSelected",
    "MultiplexerSettled",
    "SelectedWhileConverting",
    "WordStableUntilTaken",
    "EveryTaxelInOrder",
    "EverySampleOnceInOrder",
)


def frame_config(rows: int, columns: int, resolution: int, reset: str = "sync", **own: Any) -> FrameConfig:
    """Return a configuration in one line."""
    shared = {"rows": rows, "columns": columns, "resolution": resolution, "reset": reset}
    return FrameConfig.from_dict(shared | own)


CONFIGS = [
    frame_config(rows, columns, resolution, "async" if number % 2 else "sync")
    for number, (rows, columns, resolution) in enumerate(
        (rows, columns, resolution)
        for rows, columns in [(1, 1), (1, 4), (3, 5), (8, 8), (12, 16)]
        for resolution in ((1, 6, 10) if rows * columns <= 64 else (10,))
    )
] + [
    frame_config(3, 5, 6, word_bits=6),  # a code is a word
    frame_config(2, 3, 5, word_bits=10, settle_clocks=3),  # half a word
    frame_config(4, 1, 22, "async", word_bits=23, sample_bits=24, settle_clocks=2),
    frame_config(1, 3, 6, word_bits=64),  # a frame is less than a word
]


def name(config: FrameConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{config.resolution}b-{config.word_bits}b-{config.reset}"


def cosimulate(
    config: FrameConfig, simulator: Simulator, test: str, folder: Path, seed: int, samples: NDArray[np.int64]
) -> Counter[str]:
    """Run one cocotb test of the frame readout on samples of a scan, and return what it counted."""
    from cocotb_tests.session.simulator import build  # not in the simulator, which imports this file too

    np.save(folder / "samples.npy", samples)
    program = build(config, simulator, top="eskin_frame_readout")
    environment = {JOB: json.dumps({"config": config.to_dict(), "seed": seed})}
    program.test("cocotb_tests.test_frame", folder, test, environment)
    return Counter(json.loads((folder / "counts.json").read_text()))


CASES = [
    *(pytest.param("icarus", config, id=f"icarus-{name(config)}") for config in CONFIGS),
    pytest.param("verilator", CONFIGS[7], id=f"verilator-{name(CONFIGS[7])}"),
]


@pytest.mark.parametrize(("simulator", "config"), CASES)
def test_rtl_equals_the_model_in_every_clock_and_loses_no_sample(
    simulator: Simulator, config: FrameConfig, tmp_path: Path
) -> None:
    texture = random_scan(config.readout, 400, np.random.default_rng(config.taxels))
    counts = cosimulate(config, simulator, "frames_equal_the_model", tmp_path, config.taxels, texture)
    assert counts["checks"] > 4000
    assert counts["words"] > 0
    assert counts["words"] == counts["frames"] * config.words_per_frame
    assert counts["frames"] >= 4
    assert counts["overruns"] > 10
    assert counts["resets"] > 4
    assert counts["frames begun after reset"] > 3
    assert all(counts[property_name] > 0 for property_name in PROPERTIES), counts


@pytest.mark.parametrize(
    "config",
    [frame_config(8, 8, 6), frame_config(3, 5, 10, "async"), frame_config(1, 1, 6), frame_config(12, 16, 8)],
    ids=name,
)
def test_texture_scan_leaves_as_the_words_of_the_model(config: FrameConfig, tmp_path: Path) -> None:
    samples = scan(config.rows, config.columns, config.sample_bits, 11)[::100][: scanned_frames(config)].astype(
        np.int64
    )
    counts = cosimulate(config, "icarus", "texture_scan_gives_its_codes", tmp_path, 1, samples)
    assert counts["frames"] == scanned_frames(config)
    assert counts["words"] == counts["frames"] * config.words_per_frame
    assert counts["different codes"] > 3
    assert counts["overruns"] == 0


def test_sar_of_the_bench_rounds_down_over_the_whole_range() -> None:
    for resolution in (1, 4, 6):
        config = FrameConfig(readout=ReadoutConfig(sample_bits=8, resolution=resolution))
        adc = SarAdc(config, "fixed", random.Random(0))
        samples = np.arange(-128, 128)
        codes = np.array([adc.convert(int(sample)) for sample in samples])
        assert np.array_equal(codes, adc_code(config, samples) & ((1 << resolution) - 1))
