"""Datasheet of the classifier, with times and waveforms from the golden model."""

from __future__ import annotations

import numpy as np

from eskin.flow.datasheet.sheet import Picture, Sheet
from eskin.flow.datasheet.waves import Wave
from eskin.model.classifier.chip import ready_of
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun, first_ready, simulate, work_clocks

SHOWN = 24
"""Largest number of clocks in a picture."""
EVENTS = 2
"""Events in the pictures: one on the highest channel, and one on the lowest channel."""


class TwoEvents:
    """Simulation of a bin with two events in a network with all weights zero; ``end`` is the clock of ``bin_end``."""

    def __init__(self, config: ClassifierConfig) -> None:
        self.config = config
        ready = first_ready(config, -1)
        self.end = ready + (EVENTS + 1) * config.groups
        self.clocks = self.end + work_clocks(config, 0, 0) + 8
        offered = [(0, config.inputs - 1), (0, 0)]
        self.run: ClassifierRun = simulate(_silent(config), offered, [self.end], self.clocks)

    def waves(self) -> list[Wave]:
        """Return the waveforms of the ports from the end of reset."""
        ready = ready_of(self.config, self.run, self.clocks)
        channels = [self.config.inputs - 1, 0]
        span, taken, valid = range(self.clocks), self.run.accepted, self.run.valid[0]
        offered = [sum(clock > at for at in taken) for clock in span]
        found = [Wave("event_valid", tuple(int(number < EVENTS) for number in offered))]
        found.append(Wave("event_ready", tuple(int(value) for value in ready)))
        if self.config.channel_bits:
            values = tuple(channels[number] if number < EVENTS else None for number in offered)
            found.append(Wave("event_channel", values, bus=True))
        found.append(Wave("bin_end", tuple(int(clock == self.end) for clock in span)))
        found.append(Wave("class_valid", tuple(int(clock == valid) for clock in span)))
        winner = self.run.bins[0].winner
        return [*found, Wave("class_index", tuple(winner if clock >= valid else None for clock in span), bus=True)]


def _silent(config: ClassifierConfig) -> IntegerNetwork:
    """Return a network whose neurons never fire."""
    i, h, c = config.inputs, config.hidden, config.classes
    shapes = ((i, h), (h, h), (h, c), (h,), (c,))
    return IntegerNetwork(config, *(np.zeros(shape, np.int64) for shape in shapes))


def sheet_of(config: ClassifierConfig) -> Sheet:
    """Return the datasheet of a classifier."""
    played = TwoEvents(config)
    waves, ready = played.waves(), first_ready(config, -1)
    events = _window("event", "The first events after reset", waves, max(ready - 4, 0))
    ends = _window("class", "The end of a bin's work", waves, max(played.run.valid[0] - SHOWN + 6, 0))
    values = {"memories": _memories(config), "latencies": _times(config, played.run), "bin_end": played.end}
    what = f"{config.inputs}-{config.hidden}-{config.classes}, {config.lanes} lanes"
    return Sheet(config, what, "classifier.md", values, (events, ends))


def _window(name: str, title: str, waves: list[Wave], start: int) -> Picture:
    """Return a timing diagram of a range of clocks."""
    return Picture(name, title, [Wave(w.name, w.values[start : start + SHOWN], w.bus) for w in waves], start)


def _memories(config: ClassifierConfig) -> list[tuple[str, str, str, str]]:
    """Return the memories with their sizes."""
    rows = [
        ("rows of input weights", config.input_words, config.lanes * config.in_bits),
        ("rows of recurrent weights", config.recurrent_words, config.lanes * config.rec_bits),
        ("output weights and biases", config.neuron_words, config.neuron_bits),
    ]
    if config.synapse_shift:
        rows.append(("potentials, which `load_*` does not reach", config.hidden, config.membrane_bits))
    return [(what, f"{words}", f"{bits}", f"{words * bits}") for what, words, bits in rows]


def _times(config: ClassifierConfig, run: ClassifierRun) -> list[tuple[str, int]]:
    """Return the latencies in clocks."""
    work = run.latencies[0] - work_clocks(config, 0, 0)  # beside the work, of which the rest is
    most = work_clocks(config, config.hidden, config.hidden)
    return [
        ("end of reset to `event_ready`", first_ready(config, -1)),
        ("`scan_start` to `event_ready`", first_ready(config, 0)),
        ("from one event to the next", config.groups),
        ("`bin_end` to `class_valid`, no neuron fires", run.latencies[0]),
        ("`bin_end` to `class_valid`, all neurons fire in this bin and in the previous bin", work + most),
    ]
