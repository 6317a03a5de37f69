"""Model of a chip with readout and classifier, cycle-accurate also under backpressure."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.model.address_events import Events, make_events, taxel_of
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun, first_ready, simulate, work_clocks


@dataclass(frozen=True)
class ChipRun:
    """Events, clocks and classes of one simulated run of a chip."""

    events: Events  # that the classifier took; all ON if it ignores polarity
    classifier: ClassifierRun


def clocks_of(config: ChipConfig, ticks: int) -> tuple[int, int]:
    """Return the number of complete bins in a scan, and the number of clocks until the last class is valid.

    The scan ends before the next bin, so the class belongs to the scan.
    """
    classifier = config.classifier
    bins = ticks * config.readout.clocks_per_sample // classifier.clocks_per_bin
    work = work_clocks(classifier, 1, 1) + classifier.groups + 8
    return bins, bins * classifier.clocks_per_bin + min(work, classifier.clocks_per_bin - 1)


def channels_of(config: ChipConfig, events: Events) -> NDArray[np.int64]:
    """Return the network input channel of every event."""
    off = config.readout.taxels if config.polarity else 0
    return taxel_of(events, config.readout) + np.where(events["p"], 0, off)


def events_of(config: ChipConfig, clock: NDArray[np.int64], channel: NDArray[np.int64]) -> Events:
    """Return the events of the given clocks and input channels."""
    taxels = config.readout.taxels
    return make_events(clock, *np.divmod(channel % taxels, config.readout.columns), channel < taxels)


def simulate_chip(config: ChipConfig, network: IntegerNetwork, samples: NDArray[np.integer], clocks: int) -> ChipRun:
    """Simulate a chip from the end of reset.

    The readout receives the clocks in which the classifier is ready, and the classifier those of offered events. A
    clock depends only on earlier clocks. Each round is therefore right for longer than the previous round, and both are
    right when nothing changes any more. ``samples`` has the shape (ticks, taxels).
    """
    from eskin.model.readout import Stimulus  # compiles the model
    from eskin.model.readout import simulate as simulate_readout

    network = dataclasses.replace(network, config=config.classifier)
    width = config.classifier.clocks_per_bin
    ends = range(width - 1, clocks, width)
    ready = np.ones(clocks, np.uint8)
    while True:
        stimulus = Stimulus.from_samples(config.readout, samples, clocks=clocks, ready=ready)
        events = simulate_readout(config.readout, stimulus)
        offered = list(zip(events["t"].tolist(), channels_of(config, events).tolist(), strict=True))
        run = simulate(network, offered, ends, clocks)
        found = ready_of(config.classifier, run, clocks)
        if np.array_equal(found, ready):
            if not config.polarity:
                events["p"] = True
            return ChipRun(events, run)
        ready = found


def ready_of(config: ClassifierConfig, run: ClassifierRun, clocks: int) -> NDArray[np.uint8]:
    """Return for every clock of a run whether the classifier is ready for an event."""
    change = np.zeros(clocks + 1, np.int64)
    taken = np.asarray(run.accepted, np.int64)
    # Not ready: after an event for the rest of its row, from a bin's end to the last clock of its work, in a clear.
    begins = np.concatenate([taken + 1, np.asarray(run.ended, np.int64) + 1, [0]])
    stops = np.concatenate([taken + config.groups, np.asarray(run.valid, np.int64) - 1, [first_ready(config, -1)]])
    np.add.at(change, np.minimum(begins, clocks), 1)
    np.add.at(change, np.minimum(stops, clocks), -1)
    return (change.cumsum()[:clocks] == 0).astype(np.uint8)
