"""Testbench of the classifier: event source, bin timer, and comparison with the model."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eskin.cocotb_tests.bench.block import Block, Checker, signed_words
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.classifier.file import neuron_image, weight_image
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun, simulate

STALL_END = 2**24 - 1


@dataclass
class Stimulus:
    """Stimulus of a scan: events with clock and channel, clocks of ``bin_end``, length."""

    events: list[tuple[int, int]]
    ends: list[int]
    clocks: int


@dataclass
class Seen:
    """Outputs of the classifier during a scan."""

    accepted: list[int] = field(default_factory=list)  # clocks in which an event was taken
    # neurons in order of arrival
    hidden: list[tuple[int, int, int]] = field(default_factory=list)
    outputs: list[tuple[int, int, int]] = field(default_factory=list)
    classes: list[tuple[int, int, list[int]]] = field(default_factory=list)  # at every ``class_valid``
    overrun: list[int] = field(default_factory=list)  # ``overrun`` in every clock
    stalled: list[int] = field(default_factory=list)  # ``stall_count`` in every clock


class ClassifierBench:
    """A classifier with event source and bin timer, compared with the model in every scan."""

    def __init__(self, dut: Any, config: ClassifierConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.block.drive(rst=1, load_valid=0, load_neurons=0, load_address=0, load_data=0)
        self.block.drive(event_valid=0, event_channel=0, bin_end=0, scan_start=0)

    async def load(self, network: IntegerNetwork) -> None:
        """Write all weights of a network."""
        self.network = network
        await load_words(self.block, network, self.rng)

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
        seen, ends = Seen(), set(stimulus.ends)
        for clock in range(stimulus.clocks):
            await self._clock(stimulus, seen, clock, clock in ends)
        self.block.drive(event_valid=0, bin_end=0)
        self._compare(stimulus, seen, simulate(self.network, stimulus.events, stimulus.ends, stimulus.clocks))

    async def _clock(self, stimulus: Stimulus, seen: Seen, clock: int, ends: bool) -> None:
        block, number = self.block, len(seen.accepted)
        offered = number < len(stimulus.events) and stimulus.events[number][0] <= clock
        channel = stimulus.events[number][1] if offered else self.rng.randrange(self.config.inputs)
        block.drive(event_valid=offered, event_channel=channel, bin_end=ends)
        await block.settle()
        if offered and block.read("event_ready"):
            seen.accepted.append(clock)
        seen.overrun.append(block.read("overrun"))
        seen.stalled.append(block.read("stall_count"))
        for name, trace in (("hidden", seen.hidden), ("output", seen.outputs)):
            if block.read(f"{name}_valid"):
                spike = block.read(f"{name}_spike")
                trace.append((block.read(f"{name}_index"), block.read_signed(f"{name}_potential"), spike))
        if block.read("class_valid"):
            evidence = signed_words(block.read("evidence"), self.config.classes, self.config.evidence_bits)
            seen.classes.append((clock, block.read("class_index"), evidence))
        elif seen.classes:
            winner = block.read("class_index")
            self.check.holds("ClassHeldBetweenBins", winner == seen.classes[-1][1], (winner, seen.classes[-1]))
        await block.edge()

    def _compare(self, stimulus: Stimulus, seen: Seen, run: ClassifierRun) -> None:
        holds, counts, config = self.check.holds, self.check.counts, self.config
        counts["checks"] += 1
        holds("EveryEventTakenInItsClock", seen.accepted == run.accepted, (seen.accepted, run.accepted))
        late = min(run.overruns, default=stimulus.clocks)
        overrun = [int(clock > late) for clock in range(stimulus.clocks)]
        holds("OverrunFlagged", seen.overrun == overrun, (seen.overrun.index(1) if 1 in seen.overrun else None, late))
        holds("NoClockOfAStallUncounted", seen.stalled == self._stalls(stimulus, run), run.stalled)
        done = [number for number, valid in enumerate(run.valid) if valid < stimulus.clocks]
        classes = [(run.valid[n], run.bins[n].winner, run.bins[n].evidence.tolist()) for n in done]
        holds("ClassAndEvidence", seen.classes == classes, (seen.classes, classes))
        for name, got, neurons in (("Potential", seen.hidden, config.hidden), ("Output", seen.outputs, config.classes)):
            values = [(b.potential, b.spikes) if name == "Potential" else (b.output, b.output_spikes) for b in run.bins]
            expected = [
                (neuron, int(potential[neuron]), int(spikes[neuron]))
                for potential, spikes in values
                for neuron in range(neurons)
            ]
            complete = len(done) * neurons
            equal = got == expected[: len(got)] and len(got) >= complete
            wrong = next((pair for pair in zip(got, expected, strict=False) if pair[0] != pair[1]), len(got))
            holds(f"Every{name}", equal, wrong)
        counts["bins"] += len(done)
        counts["events"] += len(run.accepted)
        counts["stalls"] += run.stalled
        counts["overruns"] += len(run.overruns)
        counts["hidden spikes"] += sum(spike for *_, spike in seen.hidden)
        counts["output spikes"] += sum(spike for *_, spike in seen.outputs)
        counts["classes"] += len({winner for _, winner, _ in seen.classes})
        ends = lowest(config.membrane_bits), highest(config.membrane_bits)
        counts["at an end"] += sum(potential in ends for _, potential, _ in seen.hidden)

    @staticmethod
    def _stalls(stimulus: Stimulus, run: ClassifierRun) -> list[int]:
        """Return the expected stall count in every clock."""
        waits = np.zeros(stimulus.clocks + 1, np.int64)
        begin = 0
        for (offered, _), taken in zip(stimulus.events, [*run.accepted, stimulus.clocks], strict=False):
            since = max(offered, begin)
            waits[since + 1 : taken + 1] += 1
            begin = taken + 1
        counted: list[int] = np.minimum(waits.cumsum(), STALL_END)[: stimulus.clocks].tolist()
        return counted


async def load_words(block: Block, network: IntegerNetwork, rng: random.Random) -> None:
    """Write all weights of a network in random order of words."""
    words = [(0, address, word) for address, word in enumerate(weight_image(network))]
    words += [(1, address, word) for address, word in enumerate(neuron_image(network))]
    rng.shuffle(words)
    for neurons, address, word in words:
        block.drive(load_valid=1, load_neurons=neurons, load_address=address, load_data=word)
        await block.edge()
    block.drive(load_valid=0, load_address=rng.getrandbits(8), load_data=rng.getrandbits(8))
