"""Test the timing model of a placed block, as OpenSTA and Yosys read it, and the wires of a placement."""

import json
import re
from pathlib import Path

import pytest

from eskin.flow.liberty.library import Library
from eskin.flow.macro import model
from eskin.flow.macro.model import Block
from eskin.rtl import yosys

CELLS = {
    "g0": ("UNLESS", {"A": "a", "B": "b", "Z": "n1"}),
    "f0": ("PERCH", {"BEAT": "clk", "NEXT": "n1", "WIPE": "b", "HELD": "n2"}),
    "g1": ("ECHO", {"A": "n2", "Z": "z"}),
}
BLOCK = Block("toy", ("clk", "a", "b", "unread"), ("z",), CELLS, {"n1": 0.01, "a": 0.02}, 20.0, 10.0)


def test_a_model_has_the_times_of_the_netlist(library: Library, tmp_path: Path) -> None:
    text, period_ns = model.liberty(BLOCK, library, tmp_path)
    # Tables of the example library: delay 0.03 + 0.2 slew + 4 load, transition 0.03 + 0.1 slew + 6 load, setup 0.08.
    setup = [0.03 + 0.2 * slew + 4 * (0.002 + 0.01) + 0.08 for slew in model.SLEWS_NS]
    found = re.search(
        r'pin\(a\).*?setup_rising;\s+rise_constraint\(limit\) \{ values\("(.*?)", "(.*?)", "(.*?)"\)', text, re.DOTALL
    )
    assert found
    assert [list(map(float, row.split(","))) for row in found.groups()] == [pytest.approx(setup, abs=2e-5)] * 3
    assert "pin(a) { direction : input; capacitance : 0.02200;" in text
    assert "pin(unread) { direction : input; capacitance : 0.00000;" in text
    assert "area : 200.000; cell_leakage_power : 0.260;" in text  # of 26 um2 at 10 pW
    assert period_ns == 0.0  # no path leads from flop to flop
    assert model.check(text, BLOCK, library, tmp_path) < 1e-4  # the tables are linear
    files = {"macro.lib": text.encode(), "outer.v": (tmp_path / "outer.v").read_bytes()}
    script = "read_liberty -lib macro.lib; read_verilog outer.v; hierarchy -check -top outer; write_json found.json"
    ports = json.loads(yosys.run(script, "", "found.json", files))["modules"]["toy"]["ports"]
    assert {name: port["direction"] for name, port in ports.items()} == dict.fromkeys(BLOCK.inputs, "input") | {
        "z": "output"
    }


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pin(b)", "pin(other)", "port b not found"),
        ("pin(z) { direction : output", "pin(z) { direction : input", "differ in the times of z"),
        ("timing_type : setup_rising", "timing_type : hold_rising", "differ"),
    ],
    ids=["a pin is missing", "a direction is wrong", "no setup time"],
)
def test_a_broken_model_is_found(library: Library, tmp_path: Path, old: str, new: str, message: str) -> None:
    text, _ = model.liberty(BLOCK, library, tmp_path)
    assert old in text
    with pytest.raises(RuntimeError, match=message):
        model.check(text.replace(old, new), BLOCK, library, tmp_path)


def test_a_wrong_time_is_found(library: Library, tmp_path: Path) -> None:
    text, _ = model.liberty(BLOCK, library, tmp_path)
    rows = ", ".join(['"0.9, 0.9, 0.9"'] * 3)
    wrong = re.sub(r"rise_constraint\(limit\) \{ values\(.*?\)", f"rise_constraint(limit) {{ values({rows})", text)
    assert model.check(wrong, BLOCK, library, tmp_path) > 0.5


def test_a_path_without_a_flop_is_refused(library: Library, tmp_path: Path) -> None:
    cells = CELLS | {"g1": ("UNLESS", {"A": "n2", "B": "a", "Z": "z"})}
    block = Block("toy", BLOCK.inputs, BLOCK.outputs, cells, {}, 20.0, 10.0)
    with pytest.raises(model.NoModel, match="a path without a flop leads from a to z"):
        model.liberty(block, library, tmp_path)


def test_wires_are_read_from_a_placement() -> None:
    text = """
SPECIALNETS 1 ;
   - clk ( * clk )
      + ROUTED li ( 34800 3680 ) li_mcon_m1
      NEW m1 320 ( 1000 3680 )
      ( 11000 * ) ;
NETS 2 ;
   - n1 ( g0 q )  ( g1 i )
      + ROUTED m1 ( 0 0 ) ( 2000 * )
         NEW m2 ( 2000 0 ) ( * -3000 )
         NEW m1 ( 28935 106260 ) m1_via_m2
         NEW m1 ( 7 7 ) ( * * ) ;
"""
    m1, m2 = (width * area + 2 * edge for width, area, edge in (model.WIRES["m1"], model.WIRES["m2"]))
    assert model.wires_pf(text) == pytest.approx({"clk": 10 * m1, "n1": 2 * m1 + 3 * m2})
