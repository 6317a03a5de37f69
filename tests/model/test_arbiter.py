"""Compare the model's arbiter with the reference arbiter, and test its order of events."""

from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eskin.cocotb_tests.bench.reference import AddressEvent, ArbiterReference, Requests
from eskin.model.arbiter import ZERO, lowest, next_row, rows_behind, without_lowest
from eskin.model.config import ReadoutConfig

WORD = st.integers(1, 2**64 - 1) | st.integers(0, 63).map(lambda bit: 1 << bit)


@settings(deadline=None)  # the first call may compile the model
@given(WORD)
def test_lowest_bit_of_a_word(word: int) -> None:
    bits = [bit for bit in range(64) if word >> bit & 1]
    assert lowest(np.uint64(word)) == bits[0]
    assert int(without_lowest(np.uint64(word))) == sum(1 << bit for bit in bits[1:])


@settings(deadline=None)
@given(st.integers(1, 64), st.data())
def test_next_row_equals_the_reference_over_a_run_of_grants(rows: int, data: st.DataObject) -> None:
    reference = ArbiterReference(ReadoutConfig(rows=rows, columns=1))
    behind = ZERO
    for _ in range(data.draw(st.integers(1, 8))):
        word = data.draw(st.integers(1, 2**rows - 1))
        requests = [[True] if word >> row & 1 else [None] for row in range(rows)]
        row = next_row(np.uint64(word), behind)
        assert row == reference.granted(requests, True)
        reference.clock(requests, True)
        behind = rows_behind(row)
        assert [bit for bit in range(rows) if int(behind) >> bit & 1] == list(range(row + 1, rows))


def test_rows_behind_each_row_of_the_largest_array() -> None:
    for row in range(64):
        assert int(rows_behind(row)) == sum(1 << later for later in range(row + 1, 64))


def drain(reference: ArbiterReference, requests: Requests, clocks: int) -> list[AddressEvent]:
    """Return the events of requests that are raised again after each grant."""
    events = []
    for _ in range(clocks):
        if reference.event is not None:
            events.append(reference.event)
        reference.clock(requests, True)
    return events


def test_rows_take_turns_and_columns_rise() -> None:
    reference = ArbiterReference(ReadoutConfig(rows=3, columns=3))
    requests: Requests = [[True, None, False], [None, None, None], [None, True, True]]
    got = [(event.row, event.column, event.polarity) for event in drain(reference, requests, 6)]
    assert got == [(0, 0, True), (0, 2, False), (2, 1, True), (2, 2, True), (0, 0, True)]


@given(st.integers(1, 6), st.integers(1, 6), st.data())
def test_equal_demand_gets_equal_service(rows: int, columns: int, data: st.DataObject) -> None:
    reference = ArbiterReference(ReadoutConfig(rows=rows, columns=columns))
    wanting = data.draw(st.sets(st.integers(0, rows * columns - 1), min_size=1))
    requests = [
        [True if row * columns + column in wanting else None for column in range(columns)] for row in range(rows)
    ]
    events = drain(reference, requests, 1 + 5 * len(wanting))
    assert len(events) == 5 * len(wanting)  # one event per clock, from one clock after the request on
    assert set(Counter(events).values()) == {5}
