"""Test array estimates: repeaters preserve the function, and the timing equals OpenSTA's."""

import json
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.flow.liberty.library import Library
from eskin.flow.scale.array import NONE, Array, build, repeaters
from eskin.flow.scale.lines import Lines, best_repeater
from eskin.flow.scale.measure import designs_of, measure, sizes_of
from eskin.flow.scale.placement import Placement
from eskin.flow.scale.skin import SkinPlacement, Spot, build_skin
from eskin.flow.scale.timing import FROM_PORT, Timing
from eskin.flow.wire import NO_WIRE, Wire
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig
from eskin.rtl.delivery import ports
from tests.flow import array_in_opensta

NEEDS_STA = pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")

WIRE = Wire()
PITCH_UM = 2000.0


@pytest.fixture(scope="module")
def plain(library: Library) -> Array:
    """Return four taxels as cells."""
    return build(ReadoutConfig(rows=2, columns=2), library)


def drawn(plain: Array, wire: Wire = WIRE, pitch_um: float = PITCH_UM) -> Lines:
    """Return the lines of a copy of an array."""
    array = plain.copy()
    return Lines(array, Placement(array, pitch_um), wire, best_repeater(repeaters(array.kinds), WIRE))


def test_every_taxel_is_the_same_module_and_nothing_is_lost(plain: Array) -> None:
    assert len(plain.taxels) == 4
    drivers, readers = plain.ends()
    assert {net for net in readers if net not in drivers} == set()
    taxel = plain.taxels[3]
    assert taxel["granted 0"] in readers
    assert drivers[taxel["request 0"]].what == "taxel"
    assert plain.area_um2() == pytest.approx(
        4 * plain.taxel_area_um2 + sum(plain.kinds[kind].area_um2 for kind in plain.cells)
    )


def test_a_line_with_repeaters_still_ends_where_it_did(plain: Array) -> None:
    found = drawn(plain)
    array = found.array
    assert found.added == len(array.cells) - len(plain.cells) > 20
    assert NONE not in [
        net
        for name, pins in zip(array.names, array.pins, strict=True)
        for net in pins.values()
        if name.startswith("repeater_")
    ]
    before_drivers, before = plain.ends()
    drivers, readers = array.ends()

    def source(net: int) -> tuple[str, int, str]:
        end = drivers[net]
        while end.what == "cell" and array.names[end.number].startswith("repeater_"):
            into = next(pin for pin in array.pins[end.number] if pin != end.pin)
            end = drivers[array.pins[end.number][into]]
        return end[:3]

    for net, ends in before.items():
        for end in ends:
            now = next(n for n, others in readers.items() if any(o[:3] == end[:3] for o in others))
            assert source(now) == before_drivers[net][:3]


def test_a_net_is_loaded_by_its_pins_and_its_wire_and_no_more(plain: Array) -> None:
    """Check that each net has the load of its pins and its wire, also if a taxel reads its own output."""
    found = drawn(plain)
    load = Timing(found.array, found).load
    drivers, readers = found.array.ends()
    pins = {net: [*ends, *([drivers[net]] if net in drivers else [])] for net, ends in readers.items()}
    assert any(drivers[net].load_f for net in found.load_f if drivers[net].what == "taxel")
    for net, on in pins.items():
        assert load[net] == pytest.approx(sum(end.load_f for end in on) + found.load_f.get(net, 0.0), rel=1e-9, abs=0)
    near = drawn(plain, pitch_um=1e-6)  # all that is left of a wire is that to each pin
    read = [end.pins for ends in plain.ends()[1].values() for end in ends]
    drivers = {net: plain.ends()[0][net] for net in near.load_f if net < plain.nets}
    trees = sum(end.pins for net in plain.trees() for end in plain.ends()[1].get(net, []))
    wires = WIRE.farad_per_um * WIRE.within_um * (sum(read) - trees + sum(end.pins for end in drivers.values()))
    assert sum(near.load_f.values()) == pytest.approx(wires, rel=1e-6, abs=0)


def test_a_longer_line_has_more_repeaters_and_is_slower(plain: Array) -> None:
    near, far = drawn(plain, pitch_um=200.0), drawn(plain, pitch_um=4000.0)
    assert far.added > near.added
    assert far.length_um > near.length_um > 0
    periods = [Timing(found.array, found).worst().period_s for found in (drawn(plain, NO_WIRE), near, far)]
    assert periods == sorted(periods)
    assert periods[2] > 1.5 * periods[0]
    heavy = max(far.load_f.values()), far.repeater.load_f
    assert heavy[0] <= heavy[1]  # no repeater has more wire behind it than the fastest line has


