"""Compare a whole skin with its golden model: clock and address of every event."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.block import Block, Simulator, bits, job, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.address_events import make_events
from eskin.model.tiles.config import TilesConfig


@cocotb.test()
async def skin_plays_its_stimulus(dut: Any) -> None:
    """Play stimulus.npz, and compare the output events of the merge with the expected ones."""
    config, _ = job()
    assert isinstance(config, TilesConfig)
    block = Block(dut)
    played = np.load("stimulus.npz")
    samples, ready, enable = played["samples"], played["ready"], played["enable"]  # (ticks, tiles, taxels), ...
    block.drive(sample_valid=0, event_ready=0, taxel_enable=bits(enable[0]))
    await block.reset()
    start, tick, mask = block.time, 0, (1 << config.sample_bits) - 1
    events: list[list[int]] = []
    while (clock := block.time - start) < int(played["clocks"]):
        valid = tick < len(samples) and played["sample_clock"][tick] == clock
        if valid:
            words = [(int(code) & mask) << i * config.sample_bits for i, code in enumerate(samples[tick].ravel())]
            block.drive(sample=sum(words))
            tick += 1
        if clock in played["enable_clock"]:
            block.drive(taxel_enable=bits(enable[list(played["enable_clock"]).index(clock)]))
        takes = bool(ready[clock % len(ready)])
        block.drive(sample_valid=-int(valid), event_ready=takes)  # of all tiles, where each has its own
        await block.settle()
        if takes and block.read("event_valid"):
            names = ("event_tile", "event_row", "event_col", "event_polarity")
            events.append([clock, *(block.read(name) for name in names)])
        await block.edge()
    t, tile, row, column, polarity = np.array(events or np.empty((0, 5), int)).T
    found = make_events(t, row, column, polarity.astype(bool) if config.has_polarity else True)
    assert np.array_equal(config.on_skin(tile, found), played["events"])
    report(Counter(events=len(events), tiles=len(set(tile.tolist()))))


def play(config: TilesConfig, simulator: Simulator, folder: Path) -> Counter[str]:
    """Play random walks on a skin with a stalling sink; return the counts."""
    from eskin.model.readout import Stimulus
    from eskin.model.tiles.run import simulate_skin

    rng = np.random.default_rng(5)
    ticks, tiles, taxels = 40, config.tiles, config.tile.taxels
    clock = np.cumsum(rng.integers(1, 14, ticks)) - 1
    walk = np.cumsum(rng.integers(-40, 60, (ticks, tiles, taxels)), axis=0)
    samples = np.clip(walk, -config.full_scale, config.full_scale - 1).astype(np.int32)
    enable_clock = np.array([0, 60, 130])
    enable = rng.random((3, tiles * taxels)) < [[1.0], [0.6], [1.0]]
    ready = (rng.random(64) < 0.7).astype(np.uint8)
    common = {"sample_clock": clock, "clocks": int(clock[-1]) + 400, "enable_clock": enable_clock}
    of_tile = enable.reshape(3, tiles, taxels)
    stimuli = [
        Stimulus(samples=samples[:, i], enable=of_tile[:, i], ready=ready, **common)  # type: ignore[arg-type]
        for i in range(tiles)
    ]
    played = {"samples": samples, "ready": ready, "enable": enable, "events": simulate_skin(config, stimuli), **common}
    np.savez(folder / "stimulus.npz", **played)  # type: ignore[arg-type]
    return cosimulate(config, simulator, "eskin_tiles", "skin_plays_its_stimulus", folder, 0, __name__)
