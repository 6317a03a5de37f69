"""Compare the model's four-phase link with that of the independent model, and check the promises of every link."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eskin.cocotb_tests.independent.link import LINKS as INDEPENDENT
from eskin.cocotb_tests.independent.link import FourPhaseLink, Receiver
from eskin.model import readout
from eskin.model.cases import axes, cases
from eskin.model.config import ReadoutConfig
from eskin.model.links import compiled
from eskin.model.links.four_phase import REQ, FourPhase
from eskin.model.links.link import NOTHING, Sink
from eskin.model.links.registry import LINKS
from eskin.model.readout import TAKEN, WAITED, Stimulus, simulate_counted

DELAYS = st.lists(st.integers(1, 100).filter(lambda delay: delay % 8), min_size=1, max_size=6)


HANDSHAKES = [link for link in LINKS if isinstance(link, FourPhase)]


@pytest.mark.parametrize("link", HANDSHAKES, ids=lambda link: link.name)
@given(delays=DELAYS, offers=st.lists(st.booleans(), min_size=1, max_size=60))
def test_model_equals_the_independent_model_clock_by_clock(
    link: FourPhase, delays: list[int], offers: list[bool]
) -> None:
    rule, sink = link.rule(), Sink(np.ones(1, np.uint8), np.array(delays))
    state, reference, receiver = link.new_state(), INDEPENDENT[link.name](), Receiver(delays)
    assert isinstance(reference, FourPhaseLink)
    for clock in range(300):
        offered = offers[clock % len(offers)]
        ready = link.ready(rule, state, sink, clock)
        assert ready == reference.ready()
        expected = reference.clock((0, clock, 1) if offered else None, receiver.ack_at(clock))
        receiver.see(reference.request(), clock)
        left = link.advance(rule, state, sink, clock, 2 * clock + 1 if offered and ready else NOTHING)
        assert left == (NOTHING if expected is None else 2 * expected[1] + 1)
        assert state[REQ] == reference.request()
        if link.rests(rule, state):
            assert reference.ready()
            assert not receiver.ack_at(clock + 1)


@given(st.integers(0, 40), st.integers(0, 40))
def test_an_event_takes_seven_clocks_and_the_whole_clocks_of_both_delays(up: int, down: int) -> None:
    link, sink = FourPhase(), Sink(np.ones(1, np.uint8), np.array([8 * up + 1, 8 * down + 7]))
    rule, state = link.rule(), link.new_state()
    rises = []
    for clock in range(700):
        taken = 1 if link.ready(rule, state, sink, clock) else NOTHING
        if link.advance(rule, state, sink, clock, taken) != NOTHING:
            rises.append(clock)
    assert rises[0] == 3  # taken at clock 2, when ACK has been seen low
    assert set(np.diff(rises).tolist()) == {link.clocks_per_event + up + down}


FEW = ReadoutConfig(rows=2, columns=3, clocks_per_sample=20)


CASES = list(cases(FEW, encoding=("lcs", "nlcs"), **axes("link")))


@pytest.mark.parametrize("config", CASES, ids=lambda config: f"{config.encoding}-{config.link}")
def test_the_wires_of_every_link_show_its_events(config: ReadoutConfig) -> None:
    link, rng = config.protocol, np.random.default_rng(0)
    ready, delays = rng.integers(0, 2, 31).astype(np.uint8), 8 * rng.integers(0, 5, 7) + 3
    samples = rng.integers(-config.full_scale, config.full_scale, (30, config.taxels))
    stimulus = Stimulus.from_samples(config, samples, ready=ready, ack_delay=delays)
    events, traffic = simulate_counted(config, stimulus)
    assert len(events) > 40
    numbers = [int(2 * (y * config.columns + x) + p) for _, x, y, p in events]
    state, sink, found, before = link.new_state(), Sink(ready, delays), [], False
    for clock in range(stimulus.clocks):
        offered = numbers[0] if numbers and traffic[clock] in (TAKEN, WAITED) else NOTHING
        levels = link.levels(config, state, sink, clock, offered)
        shown = link.shown(config, lambda name, now=levels: now.get(name) or 0)  # type: ignore[misc]
        high = sum(shown.high)
        assert high <= 1
        if high and not (before and link.rule().late):
            found.append((clock - link.rule().late, shown.column, shown.row, shown.polarity == 1))
        before = bool(high)
        taken = numbers.pop(0) if offered != NOTHING and traffic[clock] == TAKEN else NOTHING
        link.advance(link.rule(), state, sink, clock, taken)
    assert found == events.tolist()


def test_an_event_takes_the_clocks_that_every_link_states() -> None:
    for link in LINKS:
        sink, state, left = Sink(np.ones(1, np.uint8), np.ones(1, np.int64)), link.new_state(), []
        for clock in range(100):
            taken = 2 * clock if link.ready(link.rule(), state, sink, clock) else NOTHING
            if link.advance(link.rule(), state, sink, clock, taken) != NOTHING:
                left.append(clock)
        assert set(np.diff(left).tolist()) == {link.clocks_per_event}


def test_an_edit_of_any_file_of_a_link_makes_compiled_loops_stale() -> None:
    sources, folder = set(compiled.sources()), Path(compiled.__file__).parent
    of_links = {Path(inspect.getfile(type(link))) for link in LINKS}
    assert {folder, folder / "link.py", folder / "compiled.py", *of_links} <= sources
    assert sources <= set(readout.SOURCES)


def test_no_two_protocols_share_compiled_loops() -> None:
    rules = {link.Rule for link in LINKS}
    assert len(rules) == len({rule.__name__ for rule in rules})
