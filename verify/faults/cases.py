"""Tests with hostile inputs, each with the expected behaviour."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig
from eskin.model.links.link import Link
from eskin.model.readout import Stimulus
from eskin.model.readout import simulate as simulate_model
from eskin.rtl.readout import Readout
from eskin.verify.faults.bench import bench_gates
from eskin.verify.faults.gates import LANES, simulate
from eskin.verify.faults.scenario import RESET, codes_of, course, events_of, inputs_of

STUCK = 300
"""Clocks for which a signal is stuck."""
PHASES = 200
"""Number of clocks in which a disturbance can begin, one in each run."""


@dataclass(frozen=True)
class Case:
    """A test with one kind of hostile input."""

    name: str
    stated: str  # documented behaviour
    # returns the number of runs with this behaviour, and the number of runs
    holds: Callable[[ReadoutConfig], tuple[int, int]]
    fits: Callable[[Link], bool] = lambda link: True  # whether the test suits a link


def _play(
    config: ReadoutConfig, inputs: dict[str, NDArray[np.uint8]]
) -> tuple[dict[str, NDArray[np.int64]], NDArray[np.int16]]:
    """Simulate runs with different inputs; return the outputs and the events of each run."""
    gates = bench_gates(Readout(config))
    driven = {name: bits for name, bits in inputs.items() if name in gates.inputs}
    outputs = simulate(gates, driven, np.zeros((0, 3), np.int64))
    ready = inputs["event_ready"]
    return outputs, codes_of(config, outputs, ready if ready.ndim == 2 else ready[:, 0])


def _from(clocks: int, first: int, length: int) -> NDArray[np.bool_]:
    """Return True for ``length`` clocks from ``first + p`` in each run p >= 1, shape (clocks, LANES)."""
    since = np.arange(clocks)[:, None] - first - np.arange(LANES)
    mine = (np.arange(LANES) >= 1) & (np.arange(LANES) <= PHASES)
    return (since >= 0) & (since < length) & mine


def _disturbed(
    config: ReadoutConfig, calm: bool, port: str, length: int
) -> tuple[Stimulus, NDArray[np.bool_], dict[str, NDArray[np.int64]], NDArray[np.int16]]:
    """Invert an input for ``length`` clocks, at a different time in each run.

    Return stimulus, clocks in which the input is inverted, outputs, and events of each run.
    """
    played = course(config, calm)
    when = _from(len(played.inputs[port]), RESET, length)
    inverted = played.inputs[port][:, :, None] ^ when[:, None, :]
    return played.stimulus, when, *_play(config, played.inputs | {port: inverted.astype(np.uint8)})


def _equal(config: ReadoutConfig, codes: NDArray[np.int16], stimulus: Stimulus) -> bool:
    """Return True if a run has events and equals the model."""
    expected = simulate_model(config, stimulus)
    found = events_of(config, codes)
    last = stimulus.clocks - 1  # the link may have an event at the last edge that no receiver samples
    found, expected = (events[(events["t"] >= 0) & (events["t"] < last)] for events in (found, expected))
    return len(expected) > 0 and np.array_equal(found, expected)


def _changed(config: ReadoutConfig, played: Stimulus, **changes: NDArray[Any]) -> tuple[int, int]:
    """Simulate a stimulus with changes, and compare it with the model."""
    stimulus = dataclasses.replace(played, **changes)  # type: ignore[arg-type]
    _, codes = _play(config, inputs_of(config, stimulus))
    return int(_equal(config, codes[:, 0], stimulus)), 1


def every_sample(config: ReadoutConfig) -> tuple[int, int]:
    """Compare a run with a new random sample in every clock with the model."""
    played = course(config, calm=False).stimulus
    codes = np.random.default_rng(1).integers(-config.full_scale, config.full_scale, (played.clocks, config.taxels))
    return _changed(config, played, samples=codes.astype(np.int32), sample_clock=np.arange(played.clocks))


def every_mask(config: ReadoutConfig) -> tuple[int, int]:
    """Compare a run with a new random mask in every clock with the model."""
    played = course(config, calm=False).stimulus
    masks = np.random.default_rng(1).random((played.clocks, config.taxels)) < 0.8
    return _changed(config, played, enable=masks, enable_clock=np.arange(played.clocks))


def reset_at_every_phase(config: ReadoutConfig) -> tuple[int, int]:
    """Reset for one clock, at a different time in each run, and check the events before and after."""
    stimulus, _, _, codes = _disturbed(config, False, "rst", 1)
    good = 0
    for phase in range(1, PHASES + 1):
        before = dataclasses.replace(stimulus, clocks=phase + 1)
        found = events_of(config, codes[: RESET + phase + 1, phase])
        expected = simulate_model(config, before)
        late = found["t"] == phase  # an event of the link that no clock is left to see
        if not np.array_equal(found[~late] if config.protocol.rule().late else found, expected):
            continue
        good += _equal(config, codes[phase + 1 :, phase], _rest(stimulus, phase + 1))
    return good, PHASES


def _rest(stimulus: Stimulus, start: int) -> Stimulus:
    """Return the rest of a stimulus from a clock on."""
    later = stimulus.sample_clock >= start
    number = int(np.searchsorted(stimulus.enable_clock, start, side="right")) - 1
    masks = stimulus.enable_clock[number:] - start
    masks[0] = 0
    return dataclasses.replace(
        stimulus,
        samples=stimulus.samples[later],
        sample_clock=stimulus.sample_clock[later] - start,
        clocks=stimulus.clocks - start,
        enable_clock=masks,
        enable=stimulus.enable[number:],
        ready=stimulus.ready[start:],
    )


def sink_stuck(config: ReadoutConfig) -> tuple[int, int]:
    """Stop the sink at a different time in each run, and compare all events with the model."""
    played = course(config, calm=False)
    stimulus, inputs = played.stimulus, dict(played.inputs)
    stops = _from(len(inputs["rst"]), RESET, STUCK)
    ready = np.where(stops, 0, inputs["event_ready"])
    inputs["event_ready"] = ready[:, None, :].astype(np.uint8)
    outputs, codes = _play(config, inputs)
    valid = outputs["event_valid"]
    good = 0
    for phase in range(1, PHASES + 1):
        still = slice(RESET + phase, RESET + phase + STUCK)
        waits = np.diff(valid[still, phase]).min() >= 0  # an offered event stays
        good += waits and _equal(
            config, codes[:, phase], dataclasses.replace(stimulus, ready=ready[RESET:, phase].astype(np.uint8))
        )
    return good, PHASES


def ack_never_falls(config: ReadoutConfig) -> tuple[int, int]:
    """Hold ACK high from a different time in each run; check that no REQ rises and no event is lost."""
    _, stuck, outputs, codes = _disturbed(config, True, "ack_high", STUCK)
    req = np.sum([outputs[name] for name in config.protocol.requests], axis=0)
    rises = np.diff(req, axis=0, prepend=0) > 0
    # A REQ on its way when ACK sticks still rises; the edges of ACK take five of an event's clocks, its flops two.
    settled = stuck & np.roll(stuck, config.protocol.clocks_per_event - 5 + 2, axis=0)
    quiet = ~(rises & settled).any(axis=0)
    alike = _balance(config, codes) == _balance(config, codes[:, :1])
    return int((quiet & alike.all(axis=0))[1 : PHASES + 1].sum()), PHASES


def ack_glitches(config: ReadoutConfig) -> tuple[int, int]:
    """Invert ACK for one clock at a different time in each run, and check that each REQ carries one event."""
    *_, codes = _disturbed(config, True, "ack_turned", 1)
    alike = _balance(config, codes) == _balance(config, codes[:, :1])
    return int(alike.all(axis=0)[1 : PHASES + 1].sum()), PHASES


def _balance(config: ReadoutConfig, codes: NDArray[np.int16]) -> NDArray[np.int64]:
    """Return ON minus OFF events of every taxel, shape (taxels, runs)."""
    kinds = [[(codes == 2 * taxel + on).sum(axis=0) for on in (0, 1)] for taxel in range(config.taxels)]
    return np.array([on - off for off, on in kinds])


CASES = (
    Case("sample_valid in every clock", "every event is that of the model, clock by clock", every_sample),
    Case("another mask in every clock", "every event is that of the model, clock by clock", every_mask),
    Case(
        "reset at every phase",
        "events before and after the reset are those of the model; latched events and the event on the link are lost",
        reset_at_every_phase,
    ),
    Case(
        "sink stuck",
        "the offered event stays; waiting taxels do not change; all events are those of the model",
        sink_stuck,
        lambda link: link.streams,
    ),
    Case(
        "ACK never falls",
        "no REQ while ACK is high; after that the readout sends every event",
        ack_never_falls,
        lambda link: link.asynchronous,
    ),
    Case(
        "ACK wrong for a clock",
        "REQ falls early or late; no event is lost or sent twice",
        ack_glitches,
        lambda link: link.asynchronous,
    ),
)


def cases(config: ReadoutConfig) -> list[Case]:
    """Return the tests for a configuration."""
    return [case for case in CASES if case.fits(config.protocol)]
