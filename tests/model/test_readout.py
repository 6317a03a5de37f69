"""Compare the model with the independent model, and check section 3 of docs/specification.md."""

from __future__ import annotations

import copy
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from eskin.cocotb_tests.independent.readout import Readout
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import Taxel
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import Stimulus, simulate, state_at
from eskin.model.taxel import EVENT_LATENCY
from tests.independent.agreement import differs, steps
from tests.model.refused import refused

SMALL = [(1, 1), (1, 4), (3, 5), (2, 2), (6, 1)]
ARRAYS = [*SMALL * 3, (1, 64), (2, 33), (17, 3)]  # of the large ones few: the independent model takes ten times as long
ENCODINGS = registry.NAMES


@st.composite
def configs(draw: st.DrawFn, **fixed: Any) -> ReadoutConfig:
    """Return a random configuration of a small array."""
    rows, columns = draw(st.sampled_from(ARRAYS))
    bits = draw(st.sampled_from([3, 5, 8, 12]))
    parameters: dict[str, Any] = {
        "rows": rows,
        "columns": columns,
        "encoding": draw(st.sampled_from(ENCODINGS)),
        "sample_bits": bits,
        "resolution": draw(st.sampled_from(sorted({1, min(2, bits - 2), (bits - 1) // 2, bits - 2}))),
        "decide_every": draw(st.sampled_from(["clock", "sample"])),
        "closing_shift": draw(st.sampled_from([0, 1, 2, 16])),
        "window_period": draw(st.sampled_from([1, 2, 5])),
        "leak_shift": draw(st.sampled_from([1, 2, 4, 16])),
        "leak_period": draw(st.sampled_from([1, 2, 5, 7])),
        "fraction_bits": draw(st.sampled_from([0, 1, 4, 31 - bits])),
        "link": draw(st.sampled_from(["stream", "stream", "four_phase"])),
        "frontend": draw(st.sampled_from(["digital", "analog"])),
    } | fixed
    config = ReadoutConfig(**parameters)
    low = config.encoder.lowest(config) // config.grid
    level = draw(st.sampled_from([0, 0, 1, low, low // 2, (config.full_scale - 1) // config.grid]))
    return config.replace(reference_reset=level * config.grid)


@st.composite
def stimuli(draw: st.DrawFn, config: ReadoutConfig, **fixed: Any) -> Stimulus:
    """Return a random stimulus: samples, their clocks, changing masks, and a sink."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    ticks = draw(st.sampled_from([1, 0, 6, 12, 20, 30, 40]))
    shape = (ticks, config.taxels)
    high = config.full_scale
    kind = draw(st.sampled_from(["noise", "walk", "near", "square", "rest"]))
    if kind == "noise":
        samples = rng.integers(-high, high, shape)
    elif kind == "walk":
        samples = np.cumsum(rng.integers(-2 * config.step, 2 * config.step + 1, shape), axis=0)
    elif kind == "near":  # levels, and the codes beside them
        samples = config.reference_reset + rng.integers(-3, 4, shape) * config.step + rng.integers(-1, 2, shape)
    elif kind == "square":
        samples = np.where(np.arange(ticks) // 5 % 2, -high, high - 1)[:, None].repeat(config.taxels, axis=1)
    else:
        samples = np.full(shape, config.reference_reset)
    gap = draw(st.sampled_from([1, 2, 4, 20, 60]))
    clock = draw(st.sampled_from([0, 1, 9, 30])) + np.cumsum(rng.integers(1, gap + 1, ticks)) - 1
    last = int(clock[-1]) if ticks else 0
    changes = draw(st.sampled_from([0, 0, 1, 5]))
    at = np.unique(np.concatenate([[0], rng.integers(1, last + 2, changes)])).astype(np.int64)
    mask = rng.random((len(at), config.taxels)) < draw(st.sampled_from([0.4, 0.9]))
    if not changes:
        mask[:] = True
    pattern = draw(st.sampled_from([1, 3, 64]))
    ready = rng.random(pattern) < draw(st.sampled_from([1.0, 0.8, 0.3, 0.0]))
    delays = rng.integers(1, draw(st.sampled_from([2, 40, 300])), draw(st.sampled_from([1, 7])))
    parameters: dict[str, Any] = {
        "samples": np.clip(samples, -high, high - 1).astype(np.int32),
        "sample_clock": clock.astype(np.int64),
        "clocks": last + draw(st.sampled_from([3, 60, 200, 400])),
        "enable_clock": at,
        "enable": mask,
        "ready": ready.astype(np.uint8),
        "ack_delay": delays + (delays % 8 == 0),
    } | fixed
    return Stimulus(**parameters)


# -- the model is the independent model ---------------------------------------------------------------


def test_analog_comparators_decide_on_neither_above_below_or_above_if_both() -> None:
    config = ReadoutConfig(rows=1, columns=1, frontend="analog")
    decisions = np.zeros((40, 1), np.uint8)
    decisions[[5, 15, 25], 0] = 1, 2, 3
    stimulus = replace(Stimulus.from_samples(config, np.zeros((1, 1), np.int32), clocks=40), decisions=decisions)
    assert simulate(config, stimulus)["p"].tolist() == [True, False, True]


@settings(max_examples=500)
@given(st.data())
def test_model_equals_the_independent_model_in_events_and_registers(data: st.DataObject) -> None:
    config = data.draw(configs())
    assert not (found := differs(config, data.draw(stimuli(config)))), found


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_sample_leaves_as_events_from_three_clocks_later_on(encoding: str) -> None:
    config = ReadoutConfig(rows=3, columns=5, encoding=encoding, resolution=4)  # type: ignore[arg-type]
    samples = np.zeros((1, 15), np.int32)
    samples[0, 7] = 5 * config.step + 1
    events = simulate(config, replace(Stimulus.from_samples(config, samples), sample_clock=np.array([10])))
    assert events.tolist() == [(13 + i, 2, 1, True) for i in range(5)]


# -- the promises of section 3 -----------------------------------------------------------------------


@settings(max_examples=200)
@given(st.data())
def test_full_rate_while_anything_is_pending_and_the_sink_is_ready(data: st.DataObject) -> None:
    config = data.draw(configs(link="stream"))
    stimulus = data.draw(stimuli(config))
    transfers = set(simulate(config, stimulus)["t"].tolist())
    readout = Readout(Settings.of(config.to_dict()))
    offered = False
    for clock, inputs in steps(config, stimulus, readout):
        assert (clock in transfers) == (offered and inputs["ready"]), clock
        pending = any(polarity is not None for line in readout.requests(inputs["enable"]) for polarity in line)
        offered = pending or len(readout.arbiter.queue) > inputs["ready"]


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 4), (5, 1), (3, 5), (64, 64)])
def test_saturated_array_sends_one_event_every_clock_and_serves_all_alike(rows: int, columns: int) -> None:
    config = ReadoutConfig(rows=rows, columns=columns, resolution=10)
    samples = np.full((1, config.taxels), 1500, np.int32)
    rounds = 7
    stimulus = Stimulus.from_samples(config, samples, clocks=EVENT_LATENCY + rounds * config.taxels)
    events = simulate(config, stimulus)
    assert events["t"].tolist() == list(range(EVENT_LATENCY, stimulus.clocks))
    taxel = events["y"].astype(int) * columns + events["x"]
    assert (np.bincount(taxel, minlength=config.taxels) == rounds).all()
    for number in range(rounds):  # and after every round
        assert (np.bincount(taxel[number * config.taxels :][: config.taxels]) == 1).all()


def taxels_of(readout: Readout) -> list[tuple[tuple[int, int], Taxel]]:
    """Return row and column, and the taxel, of all taxels."""
    return [((r, c), taxel) for r, row in enumerate(readout.taxels) for c, taxel in enumerate(row)]


def raised_requests(
    config: ReadoutConfig, stimulus: Stimulus, readout: Readout
) -> Iterator[tuple[tuple[int, int], int, bool]]:
    """Yield row and column of each request of the independent model, its first clock, and its polarity."""
    waited: set[tuple[int, int]] = set()
    for clock, inputs in steps(config, stimulus, readout):
        pending = {place: taxel.request for place, taxel in taxels_of(readout) if taxel.request is not None}
        yield from ((place, clock, bool(polarity)) for place, polarity in pending.items() if place not in waited)
        granted = readout.arbiter.granted_row(readout.requests(inputs["enable"]), inputs["ready"])
        waited = {place for place in pending if place[0] != granted}
    new = ((place, taxel.request) for place, taxel in taxels_of(readout) if place not in waited)
    yield from ((place, stimulus.clocks, bool(polarity)) for place, polarity in new if polarity is not None)


@settings(max_examples=200)
@given(st.data())
def test_every_accepted_request_leaves_once_in_order_and_in_time(data: st.DataObject) -> None:
    config = data.draw(configs(link="stream"))
    stimulus = data.draw(stimuli(config, enable_clock=np.zeros(1, np.int64), enable=np.ones((1, config.taxels), bool)))
    events = simulate(config, stimulus).tolist()
    left: dict[tuple[int, int], list[tuple[int, int, bool]]] = defaultdict(list)
    for number, (clock, x, y, polarity) in enumerate(events):
        left[y, x].append((number, clock, polarity))
    accepted_before = np.searchsorted([event[0] for event in events], np.arange(stimulus.clocks + 2))
    always_ready = stimulus.ready.all()
    raised: Counter[tuple[int, int]] = Counter()
    bound = (config.rows + 1) * config.columns
    readout = Readout(Settings.of(config.to_dict()))
    for place, request_clock, request_polarity in raised_requests(config, stimulus, readout):
        nth = raised[place]
        raised[place] += 1
        if nth < len(left[place]):
            number, clock, polarity = left[place][nth]
            assert polarity == request_polarity
            assert clock > request_clock
            assert number + 1 - accepted_before[request_clock] <= bound
            assert not always_ready or clock - request_clock < bound + 2
        else:  # still on its way
            assert len(events) - accepted_before[request_clock] < bound
    on_the_way = Counter((row, column) for row, column, _ in readout.arbiter.queue)
    on_the_way.update(place for place, taxel in taxels_of(readout) if taxel.request is not None)
    for place, number in raised.items():
        assert number == len(left[place]) + on_the_way[place]


@settings(max_examples=40)
@given(st.data())
def test_same_stimulus_gives_the_same_events_and_stays_untouched(data: st.DataObject) -> None:
    config = data.draw(configs())
    stimulus = data.draw(stimuli(config))
    before = copy.deepcopy(stimulus)
    first = simulate(config, stimulus)
    assert np.array_equal(simulate(config, stimulus), first)
    for field in fields(Stimulus):
        assert np.array_equal(getattr(stimulus, field.name), getattr(before, field.name))


# -- refusals ----------------------------------------------------------------------------------------

GOOD = Stimulus.from_samples(ReadoutConfig(rows=1, columns=2), np.zeros((3, 2), np.int32))
SHAPE = "samples must have shape (ticks, 2) for 1 x 2 taxels, not "
RANGE = "samples must be in -2048..2047 (12 bits), not "
CODES = "samples must be integer codes, not {}; eskin.encode takes floats in full scales"
CLOCK = "sample_clock must be one rising clock for every row of samples"
ACK = "ack_delay must be positive and never a multiple of 8, or ACK changes at a clock edge"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"samples": np.zeros((3, 3), np.int32)}, f"{SHAPE}(3, 3)"),
        ({"samples": np.zeros(3, np.int32)}, f"{SHAPE}(3,)"),
        ({"samples": np.array([[0, 0], [-2049, 5], [0, 0]])}, f"{RANGE}-2049..5"),
        ({"samples": np.array([[0, 0], [0, 2048], [0, 0]])}, f"{RANGE}0..2048"),
        *(({"sample_clock": np.array(clocks)}, CLOCK) for clocks in ([0, 4], [0, 4, 4], [-1, 4, 5])),
        ({"enable": np.ones((2, 2), bool)}, "enable must have shape (1, 2), one mask at least"),
        ({"enable": np.ones((1, 3), bool)}, "enable must have shape (1, 2), one mask at least"),
        (
            {"enable": np.ones((0, 2), bool), "enable_clock": np.zeros(0, np.int64)},
            "enable must have shape (0, 2), one mask at least",
        ),
        ({"enable_clock": np.array([1])}, "enable_clock must rise from 0"),
        ({"enable": np.ones((2, 2), bool), "enable_clock": np.array([0, 0])}, "enable_clock must rise from 0"),
        ({"ready": np.zeros(0, np.uint8)}, "ready and ack_delay must not be empty"),
        ({"ack_delay": np.zeros(0, np.int64)}, "ready and ack_delay must not be empty"),
        ({"ack_delay": np.array([1, 0])}, ACK),
        ({"ack_delay": np.array([1, 16])}, ACK),
    ],
)
def test_stimulus_that_does_not_fit_is_refused(changes: dict[str, Any], sentence: str) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    bad = replace(GOOD, **changes)
    for call in (lambda: simulate(config, bad), lambda: state_at(config, bad, 0)):
        with refused(sentence):
            call()


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        (np.full((1, 2), 0.9), CODES.format("float64")),
        (np.ones((1, 2), bool), CODES.format("bool")),
        (np.array([[0, 2**32]]), f"{RANGE}0..4294967296"),
        (np.array([[0, 2**63]], np.uint64), f"{RANGE}0..9223372036854775808"),
        (np.zeros((1, 3), int), f"{SHAPE}(1, 3)"),
    ],
)
def test_samples_are_checked_before_they_are_cast(samples: NDArray[Any], sentence: str) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    with refused(sentence):
        Stimulus.from_samples(config, samples)
    with refused(sentence):
        simulate(config, replace(GOOD, samples=samples))
