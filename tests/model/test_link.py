"""Compare the model's four-phase link with that of the independent model, and check its clocks per event."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eskin.cocotb_tests.independent.link import FourPhaseLink, Receiver
from eskin.model import link

DELAYS = st.lists(st.integers(1, 100).filter(lambda delay: delay % 8), min_size=1, max_size=6)


@given(DELAYS, st.lists(st.booleans(), min_size=1, max_size=60))
def test_model_equals_the_independent_model_clock_by_clock(delays: list[int], offers: list[bool]) -> None:
    state, reference, receiver = link.new_state(), FourPhaseLink(), Receiver(delays)
    for clock in range(300):
        offered = offers[clock % len(offers)]
        assert link.ready(state) == reference.ready()
        req = reference.request()
        reference.clock((0, clock, 1) if offered else None, receiver.ack_at(clock))
        receiver.see(reference.request(), clock)
        taken = bool(offered and link.ready(state))
        assert link.advance(state, clock, taken, np.array(delays)) == (reference.request() and not req)
        assert state[link.REQ] == reference.request()
        if link.ready(state):
            assert reference.ready()
            assert not receiver.ack_at(clock + 1)


@given(st.integers(0, 40), st.integers(0, 40))
def test_an_event_takes_seven_clocks_and_the_whole_clocks_of_both_delays(up: int, down: int) -> None:
    delays = np.array([8 * up + 1, 8 * down + 7])
    state = link.new_state()
    rises = [clock for clock in range(700) if link.advance(state, clock, link.ready(state), delays)]
    assert rises[0] == 3  # taken at clock 2, when ACK has been seen low
    assert set(np.diff(rises).tolist()) == {7 + up + down}
