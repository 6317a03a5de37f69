"""Compare the relay station's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.block import Simulator, job
from eskin.cocotb_tests.blocks.merge import MergeBench, Payload
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.tiles.config import TilesConfig


class RelayBench(MergeBench):
    """A relay station: a merge of one tile with outputs that depend on no input."""

    def event(self) -> Payload:
        tile = self.config.tile
        row, column, polarity = (
            self.rng.getrandbits(bits) if bits else 0 for bits in (tile.row_bits, tile.column_bits, tile.has_polarity)
        )
        return row, column, polarity

    def probes(self, ready: bool) -> list[tuple[list[Payload | None], bool]]:
        return [([None], False), ([self.event()], True), (self.offers, ready)]

    def tile_ready(self, taken: int | None) -> int:
        return len(self.reference.queue) < 2


@cocotb.test()
async def relay_keeps_its_contract(dut: Any) -> None:
    """Play busy and quiet tiles against all kinds of sinks."""
    config, rng = job()
    assert isinstance(config, TilesConfig)
    bench = RelayBench(dut, config, rng, tiles=1)
    await bench.block.reset()
    for _ in range(21):
        await bench.clock(1.0, [0], ready=True)
    clocks = [clock for clock, *_ in bench.left]
    bench.check.holds("FullRate", clocks == list(range(1, 21)), clocks)  # one event in every clock
    await bench.reset()
    await bench.finish((1.0, 0.5, 0.1), 60)


def play(config: TilesConfig, simulator: Simulator, folder: Path, seed: int) -> Counter[str]:
    """Run the relay station test, compare its last run with the golden model, and return the counts."""
    from eskin.model.tiles.relay import relay

    counts = cosimulate(config, simulator, "eskin_relay", "relay_keeps_its_contract", folder, seed, __name__)
    trace = json.loads((folder / "trace.json").read_text())
    ready = np.array(trace["ready"], np.uint8)
    found = relay(np.array(trace["first_offered"][0]), ready, len(ready))
    assert found.taken.tolist() == trace["taken"]
    assert found.clock.tolist() == [clock for clock, *_ in trace["left"]]
    counts["left in the last run"] = len(found.clock)
    return counts
