"""Test the second model with simple cases of the specification, whose results are written out."""

import pytest

from eskin.cocotb_tests.independent.classifier import limited
from eskin.cocotb_tests.independent.frame import FrameReadout
from eskin.cocotb_tests.independent.merge import Merge
from eskin.cocotb_tests.independent.readout import Readout
from eskin.cocotb_tests.independent.settings import Settings
from eskin.model.encoders import registry


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_a_jump_is_followed_in_steps(encoding):
    readout = Readout(Settings(rows=1, columns=1, encoding=encoding))
    readout.clock(sample_valid=True, sample=[160])
    for _ in range(20):
        readout.clock()
    steps = 9 if registry.named(encoding).strict else 10
    assert [event[0] for event in readout.events] == list(range(3, 3 + steps))
    assert readout.taxels[0][0].reference_code() == 16 * steps


def test_everything_at_once_leaves_row_by_row_in_consecutive_clocks():
    readout = Readout(Settings(rows=3, columns=5, decide_every="sample"))
    readout.clock(sample_valid=True, sample=[100] * 15)
    for _ in range(30):
        readout.clock()
    assert [(t - readout.events[0][0], x, y) for t, x, y, _ in readout.events] == [
        (i, i % 5, i // 5) for i in range(15)
    ]


def test_a_frame_takes_the_clocks_of_the_table():
    settle, conversion, taxels = 2, 5, 6
    frame = FrameReadout(2, 3, resolution=4, word_bits=16, settle_clocks=settle)
    seen = {"adc_start": [], "word_valid": []}
    for clock in range(100):
        outputs = frame.outputs()
        for name, clocks in seen.items():
            if outputs[name]:
                clocks.append(clock)
        done = bool(seen["adc_start"]) and clock == seen["adc_start"][-1] + conversion
        frame.clock(frame_start=clock == 0, adc_done=done, adc_code=len(seen["adc_start"]))
    assert seen["adc_start"] == [1 + settle + i * (settle + 1 + conversion) for i in range(taxels)]
    assert seen["word_valid"][-1] == taxels * (settle + 1 + conversion) + 3
    assert frame.words == [(0x4321, 1), (0x65, 0)]


def test_sums_stop_at_their_ends():
    assert [limited(v, 4) for v in (-9, -8, 7, 8)] == [-8, -8, 7, 7]


def test_the_merge_takes_turns_and_waits_for_the_sink():
    merge = Merge(3)
    left = []
    for clock in range(12):
        ready = clock not in (4, 5, 6)
        if merge.output() and ready:
            left.append((clock, merge.output()[0]))
        merge.clock(["a", None, "c"], ready)
    assert left == [(1, 0), (2, 2), (3, 0), (7, 2), (8, 0), (9, 2), (10, 0), (11, 2)]
