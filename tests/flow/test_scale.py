"""Arrays with lines of their size: repeaters change no function, and the timing is that of OpenSTA."""

from __future__ import annotations

import copy
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flow.asic.library import Library, read
from flow.scale import check
from flow.scale.array import NONE, Array, build, repeaters
from flow.scale.delays import look
from flow.scale.lines import Lines, best_repeater
from flow.scale.measure import lines, sizes_of
from flow.scale.places import Places
from flow.scale.timing import Timing
from flow.scale.wire import NO_WIRE, Wire
from model.config import ReadoutConfig
from model.errors import InputError
from tests.flow import quill

NEEDS_STA = pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")

WIRE = Wire()
PITCH_UM = 2000.0


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Return our own library."""
    path = tmp_path_factory.mktemp("quill") / "quill.lib"
    path.write_text(quill.library())
    return read(path)


@pytest.fixture(scope="module")
def plain(library: Library) -> Array:
    """Return four taxels as cells."""
    return build(ReadoutConfig(rows=2, columns=2), library)


def drawn(plain: Array, wire: Wire = WIRE, pitch_um: float = PITCH_UM) -> Lines:
    """Return the lines of a copy of an array."""
    array = copy.deepcopy(plain)
    return lines(array, wire, pitch_um, best_repeater(repeaters(array.kinds), WIRE))


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
    """Also where a cell within the taxel reads what the taxel sends."""
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
    delay = float(kind.through(found.slew_s, np.array([found.load_f]))[0][0]) + WIRE.way_s(found.spacing_um, pin)
    assert found.s_per_mm == pytest.approx(1e3 * delay / found.spacing_um, rel=0.001, abs=0)
    slower = best_repeater(repeaters(plain.kinds), Wire(10 * WIRE.ohm_per_um, WIRE.farad_per_um))
    assert slower.s_per_mm > found.s_per_mm
    assert slower.spacing_um < found.spacing_um


def test_cells_stand_where_their_wires_pull_them(plain: Array) -> None:
    places = Places(plain, 200.0)
    drivers, _ = plain.ends()
    assert places.of(drivers[plain.taxels[3]["request 0"]]) == (300.0, 300.0)
    assert all(-1 <= x <= 401 and -1 <= y <= 401 for x, y in places.of_cells)
    rows = {
        row: [y for name, (_, y) in zip(plain.names, places.of_cells, strict=True) if name.startswith(f"row_{row}.")]
        for row in (0, 1)
    }
    assert np.mean(rows[0]) < np.mean(rows[1])


def test_a_table_is_read_as_one_looks_a_number_up(plain: Array) -> None:
    table = plain.kinds["HOOT"].arcs[0].delay[0]
    slews, loads = np.array([0.02e-9, 0.26e-9, 1.0e-9]), np.array([0.001e-12, 0.05e-12, 0.2e-12])
    wanted = [0.03 + 0.2 * s + 4.0 * c for s, c in zip(slews * 1e9, loads * 1e12, strict=True)]
    assert look(table, slews, loads) * 1e9 == pytest.approx(wanted)


@NEEDS_STA
@pytest.mark.parametrize("wire", [NO_WIRE, Wire(0.0, WIRE.farad_per_um)], ids=["no wires", "wires"])
def test_the_highest_clock_is_that_of_opensta(plain: Array, library: Library, wire: Wire) -> None:
    """Without the resistance of wires, which the two take into account in other ways."""
    found = drawn(plain, wire)
    timing = Timing(found.array, found)
    assert timing.worst().period_s == pytest.approx(check.period_s(timing, library), rel=0.02)


def test_the_command_leaves_numbers(library: Library, tmp_path: Path) -> None:
    out = tmp_path / "scale.json"
    words = ["asic-scale", f"--lib={library.path}", "--sizes=2x1", "--pitch=500", f"--out={out}"]
    done = subprocess.run([sys.executable, "-m", "flow", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(out.read_text())
    assert found["command"] == "make asic SCALE=1 LIB=quill.lib PITCH=500 SIZES=2x1"
    assert [array["taxels"] for array in found["results"]] == [2]
    assert found["pitch_um"] == 500
    for array in found["results"]:
        without, wired = array["without_wires"], array["with_wires"]
        assert without["fmax_hz"] > wired["fmax_hz"] > 1e6
        assert wired["area_um2_per_taxel"] > array["cells_um2_per_taxel"] > array["taxel_um2"] > 0
        assert array["synthesis_s"] > 0
        assert wired["path_s"] > wired["path_in_repeaters_s"] + wired["path_in_wires_s"]


@pytest.mark.parametrize("sizes", ["8", "8x", "0x4", "65x1", "8x8;4x4", ""])
def test_what_is_no_size_is_one_sentence(sizes: str) -> None:
    with pytest.raises(
        InputError, match=r"^--sizes must be sizes of 1 to 64 rows and columns such as 8x8,12x16, not '"
    ):
        sizes_of(sizes)


def test_bad_input_leaves_nothing(library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out" / "scale.json"
    words = ["asic-scale", f"--lib={library.path}", "--sizes=8x8,9", f"--out={out}"]
    done = subprocess.run([sys.executable, "-m", "flow", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "not '9'" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not out.parent.exists()
