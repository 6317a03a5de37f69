"""Runs of a chip in the harness, and their comparison with the models of readout and classifier."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.files import write_arrays
from eskin.cocotb_tests.bench.readout import Mismatch, Outcome, write_stimulus
from eskin.model.address_events import Events
from eskin.model.classifier.chip import channels_of, clocks_of, events_of
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import neuron_image, weight_image
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun
from eskin.model.classifier.run import simulate as simulate_classifier
from eskin.model.classifier.words import unpacked
from eskin.model.events.compare import first_difference
from eskin.model.readout import Stimulus, simulate

FACTOR, ADDED, MASK = 6364136223846793005, 1442695040888963407, 2**64 - 1
"""Constants of the weighted sums that the harness computes (``mixed`` in harness.v)."""

OF_A_BIN = (
    "clock, class, early decision, overrun, stalls, sum of hidden potentials and spikes, sum of outputs, evidence"
)


@dataclass(frozen=True)
class ChipRun:
    """Outputs of a chip during a scan."""

    # clock from which an event waited, clock in which the classifier took it, and its channel, each of shape (events,)
    offered: NDArray[np.int64]
    taken: NDArray[np.int64]
    channel: NDArray[np.int64]
    left: int | None  # clock from which an event waits at the end of the run
    classes: list[list[Any]]  # ``OF_A_BIN`` at every ``class_valid``; evidence is a list
    spikes: NDArray[np.int64]  # bin and neuron, shape (spikes, 2)

    @classmethod
    def read(cls, config: ClassifierConfig, folder: Path, left: int) -> ChipRun:
        """Return the outputs recorded by the harness in a folder."""
        events = np.fromfile(folder / "events.txt", np.int64, sep=" ").reshape(-1, 3)
        spikes = np.fromfile(folder / "spikes.txt", np.int64, sep=" ").reshape(-1, 2)
        classes = []
        for line in (folder / "classes.txt").read_text().splitlines():
            *numbers, word = line.split()
            classes.append([*map(int, numbers), unpacked(int(word, 16), config.classes, config.evidence_bits)])
        offered, taken, channel = events.T
        return cls(offered, taken, channel, left - 1 if left else None, classes, spikes)

    def ready(self, clocks: int) -> NDArray[np.uint8]:
        """Return 0 for every clock in which an event waited, else 1."""
        change = np.zeros(clocks + 1, np.int64)
        np.add.at(change, self.offered, 1)
        np.add.at(change, self.taken, -1)
        if self.left is not None:
            change[self.left] += 1
        return (change.cumsum()[:clocks] == 0).astype(np.uint8)

    def events(self, config: ChipConfig) -> Events:
        """Return the events with the addresses of their input channels."""
        return events_of(config, self.taken, self.channel)


@dataclass(frozen=True)
class ChipScan:
    """A run of a chip: samples, shape (ticks, taxels), that are compared with the models of readout and classifier."""

    config: ChipConfig
    network: IntegerNetwork
    name: str
    samples: NDArray[Any]
    repeat_command: str  # command that repeats it
    keep: Path  # file for the outputs of the RTL
    metadata: dict[str, Any]  # of this file
    skip: bool = False  # the harness skips the clocks in which the chip is not awake, if it can

    @property
    def stimulus(self) -> Stimulus:
        """Stimulus of the readout."""
        _, clocks = clocks_of(self.config, len(self.samples))
        return Stimulus.from_samples(self.config.readout, self.samples, clocks=clocks)

    def write(self, folder: Path) -> None:
        """Write the files that the harness plays."""
        write_stimulus(self.config.readout, folder, self.stimulus)
        for name, image in (("weights", weight_image(self.network)), ("neurons", neuron_image(self.network))):
            (folder / f"{name}.hex").write_text("".join(f"{word:x}\n" for word in image))

    def report(self, folder: Path, outcome: Outcome) -> dict[str, Any]:
        """Compare all outputs with the models, write them into the file, and return the totals.

        The totals have the class after the last complete bin; ``ideal``, the class without waiting events and with
        exact bins; with a margin ``early``, bin and class of the early decision; and the counts of the run. The file
        has events (``taken``, ``channel``), hidden ``spikes`` (bin, neuron), clocks of the classes (``valid``) and
        their ``evidence``.
        """
        stimulus, (whole, clocks) = self.stimulus, clocks_of(self.config, len(self.samples))
        run = ChipRun.read(self.config.classifier, folder, outcome.left)
        if outcome.errors:
            raise Mismatch(f"between readout and classifier: {outcome.breaches}; reproduce: {self.repeat_command}")
        model = hold(self.config, self.network, stimulus, run, self.repeat_command)
        if len(run.classes) != whole:
            raise Mismatch(f"{len(run.classes)} classes came from {whole} bins; reproduce: {self.repeat_command}")
        counts = counts_of(self.config, simulate(self.config.readout, stimulus), whole)
        evidence, _ = self.network.run_counts(counts[None])
        last = run.classes[-1]
        found = {
            "class": last[1],
            "ideal": int(evidence[0].argmax()),
            "bins": whole,
            "clocks": clocks,
            "events": len(run.taken),
            "hidden_spikes": len(run.spikes),
            "stalls": last[4],
            "overruns": last[3],
            "latency_clocks": max(model.latencies),
        }
        if self.config.classifier.margin:
            found["early"] = next(([bin_, line[1]] for bin_, line in enumerate(run.classes, 1) if line[2]), None)
        recorded = {"taken": run.taken, "channel": run.channel, "spikes": run.spikes}
        recorded["valid"] = np.array([line[0] for line in run.classes])
        recorded["evidence"] = np.array([line[-1] for line in run.classes])
        recorded["metadata"] = np.array(json.dumps(self.metadata | found))
        write_arrays(self.keep, recorded, compressed=True)
        return {"name": self.name} | found


def counts_of(config: ChipConfig, events: Events, whole: int) -> NDArray[np.int64]:
    """Return the event counts of every complete bin, shape (bins, channels)."""
    counts = np.zeros((whole, config.classifier.inputs), np.int64)
    step = events["t"] // config.classifier.clocks_per_bin
    inside = step < whole
    np.add.at(counts, (step[inside], channels_of(config, events)[inside]), 1)
    return counts


def network_of(chip: ChipConfig) -> IntegerNetwork:
    """Return a random network whose spikes and classes change often."""
    rng, config = np.random.default_rng(1), chip.classifier
    return IntegerNetwork(
        config,
        rng.integers(-40, 90, (config.inputs, config.hidden)),
        rng.integers(-60, 60, (config.hidden, config.hidden)),
        rng.integers(-60, 90, (config.hidden, config.classes)),
        rng.integers(-20, 20, config.hidden),
        rng.integers(-20, 20, config.classes),
    )


def hold(
    config: ChipConfig, network: IntegerNetwork, stimulus: Stimulus, run: ChipRun, repeat_command: str
) -> ClassifierRun:
    """Compare a run with both models; raise Mismatch at the first difference.

    The readout's model receives the clocks in which the classifier was not ready. These clocks are compared with the
    classifier's model, which receives the clocks in which the readout offered its events.
    """
    expected = simulate(config.readout, dataclasses.replace(stimulus, ready=run.ready(stimulus.clocks)))
    if not config.polarity:
        expected["p"] = 1
    if (difference := first_difference(expected, run.events(config))) is not None:
        raise Mismatch(f"events differ\n{difference.describe(('model', 'RTL'))}\nreproduce: {repeat_command}")
    offered = list(zip(run.offered.tolist(), run.channel.tolist(), strict=True))
    width = config.classifier.clocks_per_bin
    model = simulate_classifier(network, offered, range(width - 1, stimulus.clocks, width), stimulus.clocks)
    _same("clock in which the classifier takes an event", model.accepted, run.taken.tolist(), repeat_command)
    waits = np.concatenate([[0], (run.ready(stimulus.clocks) == 0).cumsum()])
    late = min(model.overruns, default=stimulus.clocks)
    lines = []
    for clock, found in zip(model.valid, model.bins, strict=True):
        if clock < stimulus.clocks:
            sums = [mixed(found.potential, found.spikes), mixed(found.output, found.output_spikes)]
            flags = [int(found.sure), int(clock > late), int(waits[clock])]
            lines.append([clock, found.winner, *flags, *sums, found.evidence.tolist()])
    _same(f"bin ({OF_A_BIN})", lines, run.classes, repeat_command)
    return model


def mixed(potentials: NDArray[np.int64], spikes: NDArray[np.int64]) -> int:
    """Return a position-weighted sum over neurons, as computed by the harness."""
    total = 0
    for value in (2 * potentials + spikes).tolist():
        total = (total * FACTOR + value + ADDED) & MASK
    return total


def _same(what: str, expected: list[Any], got: list[Any], repeat_command: str) -> None:
    """Raise Mismatch at the first difference between two lists."""
    if expected == got:
        return
    at = next((n for n, (a, b) in enumerate(zip(expected, got, strict=False)) if a != b), min(len(expected), len(got)))
    wanted, found = ([*some, "nothing"][min(at, len(some))] for some in (expected, got))
    raise Mismatch(
        f"{what}, number {at}: model {json.dumps(wanted)}, RTL {json.dumps(found)}\nreproduce: {repeat_command}"
    )