def test_the_fastest_line_has_the_least_delay_of_all_spacings(plain: Array) -> None:
    found = best_repeater(repeaters(plain.kinds), WIRE)
    kind = plain.kinds[found.kind]
    pin = next(iter(kind.loads.values()))
    assert found.load_f == pytest.approx(pin + WIRE.farad_per_um * found.spacing_um, abs=0)
    delay = float(kind.worst(found.slew_s, np.array([found.load_f]))[0][0]) + WIRE.way_s(found.spacing_um, pin)
    assert found.s_per_mm == pytest.approx(1e3 * delay / found.spacing_um, rel=0.001, abs=0)
    slower = best_repeater(repeaters(plain.kinds), Wire(10 * WIRE.ohm_per_um, WIRE.farad_per_um))
    assert slower.s_per_mm > found.s_per_mm
    assert slower.spacing_um < found.spacing_um


def test_cells_stand_where_their_wires_pull_them(plain: Array) -> None:
    places = Placement(plain, 200.0)
    drivers, _ = plain.ends()
    assert places.of(drivers[plain.taxels[3]["request 0"]]) == (300.0, 300.0)
    assert all(-1 <= x <= 401 and -1 <= y <= 401 for x, y in places.of_cells)
    rows = {
        row: [y for name, (_, y) in zip(plain.names, places.of_cells, strict=True) if name.startswith(f"row_{row}.")]
        for row in (0, 1)
    }
    assert np.mean(rows[0]) < np.mean(rows[1])


def test_a_path_between_flops_touches_no_port(plain: Array) -> None:
    timing = Timing(plain, drawn(plain, NO_WIRE))
    names = {name for _, name, _, _ in plain.ports}
    inner, whole = timing.worst(ports=False), timing.worst()
    assert inner.period_s <= whole.period_s
    assert not {inner.start.split("[")[0], inner.end.split("[")[0]} & names
    timing.arrival[FROM_PORT] += 1e-6  # nothing that comes from a port is looked at
    assert timing.worst(ports=False).period_s == inner.period_s
    assert timing.worst().period_s > whole.period_s + 1e-6


@NEEDS_STA
@pytest.mark.parametrize("wire", [NO_WIRE, Wire(0.0, WIRE.farad_per_um)], ids=["no wires", "wires"])
def test_the_highest_clock_is_that_of_opensta(plain: Array, library: Library, wire: Wire) -> None:
    """Compare the highest clock with OpenSTA, without wire resistance."""
    found = drawn(plain, wire)
    timing = Timing(found.array, found)
    assert timing.worst().period_s == pytest.approx(array_in_opensta.period_s(timing, found, library), rel=0.02)


def test_the_command_leaves_numbers(library: Library, call: Any, folder: Path) -> None:
    code, _, error = call(f"asic-scale --lib={library.path} --sizes=2x1 --pitch=500 --out=scale.json")
    assert code == 0, error
    found = json.loads((folder / "scale.json").read_text())
    assert found["command"] == "make asic SCALE=1 LIB=quill_typ.lib PITCH=500 SIZES=2x1"
    assert [array["taxels"] for array in found["results"]] == [2]
    assert found["pitch_um"] == 500
    for array in found["results"]:
        without, wired = array["without_wires"], array["with_wires"]
        assert without["fmax_hz"] > wired["fmax_hz"] > 1e6
        assert wired["between_flops_hz"] >= wired["fmax_hz"]
        assert wired["area_um2_per_taxel"] > array["cells_um2_per_taxel"] > array["taxel_um2"] > 0
        assert array["synthesis_s"] > 0
        assert wired["path_s"] > wired["path_in_repeaters_s"] + wired["path_in_wires_s"]


@pytest.fixture(scope="module")
def far_tiles(library: Library) -> tuple[Array, Array, list[Spot]]:
    """Return two distant tiles with two relay stations each, and one of these tiles."""
    return build_skin(TilesConfig.of(ReadoutConfig(rows=1, columns=2), 2, 1, 2), library)


def test_a_skin_has_all_cells_of_its_tiles_stations_and_merge(
    far_tiles: tuple[Array, Array, list[Spot]], library: Library
) -> None:
    skin, tile, spots = far_tiles
    owners = Counter(name.split(".")[0] for name in skin.names)
    assert owners["tile_0"] == owners["tile_1"] == len(tile.cells)
    assert owners["relay_0_0"] == owners["relay_0_1"] == owners["relay_1_0"] == owners["relay_1_1"] > 0
    assert set(owners) == {"tile_0", "tile_1", "merge", *(f"relay_{i}_{k}" for i in (0, 1) for k in (0, 1))}
    assert len(spots) == len(skin.cells)
    drivers, readers = skin.ends()
    assert {net for net in readers if net not in drivers} == set()
    outside = {(way, name, bit) for way, name, bit, _ in skin.ports}
    given = ports(skin.config)
    assert outside - {("input", "test_enable", 0)} == {
        (port["direction"], port["name"], bit) for port in given for bit in range(port["width"])
    }


