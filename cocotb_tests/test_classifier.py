"""The classifier's RTL against the model: every potential, spike, class and clock, for random networks and events."""

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

from cocotb_tests.bench.block import JOB, report
from cocotb_tests.bench.classifier import ClassifierBench, Stimulus
from model.classifier.config import ClassifierConfig, highest, lowest
from model.classifier.network import IntegerNetwork

if TYPE_CHECKING:
    from cocotb_tests.session.runners import Simulator


SCANS = 120


def job() -> tuple[ClassifierConfig, random.Random]:
    """Return, within the simulator, the configuration of the test and its source of randomness."""
    fields = json.loads(os.environ[JOB])
    return ClassifierConfig.from_dict(fields["config"]), random.Random(fields["seed"])


def random_network(config: ClassifierConfig, rng: random.Random) -> IntegerNetwork:
    """Return a network with weights over all their bits, some rows at the ends of them, all biases."""
    generator = np.random.default_rng(rng.getrandbits(32))

    def drawn(bits: int, *shape: int) -> Any:
        values = generator.integers(lowest(bits), highest(bits) + 1, shape)
        at_end = generator.random(shape[0]) < 0.2
        values[at_end] = np.where(generator.random(shape)[at_end] < 0.5, lowest(bits), highest(bits))
        return values

    return IntegerNetwork.filled(config, drawn)


def random_scan(config: ClassifierConfig, rng: random.Random, bins: int, rate: str) -> Stimulus:
    """Return a scan whose events come ``seldom``, in ``bursts`` or ``always``, with bins that fit and that do not."""
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
    """Networks that are loaded anew, scans begun by reset and by scan_start, in mid-work, at all rates of events."""
    config, rng = job()
    bench = ClassifierBench(dut, config, rng)
    bins = 6 if config.hidden > 4 else 24
    for number in range(3):
        await bench.load(random_network(config, rng))
        for rate in ("seldom", "bursts", "always"):
            await bench.play(random_scan(config, rng, bins, rate), reset=rng.random() < 0.5 or number == 0)
    report(bench.check.counts)


@cocotb.test()
async def scans_begin_at_any_time(dut: Any) -> None:
    """Scans of a bin or two, each begun by scan_start wherever the one before has come to."""
    config, rng = job()
    bench = ClassifierBench(dut, config, rng)
    await bench.load(random_network(config, rng))
    work = 6 * config.hidden + config.hidden * (config.groups + config.classes)
    for number in range(SCANS):
        whole = random_scan(config, rng, 2, rng.choice(["seldom", "bursts", "always"]))
        clocks = rng.randint(1, whole.ends[-1] + work)
        cut = Stimulus([e for e in whole.events if e[0] < clocks], [e for e in whole.ends if e < clocks], clocks)
        await bench.play(cut, reset=number == 0)
    report(bench.check.counts)


PROPERTIES = (
    "EveryEventTakenInItsClock",
    "OverrunFlagged",
    "NoClockOfAStallUncounted",
    "ClassAndEvidence",
    "ClassHeldBetweenBins",
    "EveryPotential",
    "EveryOutput",
)


def network_of(inputs: int, hidden: int, classes: int, lanes: int, **own: Any) -> ClassifierConfig:
    """Return a configuration in one line, with thresholds at which neurons fire and do not."""
    base = {"threshold": 300, "out_threshold": 200, "clocks_per_bin": 64 * hidden}
    return ClassifierConfig(**(base | own), inputs=inputs, hidden=hidden, classes=classes, lanes=lanes)


FIRING = {"floor": -300, "out_floor": -200}
CONFIGS = [
    network_of(5, 12, 3, 4, **FIRING),
    network_of(1, 1, 1, 1, reset="async", threshold=30, out_threshold=20, **FIRING),
    network_of(2, 1, 3, 4, threshold=40, **FIRING),
    network_of(3, 9, 2, 1, neuron_reset="subtract", leak_shift=3, reset="async", **FIRING),
    network_of(7, 10, 6, 4, neuron_reset="subtract", floor=-50, membrane_bits=10, out_leak_shift=2),
    network_of(4, 16, 5, 2, in_bits=2, rec_bits=3, out_bits=5, in_shift=5, rec_shift=2, threshold=60, **FIRING),
    network_of(16, 33, 4, 16, in_bits=4, rec_bits=8, in_shift=3, leak_shift=1, readout="membrane", out_leak_shift=4),
    network_of(8, 20, 3, 8, membrane_bits=10, output_bits=9, evidence_bits=5, in_shift=3, rec_shift=6, out_shift=4),
    network_of(6, 8, 7, 8, bias_bits=16, bias_shift=2, out_bias_shift=3, membrane_bits=12, leak_shift=5, reset="async"),
    network_of(
        9, 17, 2, 32, bias_bits=2, out_bits=2, rec_bits=2, out_threshold=1, leak_shift=16, floor=0, out_floor=-3
    ),
]


def name(config: ClassifierConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.inputs}-{config.hidden}-{config.classes}-{config.lanes}l-{config.reset}"


def cosimulate(
    config: ClassifierConfig, simulator: Simulator, folder: Path, seed: int, test: str = "scans_equal_the_model"
) -> Counter[str]:
    """Run a cocotb test of the classifier and return what it counted."""
    from cocotb_tests.session.simulator import build  # not in the simulator, which imports this file too

    environment = {JOB: json.dumps({"config": config.to_dict(), "seed": seed})}
    program = build(config, simulator, top="eskin_classifier")
    program.test("cocotb_tests.test_classifier", folder, test, environment)
    return Counter(json.loads((folder / "counts.json").read_text()))


@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_rtl_equals_the_model_in_every_potential_class_and_clock(config: ClassifierConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", tmp_path, config.hidden)
    assert counts["events"] > 100
    assert counts["bins"] > 10
    assert counts["hidden spikes"] > 5
    assert counts["output spikes"] > 5 or config.readout == "membrane"
    assert counts["stalls"] > 100
    assert counts["overruns"] > 3
    assert counts["resets"] > 2
    assert counts["scan starts"] > 0
    assert config.classes == 1 or counts["classes"] > 3
    assert bool(counts["at an end"]) == config.saturates or config.hidden < 8
    assert all(counts[property_name] > 0 for property_name in PROPERTIES), counts


def test_a_scan_may_begin_at_any_time(tmp_path: Path) -> None:
    counts = cosimulate(CONFIGS[0], "icarus", tmp_path, 1, "scans_begin_at_any_time")
    assert counts["scan starts"] == SCANS - 1
    assert counts["overruns"] > 3
