"""Compare the classifier's RTL with the model in every clock, for random networks and events."""

import itertools
import json
import os
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import JOB, Block, Checker, Simulator, job, report
from eskin.cocotb_tests.runner import block
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.classifier.file import IntegerWeights, neuron_image, weight_image
from eskin.model.classifier.network import IntegerNetwork, State
from eskin.model.classifier.run import ClassifierRun, first_ready, simulate, work_clocks
from eskin.model.classifier.words import unpacked

TOP = "eskin_classifier"
SCANS = 120
STALL_END = 2**24 - 1


@dataclass
class Stimulus:
    """Stimulus of a scan: events with clock and channel, clocks of ``bin_end``, length."""

    events: list[tuple[int, int]]
    ends: list[int]
    clocks: int


class ClassifierBench:
    """A classifier with event source and bin timer, compared with the model in every scan."""

    def __init__(self, dut: Any, config: ClassifierConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.block.drive(rst=1, load_valid=0, load_neurons=0, load_address=0, load_data=0)
        self.block.drive(event_valid=0, event_channel=0, bin_end=0, scan_start=0)

    async def load(self, network: IntegerNetwork) -> None:
        """Write all weights of a network in random order of words."""
        self.network = network
        for inputs in loads(network, self.rng):
            self.block.drive(**inputs)
            await self.block.edge()

    async def play(self, stimulus: Stimulus, reset: bool) -> None:
        """Play a scan after a reset or ``scan_start``, and compare all outputs with the model."""
        if reset:
            await self.block.reset(self.rng.randint(1, 3))
            self.check.counts["resets"] += 1
        else:
            self.block.drive(scan_start=1, bin_end=self.rng.getrandbits(1))  # the classifier ignores bin_end
            await self.block.edge()
            self.block.drive(scan_start=0, bin_end=0)
            self.check.counts["scan starts"] += 1
        seen: dict[str, list[Any]] = {name: [] for name in PROPERTIES}
        ends = set(stimulus.ends)
        for clock in range(stimulus.clocks):
            await self._clock(stimulus, seen, clock, clock in ends)
        self.block.drive(event_valid=0, bin_end=0)
        run = simulate(self.network, stimulus.events, stimulus.ends, stimulus.clocks)
        expected, done = expected_of(self.config, stimulus, run)
        for name, values in expected.items():
            got = seen[name]
            whole = {"EveryPotential": done * self.config.hidden, "EveryOutput": done * self.config.classes}
            if name in whole and len(got) >= whole[name]:  # the last bin may have begun to leave
                values = values[: len(got)]
            pairs = enumerate(itertools.zip_longest(values, got))
            wrong = next((f"number {n}: expected {a}, got {b}" for n, (a, b) in pairs if a != b), "")
            self.check.holds(name, not wrong, wrong)
        self._count(seen, run, done)

    async def _clock(self, stimulus: Stimulus, seen: dict[str, list[Any]], clock: int, ends: bool) -> None:
        block, number = self.block, len(seen["EveryEventTakenInItsClock"])
        offered = number < len(stimulus.events) and stimulus.events[number][0] <= clock
        channel = stimulus.events[number][1] if offered else self.rng.randrange(self.config.inputs)
        block.drive(event_valid=offered, event_channel=channel, bin_end=ends)
        await block.settle()
        if offered and block.read("event_ready"):
            seen["EveryEventTakenInItsClock"].append(clock)
        seen["OverrunFlagged"].append(block.read("overrun"))
        seen["NoClockOfAStallUncounted"].append(block.read("stall_count"))
        for port, name in (("hidden", "EveryPotential"), ("output", "EveryOutput")):
            if block.read(f"{port}_valid"):
                potential, spike = block.read_signed(f"{port}_potential"), block.read(f"{port}_spike")
                seen[name].append((block.read(f"{port}_index"), potential, spike))
        if self.config.margin:
            seen["SureFromItsBin"].append(block.read("class_sure"))
        winner, classes = block.read("class_index"), seen["ClassAndEvidence"]
        if block.read("class_valid"):
            evidence = unpacked(block.read("evidence"), self.config.classes, self.config.evidence_bits)
            classes.append((clock, winner, evidence))
        elif classes:
            self.check.holds("ClassHeldBetweenBins", winner == classes[-1][1], (winner, classes[-1]))
        await block.edge()

    def _count(self, seen: dict[str, list[Any]], run: ClassifierRun, done: int) -> None:
        """Count what happened in a scan."""
        counts, hidden = self.check.counts, seen["EveryPotential"]
        ends = lowest(self.config.membrane_bits), highest(self.config.membrane_bits)
        happened = {"bins": done, "events": len(run.accepted), "stalls": run.stalled, "overruns": len(run.overruns)}
        happened["hidden spikes"] = sum(spike for *_, spike in hidden)
        happened["output spikes"] = sum(spike for *_, spike in seen["EveryOutput"])
        happened["classes"] = len({winner for _, winner, _ in seen["ClassAndEvidence"]})
        happened["early decisions"] = any(seen["SureFromItsBin"])
        happened["at an end"] = sum(potential in ends for _, potential, _ in hidden)
        counts.update(happened, runs=1)


PROPERTIES = (
    "EveryEventTakenInItsClock",
    "OverrunFlagged",
    "NoClockOfAStallUncounted",
    "ClassAndEvidence",
    "EveryPotential",
    "EveryOutput",
    "SureFromItsBin",
)


def expected_of(config: ClassifierConfig, stimulus: Stimulus, run: ClassifierRun) -> tuple[dict[str, list[Any]], int]:
    """Return the expected values of each property, and the number of complete bins."""
    late = min(run.overruns, default=stimulus.clocks)
    done = sum(valid < stimulus.clocks for valid in run.valid)
    potentials, outputs = (
        [
            (neuron, int(potential[neuron]), int(spikes[neuron]))
            for potential, spikes in values
            for neuron in range(neurons)
        ]
        for values, neurons in (
            ([(one.potential, one.spikes) for one in run.bins], config.hidden),
            ([(one.output, one.output_spikes) for one in run.bins], config.classes),
        )
    )
    classes = [(valid, one.winner, one.evidence.tolist()) for valid, one in zip(run.valid, run.bins, strict=True)]
    overrun = [int(clock > late) for clock in range(stimulus.clocks)]
    sure = min((valid for valid, one in zip(run.valid, run.bins, strict=True) if one.sure), default=stimulus.clocks)
    early = [int(clock >= sure) for clock in range(stimulus.clocks)] if config.margin else []
    values = (run.accepted, overrun, stalls(stimulus, run), classes[:done], potentials, outputs, early)
    return dict(zip(PROPERTIES, values, strict=True)), done


def stalls(stimulus: Stimulus, run: ClassifierRun) -> list[int]:
    """Return the expected stall count in every clock."""
    waits = np.zeros(stimulus.clocks + 1, np.int64)
    begin = 0
    for (offered, _), taken in zip(stimulus.events, [*run.accepted, stimulus.clocks], strict=False):
        since = max(offered, begin)
        waits[since + 1 : taken + 1] += 1
        begin = taken + 1
    counted: list[int] = np.minimum(waits.cumsum(), STALL_END)[: stimulus.clocks].tolist()
    return counted


def loads(network: IntegerNetwork, rng: random.Random) -> Iterator[dict[str, int]]:
    """Yield the inputs that write all weights of a network in random order of words, clock by clock."""
    words = [(0, address, word) for address, word in enumerate(weight_image(network))]
    words += [(1, address, word) for address, word in enumerate(neuron_image(network))]
    rng.shuffle(words)
    for neurons, address, word in words:
        yield {"load_valid": 1, "load_neurons": neurons, "load_address": address, "load_data": word}
    yield {"load_valid": 0, "load_address": rng.getrandbits(8), "load_data": rng.getrandbits(8)}


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
    clock, before = first_ready(config, -1), state.spikes[0]
    events, ends = [], []
    for row in counts:
        channels = np.repeat(np.arange(config.inputs), row).tolist()
        events += [(clock, channel) for channel in channels]
        clock += config.groups * len(channels) + 1
        ends.append(clock)
        state.add_counts(row[None])
        state.end_bin()
        now = state.spikes[0]
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
