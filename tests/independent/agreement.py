"""Compare the first model with the second."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from eskin.cocotb_tests.bench.analog import ideal
from eskin.cocotb_tests.independent.classifier import Network, Neuron
from eskin.cocotb_tests.independent.fields import signals
from eskin.cocotb_tests.independent.frame import FrameReadout
from eskin.cocotb_tests.independent.link import Receiver
from eskin.cocotb_tests.independent.merge import Merge
from eskin.cocotb_tests.independent.readout import Readout
from eskin.cocotb_tests.independent.settings import Settings
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.classifier.network import IntegerNetwork, group_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import first_difference
from eskin.model.frame import FrameStimulus
from eskin.model.frame_config import FrameConfig
from eskin.model.readout import Stimulus, simulate, state_at, strobes
from eskin.model.tiles.config import TilesConfig


def steps(config: ReadoutConfig, stimulus: Stimulus, readout: Any) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield each clock with the inputs of a readout, a ``Readout`` or what has its outputs, thresholds and strobes.

    The clock's edge is applied before the next. A comparator that follows the signal answers wrongly while its strobe
    is low.
    """
    receiver = Receiver(stimulus.ack_delay.tolist())
    samples = dict(zip(stimulus.sample_clock.tolist(), stimulus.samples.tolist(), strict=True))
    masks = dict(zip(stimulus.enable_clock.tolist(), stimulus.enable.tolist(), strict=True))
    signal, mask = [0] * config.taxels, None
    for clock in range(stimulus.clocks):
        mask, sample = masks.get(clock, mask), samples.get(clock)
        decisions = None
        if config.frontend == "analog" and stimulus.decisions is not None:
            decisions = [(bool(d & 1), bool(d & 2)) for d in stimulus.decisions[clock].tolist()]
        elif config.frontend == "analog":
            decisions = []
            for x, threshold, strobe in zip(signal, readout.thresholds(), readout.strobes(), strict=True):
                above, below = ideal(config, x, *threshold)
                decisions.append((above, below) if strobe else (not above, config.has_polarity and not below))
        inputs = {
            "sample_valid": sample is not None,
            "sample": sample,
            "enable": mask,
            "ready": bool(stimulus.ready[clock % len(stimulus.ready)]),
            "ack": receiver.ack_at(clock),
            "decisions": decisions,
        }
        yield clock, inputs
        receiver.see(readout.outputs().get("aer_req", 0), clock)
        if sample is not None and config.frontend == "analog":
            signal = signals(readout.settings, sample)


def play(config: ReadoutConfig, stimulus: Stimulus, readout: Readout | None = None) -> tuple[Events, Readout]:
    """Return the events of the second model, and its final state."""
    readout = readout or Readout(Settings.of(config.to_dict()))
    begun = len(readout.events)
    readout.asked = []
    for _, inputs in steps(config, stimulus, readout):
        readout.asked.append(readout.strobes())
        readout.clock(**inputs)
    events = [(t, x, y, bool(p)) for t, x, y, p in readout.events[begun:]]
    if config.protocol.rule().late and events and events[-1][0] == stimulus.clocks - 1:
        events.pop()  # nobody sees a REQ that rises at the last edge of a run
    return np.array(events, EVENT_DTYPE), readout


def differs(config: ReadoutConfig, stimulus: Stimulus, readout: Readout | None = None) -> str:
    """Return the first difference of both models in events or final registers, or an empty text."""
    expected = simulate(config, stimulus)
    events, readout = play(config, stimulus, readout)
    found = first_difference(expected, events)
    if found is not None:
        return found.describe(("first", "second"))
    if found := strobes_differ(config, stimulus, readout.asked):
        return found
    state, arbiter = state_at(config, stimulus, stimulus.clocks), readout.arbiter
    taxels = [taxel for row in readout.taxels for taxel in row]
    waiting = [taxel.request for taxel in taxels if taxel.request is not None]
    behind = range(arbiter.pointer or config.rows, config.rows)
    pairs = {
        "reference": (state.reference, [taxel.reference for taxel in taxels]),
        "pending": (state.pending, [taxel.request is not None for taxel in taxels]),
        "polarity": (state.polarity[state.pending] if config.has_polarity else [1] * len(waiting), waiting),
        "half-width": (state.half_width, [taxel.half_width() for taxel in taxels]),
        "latch": ([state.latch_columns], [sum(1 << column for _, column, _ in arbiter.queue)]),
        "latched row": ([state.latch_row] * len(arbiter.queue), [row for row, *_ in arbiter.queue]),
        "rows behind": ([state.behind & (1 << config.rows) - 1], [sum(1 << row for row in behind)]),
    }
    if config.frontend == "digital":
        pairs["sample"] = (state.sample, [taxel.sample for taxel in taxels])
    for name, (a, b) in pairs.items():
        if np.ravel(a).tolist() != np.ravel(b).tolist():
            return f"{name} at the end: first {np.ravel(a).tolist()}, second {np.ravel(b).tolist()}"
    return ""


