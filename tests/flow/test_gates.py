"""Test cell models from a Liberty file, and compare netlists with the model."""

import dataclasses
import re
from pathlib import Path
from typing import NamedTuple

import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.runner.process import MismatchFound, Tally, play_runs, scenario_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.flow import programs
from eskin.flow.asic.synthesis import Netlist, synthesise
from eskin.flow.gatesim.flat_netlist import FlatNetlist, flatten
from eskin.flow.gatesim.models import models
from eskin.flow.gatesim.sim import from_reset
from eskin.flow.liberty.library import Library, read
from eskin.model.config import ReadoutConfig
from tests.flow import example_library

CONFIG = ReadoutConfig(rows=1, columns=2, resolution=4)
REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "ihp-sg13g2" / "sg13g2_stdcell_typ_1p20V_25C.lib"


class Made(NamedTuple):
    """A netlist with its cell models, and its flat form."""

    library: Library
    netlist: Netlist
    flat: FlatNetlist
    cells: str


def make(config: ReadoutConfig, path: Path) -> Made:
    """Return the netlist of a readout with the models of its cells."""
    library = read(path)
    made = synthesise(config, library)
    flat = flatten(made.text, made.top, library.content)
    return Made(library, made, flat, models(library, {cell.kind for cell in flat.cells}))


@pytest.fixture(scope="module")
def made(library: Library) -> Made:
    return make(CONFIG, library.path)


def play(config: ReadoutConfig, text: str, folder: Path) -> Tally:
    """Simulate the scenarios of the readout on a netlist."""
    return play_runs(build(config, "icarus", text=text), scenario_runs(config, 0, "make sim GATES=1"), folder)


def test_a_netlist_does_what_the_model_does(made: Made, tmp_path: Path) -> None:
    tally = play(CONFIG, made.netlist.text + made.cells, tmp_path)
    assert tally.runs == 9
    assert tally.events > 0
    assert tally.drained > 0


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("assign Z = ((A & ~B) | (B & ~A));", "assign Z = (A | B);"),  # an XOR that is none
        ("if (open_ === 1'b1) held_ = data_;", "if (open_ === 1'b1) held_ = 1'b0;"),  # an enable that is stuck
        ("STATE <= next_;", "STATE <= 1'b0;"),  # flops that never fire: a netlist without any event
    ],
    ids=["xor", "enable", "no event"],
)
def test_a_wrong_cell_is_noticed(made: Made, right: str, wrong: str, tmp_path: Path) -> None:
    assert made.cells.count(right) == 1
    with pytest.raises(MismatchFound):
        play(CONFIG, made.netlist.text + made.cells.replace(right, wrong), tmp_path)


def test_reset_alone_wakes_every_flop(made: Made, tmp_path: Path) -> None:
    unknown = from_reset(made.flat, made.library, tmp_path)
    assert unknown.clean
    flops = sum(cell.kind == "PERCH" for cell in made.flat.cells)
    assert unknown.flops == flops > 30


def test_a_flop_that_reset_does_not_reach_stays_unknown(made: Made, tmp_path: Path) -> None:
    deaf = [
        dataclasses.replace(c, pins={p: "1'b0" if n == "rst" else n for p, n in c.pins.items()})
        for c in made.flat.cells
    ]
    unknown = from_reset(dataclasses.replace(made.flat, cells=tuple(deaf)), made.library, tmp_path)
    assert not unknown.clean
    assert len(unknown.in_reset) > 30


@pytest.mark.skipif(not REAL.is_file(), reason=f"no cell library {REAL.name} beside the checkout")
def test_a_netlist_of_a_real_library_does_what_the_model_does(tmp_path: Path) -> None:
    config = CONFIG.replace(encoding="nlcs", frontend="analog", link="four_phase", reset="async", leak_period=5)
    made = make(config, REAL)
    assert from_reset(made.flat, made.library, tmp_path).clean
    assert play(config, made.netlist.text + made.cells, tmp_path).events > 0


def test_a_flop_whose_clock_is_unknown_loses_its_state(made: Made, tmp_path: Path) -> None:
    bench = """
module bench;
  reg clk = 0, d = 1, wipe = 0;
  wire q, gated;
  PERCH flop (.BEAT(gated), .NEXT(d), .WIPE(wipe), .HELD(q));
  reg want = 1;
  SLUMBER gate (.BEAT(clk), .WANTED(want), .TRIAL(1'b0), .BEATS(gated));
  initial begin
    #1 wipe = 1;
    #1 clk = 1; #1 $write("%b", q); clk = 0;
    #1 d = 0; want = 0; #1 clk = 1; #1 $write("%b", q); clk = 0;
    #1 want = 1'bx; #1 clk = 1; #1 $write("%b", q); clk = 0;
    #1 want = 1; wipe = 0; #1 $write("%b", q); wipe = 1; d = 1'bx; #1 clk = 1; #1 $display("%b", q);
  end
endmodule
"""
    assert programs.icarus([models(made.library, {"PERCH", "SLUMBER"}), bench], "bench", tmp_path).split() == ["11x0x"]


@pytest.mark.command("gatesim")
def test_cells_that_are_missing_or_say_nothing_are_one_sentence(library: Library, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^the cell library .* has no cell OWL; give the library of the netlist$"):
        models(library, {"OWL"})
    silent = tmp_path / "silent.lib"
    silent.write_text(re.sub(r'function : "!A";', "", example_library.library(), count=1))
    with pytest.raises(
        InputError, match=r"^the cell library does not define the function of HOOT at Z; keep the cell out of netlists$"
    ):
        models(read(silent), {"HOOT"})
    with pytest.raises(
        InputError, match=r"^the netlist does not fit the cell library: .*; give netlist and library of one run$"
    ):
        flatten("module top(a); input a; OWL o(.A(a)); endmodule", "top", example_library.library().encode())