def test_the_lines_of_a_skin_go_from_tile_to_station_to_merge(far_tiles: tuple[Array, Array, list[Spot]]) -> None:
    skin, tile, spots = far_tiles
    drivers, readers = skin.ends()

    def reads(name: str) -> set[str]:
        """Return the parts whose cells read the outputs of a part."""
        nets = {net for net, end in drivers.items() if end.what == "cell" and skin.names[end.number].startswith(name)}
        ends = [end for net in nets for end in readers.get(net, []) if end.what == "cell"]
        return {skin.names[end.number].split(".")[0] for end in ends} - {name.rstrip(".")}

    assert reads("tile_1.") == {"relay_1_0"}
    assert reads("relay_1_0.") == {"tile_1", "relay_1_1"}
    assert reads("relay_1_1.") == {"relay_1_0", "merge"}
    assert reads("merge.") == {"relay_0_1", "relay_1_1"}
    places = SkinPlacement(skin, 200.0, tile, spots)
    where = {
        name.split(".")[0]: spot
        for name, spot in zip(skin.names, places.of_cells, strict=True)
        if not name.startswith("tile")
    }
    assert where["merge"] == where["relay_0_1"] == where["relay_1_1"] == (200.0, 200.0)
    assert where["relay_0_0"] == (0.0, 100.0)
    assert where["relay_1_0"] == (0.0, 300.0)
    at = {port[1:3]: place for port, place in zip(skin.ports, places.of_ports, strict=True)}
    assert at["sample", 3 * 12] == (300.0, 300.0)  # taxel 1 of tile 1
    assert (at["sample_valid", 0], at["sample_valid", 1]) == ((0.0, 100.0), (0.0, 300.0))
    assert at["event_valid", 0] == (0.0, 200.0)


@NEEDS_STA
def test_the_clock_of_a_skin_is_that_of_opensta(far_tiles: tuple[Array, Array, list[Spot]], library: Library) -> None:
    skin, tile, spots = far_tiles
    wire = Wire(0.0, WIRE.farad_per_um)
    array = skin.copy()
    found = Lines(array, SkinPlacement(array, 4000.0, tile, spots), wire, best_repeater(repeaters(skin.kinds), WIRE))
    timing = Timing(found.array, found)
    assert timing.worst().period_s == pytest.approx(array_in_opensta.period_s(timing, found, library), rel=0.02)


def test_tiles_are_measured_in_all_ways_that_are_asked_for(library: Library, tmp_path: Path) -> None:
    out = tmp_path / "scale.json"
    designs = designs_of(ReadoutConfig(), "1x2", "1x2", "0,1")
    seen: list[dict[str, object]] = []
    for _ in range(2):  # the second finds all of it
        seen += measure(designs, library, WIRE, 500.0, out)
    assert seen[:2] == seen[2:]
    found = json.loads(out.read_text())
    assert found["command"] == "make asic SCALE=1 LIB=quill_typ.lib PITCH=500 SIZES=1x2 TILES=1x2 RELAYS=0,1"
    assert [(r["tile_rows"], r["tile_columns"], r["relays"]) for r in found["results"]] == [(1, 2, 0), (1, 2, 1)]
    assert found["results"][1]["cells_um2_per_taxel"] > found["results"][0]["cells_um2_per_taxel"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("8x8", "", "1"), "--relays needs tiles; add --tiles, or leave --relays out"),
        (("8x8", "2x2", "1,x"), "--relays must be numbers of stations such as 0,1,2, not 'x'"),
        (("8x8", "3x2", "1"), "rows must be a multiple of 3, the tiles in this direction, not 8"),
        (("8x8", "2", ""), "tiles must be rows and columns such as 4x4, not '2'"),
    ],
)
def test_tiles_that_cannot_be_are_one_sentence(words: tuple[str, str, str], sentence: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(sentence)}"):
        designs_of(ReadoutConfig(), *words)


@pytest.mark.parametrize("sizes", ["8", "8x", "0x4", "65x1", "8x8;4x4", ""])
def test_what_is_no_size_is_one_sentence(sizes: str) -> None:
    with pytest.raises(
        InputError, match=r"^--sizes must be sizes of 1 to 64 rows and columns such as 8x8,12x16, not '"
    ):
        sizes_of(sizes)
