"""Test merge and skin of the golden model: order, fairness, addresses and files."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.textures import scan
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus
from eskin.model.tiles.config import TilesConfig, tiles_of
from eskin.model.tiles.merge import merge
from eskin.model.tiles.relay import relay
from eskin.model.tiles.run import simulate_skin

TILE = ReadoutConfig(rows=2, columns=3)
SKIN = TilesConfig.of(TILE, 2, 2)


def test_n_busy_tiles_get_one_place_in_n_and_every_clock_has_an_event() -> None:
    busy = np.zeros(50, np.int64)
    clock, tile, number = merge([busy, np.zeros(0, np.int64), busy, busy], np.ones(1, np.uint8), 400)
    assert clock.tolist() == list(range(1, 151))
    assert tile.tolist() == [0, 2, 3] * 50
    assert number.tolist() == [n for n in range(50) for _ in range(3)]


@pytest.mark.parametrize("relays", [1, 4])
def test_relay_stations_cost_a_clock_each_and_no_event(relays: int) -> None:
    stimulus = Stimulus.from_samples(TILE, scan(2, 3, 12, 1)[:200])
    near, far = (simulate_skin(TilesConfig.of(TILE, 1, 1, number), [stimulus]) for number in (0, relays))
    near["t"] += relays
    near = near[near["t"] < stimulus.clocks]
    assert np.array_equal(near, far)
    assert len(far) > 100


def test_a_line_is_full_at_two_events_a_station_and_loses_none() -> None:
    rng = np.random.default_rng(2)
    offered = np.sort(rng.integers(0, 500, 400))
    ready = (rng.random(64) < 0.8).astype(np.uint8)
    ready[40:] = 0
    for stations in (1, 2, 5):
        taken, left = relay(offered, ready, 3000, stations)
        assert len(left) == len(offered)
        assert (np.diff(left) > 0).all()
        assert ready[left % 64].all()
        assert (taken >= offered).all()
        held = [int((taken <= t).sum() - (left <= t).sum()) for t in range(1000)]
        assert max(held) == 2 * stations
    clock = relay(np.zeros(50, np.int64), np.ones(1, np.uint8), 100, 3).clock
    assert clock.tolist() == list(range(3, 53))  # one event per clock, three clocks on their way


def test_a_skin_without_relay_stations_says_nothing_of_them() -> None:
    assert "relays" not in SKIN.to_dict()
    far = TilesConfig.of(TILE, 2, 2, 3)
    assert TilesConfig.from_dict(far.to_dict()) == far
    assert far.to_dict() == SKIN.to_dict() | {"relays": 3}
    assert far.tile == SKIN.tile


def test_addresses_of_the_skin_and_of_its_tiles_belong_together() -> None:
    tile, row, column = (grid.ravel() for grid in np.mgrid[:4, :2, :3])
    events = make_events(0, row, column)
    on_skin = SKIN.on_skin(tile, events)
    assert {(x, y) for x, y in zip(on_skin["x"].tolist(), on_skin["y"].tolist(), strict=True)} == {
        (x, y) for x in range(6) for y in range(4)
    }
    index = on_skin["y"].astype(int) * SKIN.columns + on_skin["x"]
    assert index.tolist() == [taxel for i in range(4) for taxel in SKIN.taxels_of(i).tolist()]
    back, within = SKIN.in_tiles(on_skin)
    assert np.array_equal(back, tile)
    assert np.array_equal(within, events)


def test_a_recording_of_a_skin_is_read_as_any_other(tmp_path: Path) -> None:
    whole = Recording(make_events([4, 9], [3, 0], [5, 1], [True, False]), SKIN, 20)
    whole.save(tmp_path / "skin.npz")
    read = Recording.load(tmp_path / "skin.npz")
    assert read == whole
    assert read.config == SKIN
    with pytest.raises(InputError, match=r"x = 6, outside 0\.\.5 \(columns\)"):
        Recording(make_events([4], [0], [6]), SKIN, 20)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"rows": 5}, "rows must be a multiple of 2, the tiles in this direction, not 5"),
        ({"rows": 256}, "rows must be in 1..64, not 128"),
        ({"link": "four_phase"}, "tiles need the link stream to their merge, not four_phase"),
        ({"tile_rows": 65}, "tile_rows must be in 1..64, not 65"),
        ({"tile_rows": 16, "tile_columns": 8}, "a merge takes at most 64 tiles, not 16 x 8"),
        ({"relays": -1}, "relays must be in 0..16, not -1"),
        ({"registers": "spi"}, "tiles of a skin have no registers, not spi"),
    ],
)
def test_a_skin_that_cannot_be_is_one_sentence(fields: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        TilesConfig.from_dict(SKIN.to_dict() | fields)


def test_stimuli_that_do_not_belong_together_are_one_sentence() -> None:
    one = Stimulus.from_samples(TILE, np.zeros((4, 6), np.int32))
    other = Stimulus.from_samples(TILE, np.zeros((5, 6), np.int32))
    with pytest.raises(InputError, match="4 tiles need 4 stimuli, not 1"):
        simulate_skin(SKIN, [one])
    moved, longer = (
        dataclasses.replace(one, **fields)
        for fields in ({"sample_clock": one.sample_clock + 1}, {"clocks": one.clocks + 1})
    )
    assert len(simulate_skin(SKIN, [one] * 4)) == 0
    for wrong in (other, moved, longer):
        with pytest.raises(InputError, match="the tiles' stimuli must share the clocks"):
            simulate_skin(SKIN, [one, one, one, wrong])


def test_tiles_in_words_are_rows_and_columns() -> None:
    assert tiles_of("2x3") == (2, 3)
    assert (TilesConfig().tile_rows, TilesConfig().tile_columns) == (1, 1)
    for wrong in ("2", "x3", "2x", "ax3", "2x-3"):
        with pytest.raises(InputError, match=f"tiles must be rows and columns such as 4x4, not '{wrong}'"):
            tiles_of(wrong)
