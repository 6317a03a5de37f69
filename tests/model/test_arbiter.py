"""Compare the model's arbiter with that of the independent model."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eskin.cocotb_tests.independent.arbiter import Arbiter
from eskin.model.arbiter import ZERO, lowest, next_row, rows_behind, without_lowest

WORD = st.integers(1, 2**64 - 1) | st.integers(0, 63).map(lambda bit: 1 << bit)


@given(WORD)
def test_lowest_bit_of_a_word(word: int) -> None:
    bits = [bit for bit in range(64) if word >> bit & 1]
    assert lowest(np.uint64(word)) == bits[0]
    assert int(without_lowest(np.uint64(word))) == sum(1 << bit for bit in bits[1:])


@given(st.integers(1, 64), st.data())
def test_next_row_equals_the_independent_model_over_a_run_of_grants(rows: int, data: st.DataObject) -> None:
    reference = Arbiter(rows, 1)
    behind = ZERO
    for _ in range(data.draw(st.integers(1, 8))):
        word = data.draw(st.integers(1, 2**rows - 1))
        requests = [[1 if word >> row & 1 else None] for row in range(rows)]
        row = next_row(np.uint64(word), behind)
        assert row == reference.granted_row(requests, True)
        reference.clock(requests, True)
        behind = rows_behind(row)
        assert [bit for bit in range(rows) if int(behind) >> bit & 1] == list(range(row + 1, rows))


def test_rows_behind_each_row_of_the_largest_array() -> None:
    for row in range(64):
        assert int(rows_behind(row)) == sum(1 << later for later in range(row + 1, 64))
