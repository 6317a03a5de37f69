"""Compare the classifier's RTL with the model in every clock, for random networks and events."""

from __future__ import annotations

import json
import os
import random
from collections import Counter
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import JOB, Simulator, job, report
from eskin.cocotb_tests.bench.classifier import ClassifierBench, Stimulus
from eskin.cocotb_tests.runner import block
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork, State
from eskin.model.classifier.run import first_ready, work_clocks

TOP = "eskin_classifier"
SCANS = 120


def random_network(config: ClassifierConfig, rng: random.Random) -> IntegerNetwork:
    """Return a network with random weights, including extreme rows."""
    generator = np.random.default_rng(rng.getrandbits(32))

    def drawn(bits: int, *shape: int) -> Any:
        values = generator.integers(lowest(bits), highest(bits) + 1, shape)
        at_end = generator.random(shape[0]) < 0.2
        values[at_end] = np.where(generator.random(shape)[at_end] < 0.5, lowest(bits), highest(bits))
        return values

    return IntegerNetwork.filled(config, drawn)


def random_scan(config: ClassifierConfig, rng: random.Random, bins: int, rate: str) -> Stimulus:
    """Return a random scan with events ``seldom``, in ``bursts`` or ``always``."""
    work = 3 * config.hidden + config.hidden * (config.groups + config.classes) // 2 + config.classes
    clock, ends = config.hidden + config.classes, []
    for _ in range(bins):
        clock += rng.choice([rng.randint(1, 4), rng.randint(1, work), work + rng.randint(0, 6 * config.groups + 30)])
        ends.append(clock)
    clocks = clock + rng.choice([rng.randint(1, work), 3 * work])
    gap = {"seldom": 12 * config.groups, "bursts": 1, "always": 0}[rate]
    events, at = [], 0
    while at < clocks:
        at += rng.randint(0, gap) + (
            rng.randint(0, 40 * config.groups) if rate == "bursts" and rng.random() < 0.1 else 0
        )
        at += rate == "always"
        events.append((at, rng.randrange(config.inputs)))
    return Stimulus(events, sorted(set(ends)), clocks)


@cocotb.test()
async def scans_equal_the_model(dut: Any) -> None:
    """Play scans with random networks at all event rates, after resets and scan_start."""
    config, rng = job(ClassifierConfig.from_dict)
    bench = ClassifierBench(dut, config, rng)
    bins = 6 if config.hidden > 4 else 24
    for number in range(3):
        await bench.load(random_network(config, rng))
        for rate in ("seldom", "bursts", "always"):
            await bench.play(random_scan(config, rng, bins, rate), reset=rng.random() < 0.5 or number == 0)
    report(bench.check.counts)


@cocotb.test()
async def scans_begin_at_any_time(dut: Any) -> None:
    """Play scans of one or two bins, each started at any point of the previous scan."""
    config, rng = job(ClassifierConfig.from_dict)
    bench = ClassifierBench(dut, config, rng)
    await bench.load(random_network(config, rng))
    work = 6 * config.hidden + config.hidden * (config.groups + config.classes)
    for number in range(SCANS):
        whole = random_scan(config, rng, 2, rng.choice(["seldom", "bursts", "always"]))
        clocks = rng.randint(1, whole.ends[-1] + work)
        cut = Stimulus([e for e in whole.events if e[0] < clocks], [e for e in whole.ends if e < clocks], clocks)
        await bench.play(cut, reset=number == 0)
    report(bench.check.counts)


def spaced(network: IntegerNetwork, counts: NDArray[Any]) -> Stimulus:
    """Return a scan with given events, shape (bins, inputs), in bins of minimum length."""
    config, state = network.config, State(network)
    clock, before = first_ready(config, -1), 0
    events, ends = [], []
    for row in counts:
        channels = np.repeat(np.arange(config.inputs), row).tolist()
        events += [(clock, channel) for channel in channels]
        clock += config.groups * len(channels) + 1
        ends.append(clock)
        state.add_counts(row[None])
        state.end_bin()
        now = int(state.spikes.sum())
        clock, before = clock + work_clocks(config, before, now) + 4, now
    return Stimulus(events, ends, clock)


@cocotb.test()
async def given_scans(dut: Any) -> None:
    """Play the scans of a file with the network of a file."""
    fields = json.loads(os.environ[JOB])
    network = IntegerWeights.load(Path(fields["network.npz"])).network
    bench = ClassifierBench(dut, network.config, random.Random(0))
    await bench.load(network)
    for number, counts in enumerate(np.load(fields["scans.npy"])):
        stimulus = spaced(network, counts)
        await bench.play(stimulus, reset=number == 0)
        bench.check.counts["clocks"] += stimulus.clocks
    report(bench.check.counts)


def play_scans(made: IntegerWeights, scans: NDArray[Any], simulator: Simulator, folder: Path) -> Counter[str]:
    """Compare a network's RTL with the model on events, shape (scans, bins, inputs); return the counts."""
    folder.mkdir(parents=True, exist_ok=True)
    made.save(folder / "network.npz")
    np.save(folder / "scans.npy", scans)
    files = {name: str((folder / name).resolve()) for name in ("network.npz", "scans.npy")}
    config = made.network.config
    return block.cosimulate(config, simulator, TOP, "given_scans", folder, 0, __name__, **files)


def cosimulate(
    config: ClassifierConfig, simulator: Simulator, folder: Path, seed: int, test: str = "scans_equal_the_model"
) -> Counter[str]:
    """Run a cocotb test of the classifier and return its counts."""
    return block.cosimulate(config, simulator, TOP, test, folder, seed, __name__)
