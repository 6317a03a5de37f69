"""Points of the specification that runs, each held to the model, must reach: holds, bursts, masks, both ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from flow.faults.bench import bench_gates
from flow.faults.course import codes_of, course, events_of
from flow.faults.lanes import simulate
from flow.faults.plan import FEW
from model.config import ReadoutConfig
from model.readout import simulate as simulate_model
from rtl.readout import Readout

SIDE = 3
READOUTS = {
    "lcs": FEW.replace(rows=SIDE, columns=SIDE),
    "cw-lcs": FEW.replace(rows=SIDE, columns=SIDE, encoding="cw-lcs", window_period=3),
}


class Seen:
    """The flops and inputs of a run, by their names, clock by clock."""

    def __init__(self, config: ReadoutConfig, calm: bool, seed: int) -> None:
        gates, played = bench_gates(Readout(config)), course(config, calm, seed=seed)
        nets = {name: [gates.first_flop + place] for place, name in enumerate(gates.flops)}
        shown = dataclasses.replace(gates, outputs=gates.outputs | nets)
        inputs = {name: bits for name, bits in played.inputs.items() if name in gates.inputs}
        self.traces = simulate(shown, inputs, np.zeros((0, 3), np.int64)).outputs
        codes = codes_of(config, self.traces, played.inputs["event_ready"])[:, 0]
        expected = simulate_model(config, played.stimulus)
        assert len(expected)
        assert np.array_equal(events_of(config, codes)[: len(expected)], expected)
        self.config, self.inputs, self.codes = config, played.inputs, codes

    def flop(self, name: str) -> NDArray[np.bool_]:
        """Return a flop in every clock."""
        return self.traces[f"dut.{name}"][:, 0] != 0

    def taxel(self, name: str) -> NDArray[np.bool_]:
        """Return a flop of every taxel, shape (clocks, taxels)."""
        places = [(row, column) for row in range(SIDE) for column in range(SIDE)]
        return np.stack([self.flop(f"row_{row}.taxel_{column}.{name}") for row, column in places], axis=1)

    def number(self, name: str) -> NDArray[np.int64]:
        """Return a word of flops, those that are there, as an unsigned number."""
        bits = sorted(key for key in self.traces if key.startswith(f"dut.{name}["))
        assert bits
        return sum((self.traces[bit][:, 0] << int(bit[len(name) + 5 : -1]) for bit in bits), np.zeros(1, np.int64))


def points(seen: Seen) -> Iterator[tuple[str, bool]]:
    """Yield the points of a run, and whether it reached them."""
    config, pending = seen.config, seen.taxel("pending")
    waiting = np.stack([seen.flop("arbiter.first[0]"), *(seen.flop(f"arbiter.waiting[{c}]") for c in (1, 2))], axis=1)
    row, busy = seen.number("arbiter.event_row"), waiting.any(axis=1)
    loaded = np.r_[False, busy[1:] & ((waiting[1:] & ~waiting[:-1]).any(axis=1) | ~busy[:-1])]
    for of in range(SIDE):
        for size in range(1, SIDE + 1):
            yield f"burst of {size} in row {of}", bool((loaded & (row == of) & (waiting.sum(axis=1) == size)).any())
    starts = row[loaded]
    yield "row pointer wraps", bool((np.diff(starts) < 0).any())
    yield "a row twice in succession", bool((np.diff(starts) == 0).any())
    ready = seen.inputs["event_ready"][:, 0] != 0
    own = np.repeat(np.arange(SIDE), SIDE) == row[:, None]
    held = pending & busy[:, None]
    kinds = (
        {"ON": seen.taxel("polarity"), "OFF": ~seen.taxel("polarity")} if config.has_polarity else {"event": pending}
    )
    for kind, mine in kinds.items():
        yield f"{kind} held by the sink", bool((held & mine & ~ready[:, None]).any())
        yield f"{kind} held by another row", bool((held & mine & ~own & ready[:, None]).any())
        yield f"{kind} held by the burst of its own row", bool((held & mine & own & ready[:, None]).any())
    enable = seen.inputs["taxel_enable"].astype(bool)
    yield "disabled while pending", bool((pending & ~enable).any())
    latched = waiting[:, np.tile(np.arange(SIDE), SIDE)] & own
    yield "disabled while latched", bool((latched & ~enable).any())
    if config.encoding == "lcs":
        places = [(row, column) for row in range(SIDE) for column in range(SIDE)]
        level = np.stack([seen.number(f"row_{row}.taxel_{column}.reference") for row, column in places])
        yield "reference at the top level", bool((level == 7).any())
        yield "reference at the lowest level that a sample asks for", bool((level == 9).any())


@pytest.mark.parametrize("name", READOUTS)
def test_runs_that_are_held_to_the_model_reach_every_point_of_the_specification(name: str) -> None:
    reached: dict[str, bool] = {}
    for calm, seed in ((False, 0), (False, 1), (True, 0), (False, 2), (True, 1), (False, 3), (False, 4)):
        for point, hit in points(Seen(READOUTS[name], calm, seed)):
            reached[point] = reached.get(point, False) or hit
        if all(reached.values()):
            break
    assert len(reached) > 15
    assert [point for point, hit in reached.items() if not hit] == []
