"""Datasheet of the classifier, with times and waveforms from the golden model."""

import numpy as np

from eskin.flow.datasheet.sheet import Picture, Sheet, Wave
from eskin.model.classifier.chip import ready_of
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun, first_ready, simulate, work_clocks

SHOWN = 24
"""Largest number of clocks in a picture."""
EVENTS = 2
"""Events in the pictures: one on the highest channel, and one on the lowest channel."""


def two_events(config: ClassifierConfig) -> tuple[list[Wave], ClassifierRun, int]:
    """Simulate a bin with two events in a network with all weights zero, whose neurons never fire.

    Return the waveforms of the ports from the end of reset, the run, and the clock of ``bin_end``.
    """
    i, h, c = config.inputs, config.hidden, config.classes
    weights = (np.zeros(shape, np.int64) for shape in ((i, h), (h, h), (h, c), (h,), (c,)))
    end = first_ready(config, -1) + (EVENTS + 1) * config.groups
    clocks = end + work_clocks(config, 0, 0) + 8
    channels = [config.inputs - 1, 0]
    run = simulate(IntegerNetwork(config, *weights), [(0, channel) for channel in channels], [end], clocks)
    span, valid, winner = range(clocks), run.valid[0], run.bins[0].winner
    offered = [sum(clock > at for at in run.accepted) for clock in span]
    words = tuple(channels[number] if number < EVENTS else None for number in offered)
    waves = [
        Wave("event_valid", tuple(int(number < EVENTS) for number in offered)),
        Wave("event_ready", tuple(int(value) for value in ready_of(config, run, clocks))),
        *([Wave("event_channel", words, bus=True)] if config.channel_bits else []),
        Wave("bin_end", tuple(int(clock == end) for clock in span)),
        Wave("class_valid", tuple(int(clock == valid) for clock in span)),
        Wave("class_index", tuple(winner if clock >= valid else None for clock in span), bus=True),
    ]
    return waves, run, end


def sheet_of(config: ClassifierConfig) -> Sheet:
    """Return the datasheet of a classifier."""
    waves, run, end = two_events(config)

    def window(name: str, title: str, start: int) -> Picture:
        shown = [Wave(wave.name, wave.values[start : start + SHOWN], wave.bus) for wave in waves]
        return Picture(name, title, shown, start)

    events = window("event", "The first events after reset", max(first_ready(config, -1) - 4, 0))
    ends = window("class", "The end of a bin's work", max(run.valid[0] - SHOWN + 6, 0))
    values = {"memories": _memories(config), "latencies": _times(config, run), "bin_end": end}
    what = f"{config.inputs}-{config.hidden}-{config.classes}, {config.lanes} lanes"
    return Sheet(config, what, "classifier.md", values, (events, ends))


def _memories(config: ClassifierConfig) -> list[tuple[str, str, str, str]]:
    """Return the memories with their sizes."""
    rows = [
        ("rows of input weights", config.input_words, config.lanes * config.in_bits),
        ("rows of recurrent weights", config.recurrent_words, config.lanes * config.rec_bits),
        ("output weights and biases", config.neuron_words, config.neuron_weight_bits),
    ]
    if config.own_parameters:
        rows.append(
            ("thresholds and leaks, the upper bits of the biases", config.parameter_words, config.parameter_bits)
        )
    if config.synapse_shift:
        rows.append(("potentials, which `load_*` does not reach", config.hidden, config.membrane_bits))
    return [(what, f"{words}", f"{bits}", f"{words * bits}") for what, words, bits in rows]


def _times(config: ClassifierConfig, run: ClassifierRun) -> list[tuple[str, int]]:
    """Return the latencies in clocks."""
    work = run.latencies[0] - work_clocks(config, 0, 0)  # beside the work, of which the rest is
    most = work_clocks(config, 1, 1)
    return [
        ("end of reset to `event_ready`", first_ready(config, -1)),
        ("`scan_start` to `event_ready`", first_ready(config, 0)),
        ("from one event to the next", config.groups),
        ("`bin_end` to `class_valid`, no neuron fires", run.latencies[0]),
        ("`bin_end` to `class_valid`, all neurons fire in this bin and in the previous bin", work + most),
    ]
