"""Compare the model's four-phase link with that of the independent model, and check its clocks per event."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eskin.cocotb_tests.independent.link import FourPhaseLink, Receiver
from eskin.model.links.four_phase import REQ, FourPhase
from eskin.model.links.link import NOTHING, Sink

DELAYS = st.lists(st.integers(1, 100).filter(lambda delay: delay % 8), min_size=1, max_size=6)


@given(DELAYS, st.lists(st.booleans(), min_size=1, max_size=60))
def test_model_equals_the_independent_model_clock_by_clock(delays: list[int], offers: list[bool]) -> None:
    link = FourPhase()
    rule, sink = link.rule(), Sink(np.ones(1, np.uint8), np.array(delays))
    state, reference, receiver = link.new_state(), FourPhaseLink(), Receiver(delays)
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
