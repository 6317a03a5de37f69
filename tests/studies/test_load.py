"""Test the arbiters of the load study; our arbiter must equal that of the readout."""

import json

import numpy as np

from eskin.model.arbiter import ROW_DTYPE, new_state
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate
from studies import load
from studies.study import DATA


def order(kind: int, lists: list[list[int]], rows: int) -> list[tuple[int, int]]:
    """Return clock and taxel of the events in order of transfer."""
    due = np.array([t for times in lists for t in times], np.int64)
    first = np.cumsum([0, *map(len, lists)])
    _, left = load.serve(kind, due, first, 100, new_state(), np.zeros(rows, ROW_DTYPE))
    taxel = np.repeat(np.arange(len(lists)), np.diff(first))
    return sorted((int(t), int(i)) for t, i in zip(left, taxel, strict=True) if t >= 0)


def test_each_serves_in_its_own_order() -> None:
    twice = [[0, 0] for _ in range(4)]
    taxels = {kind: [i for _, i in order(kind, twice, 2)] for kind in range(4)}
    assert taxels[load.OURS] == [0, 1, 2, 3, 0, 1, 2, 3]
    assert taxels[load.FIXED] == [0, 0, 1, 1, 2, 2, 3, 3]
    assert taxels[load.FLAT] == [0, 1, 2, 3, 0, 1, 2, 3]
    assert taxels[load.TREE] == [0, 2, 1, 3, 0, 2, 1, 3]
    for kind in range(4):
        assert [t for t, _ in order(kind, twice, 2)] == list(range(2, 10)), "one event per clock, 2 after it is due"


def test_ours_is_that_of_the_readout() -> None:
    rng = np.random.default_rng(0)
    config = ReadoutConfig(rows=3, columns=4)
    moves = rng.random((60, config.taxels)) < np.repeat([0.2, 0.03], 30)[:, None]  # more than the link takes, then less
    samples = np.cumsum(moves, axis=0) * config.step
    events = simulate(config, Stimulus.from_samples(config, samples, clocks_per_sample=1, clocks=160))
    due = [(np.flatnonzero(line) + 1).tolist() for line in moves.T]  # the clock of the decision
    got = order(load.OURS, due, 3)
    assert got == [(int(e["t"]), int(e["y"]) * 4 + int(e["x"])) for e in events if e["t"] < 100]
    assert len(got) > 60


def test_the_report_is_within_the_bound_of_the_specification() -> None:
    kept = json.loads((DATA / "load.json").read_text())
    ours = [line for line in kept["results"] if line["arbiter"].endswith("(ours)")]
    assert len(ours) == len(kept["results"]) / 5 == 9
    assert max(line["worst_wait"] for line in ours) <= kept["bound"] == 17 * 16 + 2
    assert min(line["jain"] for line in ours) > 0.99
