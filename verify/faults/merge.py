"""Bit flips in the merge of tiles and in relay stations: lost, repeated and changed events."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from eskin.model.tiles.config import TilesConfig
from eskin.model.tiles.merge import merge
from eskin.rtl.tiles import merge as rtl_merge
from eskin.rtl.tiles import relay
from eskin.verify.faults.bench import FIELDS, NUMBER_BITS, bench_gates, inside
from eskin.verify.faults.gates import last_clock, upset_runs
from eskin.verify.faults.outcomes import CHANGED, MOVED, NEVER, UnlikeModel, Upset, classify_effects, missing, since
from eskin.verify.faults.scenario import RESET

LOADED, PAUSE, AGAIN = 160, 120, 120
"""Clocks of load with bit flips, of a pause, and of load without errors."""


def upsets(config: TilesConfig, stride: int, flops: str) -> Iterator[Upset]:
    """Yield the outcome of each run; in a run, one flop of a merge is flipped in one clock of the stimulus.

    Of a skin with relay stations it is one of those that is upset. Every event of a tile has a number of its own, so
    what is lost and what is added is known one by one. Before the last load tile 0 alone sends an event: then its turn
    is the same in all runs. See ``eskin.verify.faults.outcomes.upsets``.
    """
    # A relay station does what the merge of a single tile does.
    block = relay.Relay(config) if config.relays else rtl_merge.Merge(config)
    gates, inputs = bench_gates(block), _inputs(config)
    ready = inputs["event_ready"].astype(np.int64)
    clocks, expected = range(RESET, RESET + LOADED, stride), _expected(config, inputs)
    for part, outputs in upset_runs(gates, inputs, clocks, inside(gates, flops)):
        events = np.where((outputs["event_valid"] & ready) != 0, _numbered(config, outputs), -1)
        if not np.array_equal(events[:, 0], expected):
            raise UnlikeModel(f"{config.tiles} tiles: the gates do not give the model's events")
        more = _counts(config, events[:, 1:]) - _counts(config, events[:, :1])
        differs = events[:, 1:] != events[:, :1]
        last = last_clock(differs)
        lost, added = missing(more), missing(-more)
        effects = {NEVER: differs[-AGAIN:].any(axis=0), CHANGED: lost + added > 0, MOVED: last >= 0}
        place = "relay." if config.relays else "merge."
        yield from classify_effects(part, effects, place, other_clocks=since(part, last), lost=lost, added=added)


def _inputs(config: TilesConfig) -> dict[str, NDArray[np.uint8]]:
    rng = np.random.default_rng(0)
    total = RESET + LOADED + PAUSE + AGAIN
    since = np.arange(total) - RESET
    busy = np.select([since < LOADED // 3, since < LOADED], [0.4, 1.2], 0.0)
    busy[-AGAIN + 8 : -AGAIN // 3] = 1.0
    offer = (rng.random((total, config.tiles)) < busy[:, None] / config.tiles) & (since >= 0)[:, None]
    offer[-AGAIN] = np.arange(config.tiles) == 0
    ready = rng.random(total) < 0.8
    ready[(since > 3 * LOADED // 4) & (since < 7 * LOADED // 8)] = False
    ready[RESET + LOADED : -AGAIN + 8] = True
    inputs = {"rst": (since < 0)[:, None], "offer": offer, "event_ready": ready[:, None]}
    return {name: values.astype(np.uint8) for name, values in inputs.items()}


def _numbered(config: TilesConfig, outputs: dict[str, NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return the tile of the offered event, and the event's number in that tile."""
    nothing = np.zeros_like(outputs["event_valid"])
    number, start = outputs.get("event_tile", nothing) << NUMBER_BITS, 0
    for name in (f"event_{field}" for field in FIELDS if f"event_{field}" in outputs):
        number = number | outputs[name] << start
        start += {"event_col": config.tile.column_bits, "event_row": config.tile.row_bits}.get(name, 1)
    return number


def _expected(config: TilesConfig, inputs: dict[str, NDArray[np.uint8]]) -> NDArray[np.int64]:
    """Return the golden model's events in the form of ``_numbered``; -1 in clocks without an event."""
    offered = [np.flatnonzero(offer[RESET:]) + 1 for offer in inputs["offer"].T]
    found = merge(offered, inputs["event_ready"][RESET:, 0], len(inputs["offer"]) - RESET)
    assert len(np.unique(found.tile)) == config.tiles, "a tile sends nothing"
    expected = np.full(len(inputs["offer"]), -1)
    expected[found.clock + RESET] = found.tile << NUMBER_BITS | found.number % (1 << config.tile.event_bits)
    return expected


def _counts(config: TilesConfig, events: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how often each event of each tile leaves, shape (events, runs)."""
    runs = events.shape[1]
    kinds = 1 << config.tile_bits + NUMBER_BITS
    places = (events + 1) * runs + np.arange(runs)
    counts = np.bincount(places.ravel(), minlength=(kinds + 1) * runs).reshape(-1, runs)
    return np.asarray(counts[1:])