def strobes_differ(config: ReadoutConfig, stimulus: Stimulus, asked: Any) -> str:
    """Return the first clock and taxel in which ``compare`` is not that of the model, or an empty text."""
    if config.frontend != "analog":
        return ""
    places = np.argwhere(strobes(config, stimulus) != np.reshape(asked, (-1, config.taxels)))
    return f"compare of taxel {places[0, 1]} differs in clock {places[0, 0]}" if len(places) else ""


def play_skin(config: TilesConfig, stimuli: list[Stimulus]) -> Events:
    """Return the events of a skin computed by the second model."""
    tiles = [Readout(Settings.of(config.tile.to_dict())) for _ in stimuli]
    merge = Merge(config.tiles)
    events = []
    of_tiles = (steps(config.tile, stimulus, tile) for stimulus, tile in zip(stimuli, tiles, strict=True))
    for now in zip(*of_tiles, strict=True):
        clock, ready = now[0][0], now[0][1]["ready"]
        offered = [tile.arbiter.output() for tile in tiles]
        if merge.output() and ready:
            number, (row, column, polarity) = merge.output()
            down, across = divmod(number, config.tile_columns)
            x, y = across * config.tile.columns + column, down * config.tile.rows + row
            events.append((clock, x, y, bool(polarity)))
        taken = merge.taken(offered)
        merge.clock(offered, ready)
        for number, (_, inputs) in enumerate(now):
            tiles[number].clock(**inputs | {"ready": number == taken})
    return np.array(events, EVENT_DTYPE)


def play_frames(config: FrameConfig, stimulus: FrameStimulus) -> tuple[list, list, list]:
    """Return words, starts and missed frames of the second frame model."""
    frame = FrameReadout(
        config.rows, config.columns, config.resolution, config.word_bits, settle_clocks=config.settle_clocks
    )
    words, starts, missed = [], [], []
    conversions = 0
    done, code, tick = None, 0, -1
    for clock in range(stimulus.clocks):
        while tick + 1 < len(stimulus.sample_clock) and stimulus.sample_clock[tick + 1] <= clock:
            tick += 1
        ready = bool(stimulus.ready[clock % len(stimulus.ready)])
        outputs = frame.outputs()
        if outputs["frame_overrun"]:
            missed.append(clock - 1)
        if outputs["word_valid"] and ready:
            words.append((clock, bool(outputs["word_sync"]), outputs["word_data"]))
        inputs = {"frame_start": clock in stimulus.frame_clock, "adc_done": clock == done, "adc_code": code}
        if outputs["adc_start"]:
            row, column = (outputs[name].bit_length() - 1 for name in ("row_select", "column_select"))
            taxel = row * config.columns + column
            starts.append((clock, taxel))
            done = clock + int(stimulus.conversion[conversions % len(stimulus.conversion)])
            conversions += 1
            code = int(stimulus.samples[tick, taxel]) // 2 ** (config.sample_bits - config.resolution)
        frame.clock(word_ready=ready, **inputs)
    return words, starts, missed


def network_of(first: IntegerNetwork) -> Network:
    """Return the second model of a network."""
    config = first.config
    fires = config.readout == "spikes"
    hidden = [
        Neuron(
            config.membrane_bits, bias << config.bias_shift, threshold, config.floor,
            (shift, config.leak_factor), (config.synapse_shift, config.synapse_factor), config.neuron_reset,
        )
        for bias, threshold, shift in zip(
            first.b_hidden.tolist(), first.threshold.tolist(), first.leak.tolist(), strict=True
        )
    ]  # fmt: skip
    outputs = [
        Neuron(
            config.output_bits, bias << config.out_bias_shift, threshold,
            config.out_floor if fires else None, (shift, config.out_leak_factor),
            (config.out_synapse_shift, config.out_synapse_factor), config.neuron_reset, fires,
        )
        for bias, threshold, shift in zip(
            first.b_out.tolist(), first.out_threshold.tolist(), first.out_leak.tolist(), strict=True
        )
    ]  # fmt: skip
    w_in, w_rec, w_out = (
        (weights << shift).tolist()
        for weights, shift in (
            (first.w_in, config.in_shift),
            (first.w_rec, config.rec_shift),
            (first.w_out, config.out_shift),
        )
    )
    groups = group_of(config).tolist()
    return Network(w_in, w_rec, w_out, hidden, outputs, config.evidence_bits, groups, config.margin)
