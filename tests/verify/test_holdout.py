"""Compare RTL, first model and second model on new random configurations; the seed is printed."""

import dataclasses

import pytest

from eskin.cocotb_tests.bench.draw import Draw
from eskin.model.events.compare import first_difference
from eskin.model.readout import simulate
from eskin.verify.soak.play import play
from tests.independent.agreement import play as play_second


@pytest.mark.parametrize("part", range(2))
def test_all_three_agree_on_configurations_never_seen_before(part: int, holdout: int) -> None:
    draw = Draw(2 * holdout + part, clocks=500, most_taxels=20)
    runs = [dataclasses.replace(draw, run=run) for run in range(4)]
    tally = play(runs, "icarus")
    assert (tally.runs, tally.clocks) == (4, 2000)
    events = 0
    for run in runs:
        expected = simulate(run.config, run.stimulus)
        found = first_difference(expected, play_second(run.config, run.stimulus)[0])
        assert found is None, f"{run}: {found.describe(('first', 'second')) if found else ''}"
        events += len(expected)
    assert tally.events == events
