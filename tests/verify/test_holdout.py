"""Compare RTL, first model and second model on random configurations that no run before has seen."""

import dataclasses

from hypothesis import Phase, given, settings

from eskin.cocotb_tests.bench.random_run import SIGNALS, RandomRun, runs
from eskin.model.events.compare import first_difference
from eskin.model.readout import simulate
from eskin.verify.soak import play
from tests.independent.agreement import play as play_second


@settings(max_examples=4, database=None, phases=[Phase.generate])  # each builds a program
@given(runs(500, most_taxels=20))
def test_all_three_agree_on_configurations_never_seen_before(run: RandomRun) -> None:
    parts = [dataclasses.replace(run, clocks=500, seed=n, signal=signal) for n, signal in enumerate(SIGNALS)]
    tally = play(parts, "icarus")
    assert (tally.runs, tally.clocks) == (len(SIGNALS), 500 * len(SIGNALS))
    events = 0
    for part in parts:
        expected = simulate(part.config, part.stimulus)
        found = first_difference(expected, play_second(part.config, part.stimulus)[0])
        assert found is None, f"{part}: {found.describe(('first', 'second')) if found else ''}"
        events += len(expected)
    assert tally.events == events
