"""Test the layout flow, and its checks on faulty layouts."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.flow.layout import cells, checks, circuit, environment, report, run
from eskin.flow.layout.checks import Comparison, Rules
from eskin.flow.layout.circuit import Circuit
from eskin.flow.layout.environment import Crashed
from eskin.flow.layout.report import Report, Try
from eskin.flow.layout.stages import Stages
from eskin.model.config import ReadoutConfig

PINS = {
    "inv_x0": "i nq",
    "buf_x2": "i q",
    "nand2_x0": "nq i0 i1",
    "nand3_x0": "nq i0 i1 i2",
    "nor2_x0": "nq i0 i1",
    "xor2_x0": "i0 i1 q",
    "dff_x1": "i clk q",
}
"""Cells that suffice for a readout, with their pins."""
SPICE = "".join(f".subckt {name} vdd vss {pins}\nM0 vdd i vss vss nfet\n.ends {name}\n" for name, pins in PINS.items())
KNOWN = circuit.read_spice(SPICE)
AREAS = dict.fromkeys(KNOWN, 10.0)

TOY = Circuit(
    "toy",
    ("a", "b", "clk", "unread"),
    ("z", "y"),
    {
        "g0": ("nand2_x0", {"nq": "n1", "i0": "a", "i1": "b"}),
        "g1": ("xor2_x0", {"i0": "n1", "i1": "a", "q": "n2"}),
        "g2": ("dff_x1", {"i": "n2", "clk": "clk", "q": "n3"}),
        "g3": ("buf_x2", {"i": "n3", "q": "z"}),
        "g4": ("inv_x0", {"i": "n3", "nq": "n4"}),
        "g5": ("nor2_x0", {"nq": "n5", "i0": "n4", "i1": "b"}),
        "g6": ("dff_x1", {"i": "n5", "clk": "clk", "q": "n6"}),
        "g7": ("buf_x2", {"i": "n6", "q": "y"}),
    },
)


def test_a_netlist_may_use_all_gates_but_the_misnamed_one() -> None:
    assert cells.usable([*KNOWN, "nexor2_x0", "fill_w2"]) == list(KNOWN)


def test_a_readout_becomes_cells(tmp_path: Path) -> None:
    library = tmp_path / "cells.lib"
    library.write_text(cells.liberty(cells.usable(KNOWN), AREAS))
    synthesised = circuit.synthesise(ReadoutConfig(rows=1, columns=2, resolution=4), library)
    made = circuit.circuit_of(synthesised)
    assert made.kinds["dff_x1"] > 20
    assert set(made.kinds) <= set(KNOWN)
    assert "test_enable" not in made.ports
    assert {"clk", "rst", "sample_0", "event_valid"} <= set(made.ports)
    assert "sample_0" not in made.read_ports  # below the resolution
    assert Circuit.from_dict(json.loads(json.dumps(vars(made)))) == made


def test_a_constant_is_refused() -> None:
    design = {"ports": {"q": {"direction": "output", "bits": ["0"]}}, "cells": {}}
    with pytest.raises(InputError, match=r"^output q of this readout is constant, and no checked cell"):
        circuit.of_json({"modules": {"top": design}}, "top")


@pytest.mark.command("layout")  # a layout takes half a minute
def test_blif_and_spice() -> None:
    small = Circuit("t", ("a",), ("z",), {"g0": ("inv_x0", {"nq": "z", "i": "a"})})
    assert small.blif() == ".model t\n.inputs a\n.outputs z\n.subckt inv_x0 nq=z i=a\n.end\n"
    assert small.spice(KNOWN, "t_r").endswith(".subckt t_r vdd vss a z\nXg0 vdd vss a z inv_x0\n.ends t_r\n.end\n")


def test_violations_are_read_and_no_rule_is_no_check(tmp_path: Path) -> None:
    path = tmp_path / "rules.lyrdb"
    item = "<item><category>'m1 area'</category><values><value>polygon: (0,0;1,1)</value></values></item>"
    rule = "<category><name>m1 area</name></category>"
    path.write_text(f"<r><categories>{rule}{rule}</categories><items>{item}</items></r>")
    assert checks.read_rules(path) == Rules(2, ("m1 area at polygon: (0,0;1,1)",))
    path.write_text("<r><categories/><items/></r>")
    with pytest.raises(Crashed, match="the rule check checked nothing"):
        checks.read_rules(path)


def test_the_comparison_holds_ports_to_their_names() -> None:
    deck = checks.comparing("flat\n\n# Resistors\nextract\n\nnetlist\n\nalign\nok = compare\n")
    assert deck.index("connect(m1, names(68))") < deck.index("extract") < deck.index("same_nets!")
    with pytest.raises(Crashed, match="has another form"):
        checks.comparing("flat\nalign\n")


CLEAN = Rules(194, ())


def made_of(*tries: Try, comparison: Comparison | None = None, proved: int = 5) -> Report:
    return Report("toy", ReadoutConfig(), TOY, 100.0, proved, 5, tries, comparison, {})


def test_the_closing_line_and_the_problems() -> None:
    equal = Comparison(True, 47, 82, 8)
    good = made_of(Try(0.3, "a segment is open"), Try(0.35, "", 18.2, 18.2, CLEAN), comparison=equal)
    assert good.closing_line() == "layout: toy, 8 cells, 18 x 18 um, 0 violations, netlist equal"
    assert not good.problems
    assert made_of(Try(0.3, "", 18.2, 18.2, CLEAN)).closing_line().endswith("0 violations, netlist not compared")
    bad = made_of(Try(0.3, "", 18.2, 18.2, CLEAN), comparison=Comparison(False, 47, 82, 8, ("a / B",)), proved=4)
    assert bad.problems == [
        "1 of 5 points of the netlist differ from the RTL",
        "the layout's netlist differs from the cells': a / B first",
    ]
    assert bad.closing_line().endswith("netlist differs")
    failed = made_of(Try(0.3, "a segment is open"))
    assert failed.problems == ["margin 0.30: a segment is open"]
    assert failed.closing_line() == "layout: toy, 8 cells, not routed, netlist not compared"
    broken = made_of(Try(0.3, "1 violations, m1 area at x", 18.2, 18.2, Rules(194, ("m1 area at x",))))
    assert broken.problems == ["margin 0.30: 1 violations, m1 area at x"]
    assert "1 violations" in broken.closing_line()


def test_a_report_says_where_it_is_from() -> None:
    said = made_of(Try(0.3, "", 20.0, 10.0, CLEAN), comparison=Comparison(True, 47, 82, 8)).to_dict("make layout")
    assert said["command"] == "make layout"
    assert {"commit", "date"} <= set(said)
    assert said["utilisation"] == 0.5
    assert said["rules"] == {"checked": 194, "violations": ()}
    assert said["comparison"]["transistors"] == 82
    assert "coriolis-eda==2.5.4" in said["packages"]
    assert report.command_of(ReadoutConfig(rows=2, columns=2), False) == "make layout ROWS=2 COLUMNS=2 COMPARE=0"


def test_a_stage_is_kept_until_its_inputs_change_and_begins_anew_after_a_stop(tmp_path: Path) -> None:
    said: list[str] = []

    def make(part: Path) -> None:
        (part / "result").write_text(str(len(said)))

    def stop(part: Path) -> None:
        (part / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Stages(tmp_path, said.append).made("place", ("a",), stop)
    first = Stages(tmp_path, said.append).made("place", ("a",), make)
    assert [path.name for path in first.iterdir() if path.name == "half"] == []
    again = Stages(tmp_path, said.append)
    assert again.made("place", ("a",), stop) == first
    assert again.seconds == {"place": 0.0}
    other = Stages(tmp_path, said.append).made("place", ("b",), make)
    assert said == ["place", "place", "place: kept from an earlier run", "place"]
    assert [path.name for path in tmp_path.iterdir()] == [other.name]


def layout_of(
    folder: Path, library: Path, known: dict[str, circuit.SpiceCell] = KNOWN, circuit: Circuit = TOY
) -> run.Layout:
    return run.Layout(circuit, 250.0, library, known, Stages(folder, lambda stage: None))


def test_margins_are_tried_until_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check three attempts: a crash, an open segment, and a rule violation."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "drc.drc").touch()

    def place(program: str, *words: str, folder: Path) -> None:
        assert (folder / "toy.blif").read_text() == TOY.blif()
        if words[-1] == "0.1":
            raise Crashed("place ended with code -11: no word")
        said = {"routed": words[-1] != "0.2", "width_um": 1.0, "height_um": 2.0}
        (folder / "placed.json").write_text(json.dumps(said))

    def rules(gds: Path, top: str, deck: Path, folder: Path) -> None:
        item = "<item><category>a</category></item>" if "0.30" in str(gds) else ""
        text = f"<r><categories><category/></categories><items>{item}</items></r>"
        (folder / "rules.lyrdb").write_text(text)

    monkeypatch.setattr(environment, "run", place)
    monkeypatch.setattr(checks, "rules", rules)
    tries, placed = layout_of(tmp_path / "work", library).route((0.1, 0.2, 0.3, 0.4, 0.5))
    assert [one.problem for one in tries] == [
        "place ended with code -11: no word",
        "a segment is open",
        "1 violations, a at nowhere",
        "",
    ]
    assert placed
    assert placed.name.startswith("place-0.40-")
    tries, placed = layout_of(tmp_path / "work", library).route((0.1, 0.2))
    assert tries[-1].problem == "a segment is open"
    assert placed is None


def test_missing_tools_and_wrong_options_are_refused_in_one_sentence(
    refuses: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(environment, "VENV", folder)
    command = "layout --rows 2 --columns 2"
    refuses("error: the layout's packages are not there; `make layout` installs them", command)
    (folder / ".installed").touch()
    monkeypatch.setattr(shutil, "which", lambda name: None)
    refuses("error: klayout not found; install with: apt-get install klayout\n", command)
    refuses("error: reset must be sync, not 'async'", command, "--reset async")
    refuses("error: --name must be the plain name of a folder, not '../up'\n", command, "--name ../up")


# What follows needs the 0.7 GB of the layout's environment, which the gate does not install.
try:
    environment.check()
    ABSENT = ""
except InputError as error:
    ABSENT = str(error)
NEEDS_TOOLS = pytest.mark.skipif(bool(ABSENT), reason=ABSENT)


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> tuple[run.Layout, Path]:
    """Return a placed and routed layout of eight cells, and its folder."""
    folder = tmp_path_factory.mktemp("toy")
    library = run._cells(Stages(folder, lambda stage: None))
    layout = layout_of(folder, library, circuit.read_spice((library / "cells.spi").read_text()))
    return layout, layout.place(1.0)


@NEEDS_TOOLS
def test_a_small_layout_is_clean_and_equal(toy: tuple[run.Layout, Path]) -> None:
    layout, placed = toy
    found = layout.judge(1.0, placed)
    assert found.problem == ""
    assert found.rules
    assert found.rules.checked > 150
    compared = layout.compare(placed)
    assert compared.equal
    assert compared.ports == 7  # of eight: one is read by nothing
    assert compared.transistors == sum(layout.known[kind].text.count("\nM") for kind, _ in TOY.cells.values())


@NEEDS_TOOLS
@pytest.mark.parametrize("pairs", [{"n5": "n2"}, {"a": "b", "b": "a"}], ids=["a wire moved", "two ports exchanged"])
def test_a_broken_connection_is_found(toy: tuple[run.Layout, Path], tmp_path: Path, pairs: dict[str, str]) -> None:
    layout, placed = toy
    other = dict(TOY.cells)
    for name in ("g0", "g1", "g5", "g6"):
        kind, pins = TOY.cells[name]
        other[name] = (kind, {pin: pairs.get(wire, wire) for pin, wire in pins.items()})
    circuit = Circuit(TOY.top, TOY.inputs, TOY.outputs, other)
    compared = layout_of(tmp_path, layout.library, layout.known, circuit).compare(placed)
    assert not compared.equal
    assert compared.differ


@NEEDS_TOOLS
def test_a_broken_rule_is_found(toy: tuple[run.Layout, Path], tmp_path: Path) -> None:
    layout, placed = toy
    narrow = (
        "import klayout.db as db, sys; y = db.Layout(); y.read(sys.argv[1]); "
        "y.top_cell().shapes(y.layer(70, 20)).insert(db.DBox(5, 5, 9, 5.1)); y.write(sys.argv[2])"
    )
    gds = tmp_path / f"{layout.top}.gds"
    words = [str(environment.python()), "-I", "-c", narrow, str(placed / gds.name), str(gds)]
    subprocess.run(words, check=True)
    shutil.copy(placed / "placed.json", tmp_path)
    found = layout_of(tmp_path / "work", layout.library, layout.known).judge(1.0, tmp_path)
    assert found.rules
    assert found.rules.violations
    assert {one.partition(" at ")[0] for one in found.rules.violations} <= {"m3 width", "m3 area"}
    assert "violations, m3" in found.problem


@NEEDS_TOOLS
def test_an_open_segment_is_found(
    toy: tuple[run.Layout, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that an open net left by a limited router is found."""
    layout, _ = toy
    plain = environment.run
    monkeypatch.setattr(environment, "run", lambda *words, **named: plain(*words, "1", **named))
    tries, placed = layout_of(tmp_path, layout.library, layout.known).route((1.0,))
    assert tries[-1].problem == "a segment is open"
    assert placed is None
