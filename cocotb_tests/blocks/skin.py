"""Steps of a whole skin, compared with its golden model: clock and address of every event."""

import random
from collections import Counter
from collections.abc import Iterator

import numpy as np

from eskin.cocotb_tests.bench.block import Step, bits
from eskin.model.classifier.words import packed
from eskin.model.readout import Stimulus
from eskin.model.tiles.config import TilesConfig
from eskin.model.tiles.run import simulate_skin

TICKS = 40


def steps(config: TilesConfig, _: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield random walks of all taxels, masks that change, and a sink that stalls."""
    rng = np.random.default_rng(5)
    tiles, taxels = config.tiles, config.tile.taxels
    clock = np.cumsum(rng.integers(1, 14, TICKS)) - 1
    walk = np.cumsum(rng.integers(-40, 60, (TICKS, tiles, taxels)), axis=0)
    samples = np.clip(walk, -config.full_scale, config.full_scale - 1).astype(np.int32)
    enable_clock = np.array([0, 60, 130])
    enable = rng.random((3, tiles, taxels)) < [[[1.0]], [[0.6]], [[1.0]]]
    ready = (rng.random(64) < 0.7).astype(np.uint8)
    clocks = int(clock[-1]) + 400
    stimuli = [Stimulus(samples[:, i], clock, clocks, enable_clock, enable[:, i], ready) for i in range(tiles)]
    events = simulate_skin(config, stimuli)
    tile, own = config.in_tiles(events)
    found = {int(e["t"]): (number, e) for number, e in zip(tile.tolist(), own, strict=True)}
    masks = dict(zip(enable_clock.tolist(), (bits(mask.ravel()) for mask in enable), strict=True))
    words = (packed(tick.ravel().tolist(), config.sample_bits) for tick in samples)
    ticks = dict(zip(clock.tolist(), words, strict=True))
    inputs: dict[str, int] = {}
    for t in range(clocks):
        takes = int(ready[t % len(ready)])
        inputs |= {"sample_valid": -(t in ticks), "event_ready": takes}  # of all tiles, where each has its own
        inputs |= {"sample": ticks[t]} if t in ticks else {}
        inputs |= {"taxel_enable": masks[t]} if t in masks else {}
        outputs: dict[str, int] = {"event_valid": t in found} if takes else {}
        if t in found:
            number, event = found[t]
            outputs |= {"event_row": int(event["y"]), "event_col": int(event["x"])}
            outputs |= {"event_tile": number} | ({"event_polarity": int(event["p"])} if config.has_polarity else {})
        yield Step(dict(inputs), outputs, f"event {found.get(t)}")
    counts.update(events=len(events), tiles=len(set(tile.tolist())))
