"""Test the layout flow, and its checks on faulty layouts."""

import dataclasses
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.base.workers.engine import Local
from eskin.flow.layout import cells, checks, circuit, environment, report, run
from eskin.flow.layout.checks import Comparison, Electrical, Rules
from eskin.flow.layout.circuit import Circuit
from eskin.flow.layout.environment import Crashed
from eskin.flow.layout.report import Report, Try
from eskin.flow.layout.stages import Stages
from eskin.flow.layout.tree import ClockTree, tree_of
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


def placed_of(**changed: dict[str, str]) -> Circuit:
    """Return TOY with a clock tree of two levels, and with other wires at some pins."""
    cells = {
        "spare_buffer_0": ("buf_x4", {"i": "clk", "q": "root"}),
        "spare_buffer_4": ("buf_x4", {"i": "root", "q": "left"}),
        "spare_buffer_8": ("buf_x4", {"i": "root", "q": "right"}),
    }
    leaves = {"g2": {"clk": "left"}, "g6": {"clk": "right"}}
    cells |= {f"subckt_{name}": (kind, pins | leaves.get(name, {})) for name, (kind, pins) in TOY.cells.items()}
    for name, pins in changed.items():
        kind, old = cells[name]
        cells[name] = (kind, old | pins)
    return Circuit(TOY.top, TOY.inputs, TOY.outputs, cells)


def test_a_clock_tree_changes_nothing_else() -> None:
    assert tree_of(TOY, TOY) == ClockTree(0, (0, 0), 2)
    assert tree_of(TOY, placed_of()) == ClockTree(3, (2, 2), 2)
    assert tree_of(TOY, placed_of(subckt_g6={"clk": "root"})) == ClockTree(3, (1, 2), 3)


@pytest.mark.parametrize(
    "changed",
    [
        {"subckt_g6": {"clk": "n1"}},
        {"subckt_g6": {"i": "left"}},
        {"spare_buffer_8": {"i": "n1"}},
        {"spare_buffer_8": {"i": "right"}},
        {"subckt_g0": {"i1": "a"}},
    ],
    ids=["a flop at another clock", "data at the clock", "a buffer at data", "a buffer at itself", "another wire"],
)
def test_a_netlist_with_another_change_is_found(changed: dict[str, dict[str, str]], tmp_path: Path) -> None:
    assert tree_of(TOY, placed_of(**changed)) is None
    said = {"routed": True, "width_um": 1.0, "height_um": 2.0, "cells": placed_of(**changed).cells}
    (tmp_path / "placed.json").write_text(json.dumps(said))
    found = layout_of(tmp_path, tmp_path).judge(0.1, tmp_path)
    assert found.problem == "the netlist without the clock tree is another"


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
    parts = "# Resistors\nextract\n\n# Diodes\nextract diodes\n\n# Transistors\nextract"
    deck = checks.comparing(f"flat\n\n{parts}\n\nnetlist\n\nalign\nok = compare\n")
    assert "diodes" not in deck
    assert "# Transistors" in deck
    assert deck.index("connect(m1, names(68))") < deck.index("extract") < deck.index("same_nets!")
    with pytest.raises(Crashed, match="has another form"):
        checks.comparing("flat\nalign\n")


CLEAN = Rules(194, ())
TREE = ClockTree(5, (2, 2), 22)
CALM = Electrical(0.5, ("m3 antenna of 455 at (3.39, 85.49)",), {"m1": 0.16, "m2": 0.1}, 775, 460.0, ())


def made_of(*tries: Try, comparison: Comparison | None = None, proved: int = 5) -> Report:
    return Report("toy", ReadoutConfig(), TOY, 100.0, proved, 5, tries, comparison, {})


def test_the_closing_line_and_the_problems() -> None:
    equal = Comparison(True, 47, 82, 8)
    good = made_of(Try(0.3, "a segment is open"), Try(0.35, "", 18.2, 18.2, CLEAN), comparison=equal)
    assert good.closing_line() == "layout: toy, 8 cells, 18 x 18 um, 0 violations, netlist equal"
    assert not good.problems
    assert made_of(Try(0.3, "", 18.2, 18.2, CLEAN)).closing_line().endswith("0 violations, netlist not compared")
    whole = made_of(Try(0.3, "", 18.2, 18.2, CLEAN, TREE, CALM))
    assert whole.closing_line() == (
        "layout: toy, 8 cells, 18 x 18 um, 0 violations, 5 clock buffers, antennas at most 50 % of the limit, "
        "diodes needed outside at 1 input, metals at most 16 % dense, wires at most 460 ohm, netlist not compared"
    )
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
    equal = Comparison(True, 47, 82, 8)
    said = made_of(Try(0.3, "", 20.0, 10.0, CLEAN, TREE, CALM), comparison=equal).to_dict("make layout")
    assert said["clock_tree"] == {"buffers": 5, "levels": (2, 2), "most_pins": 22}
    assert said["electrical"]["largest_ohm"] == 460.0
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


@pytest.mark.parametrize("workers", [1, 3])
def test_margins_are_tried_until_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: int) -> None:
    """Check five attempts: a crash, an open segment, a rule violation, an antenna, and one without a problem."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "drc.drc").touch()

    def place(program: str, *words: str, folder: Path) -> None:
        if program == "electrical":
            broken = ("m2 antenna of 500, at most 400, at (1, 2)",) if "0.40" in words[0] else ()
            said = vars(dataclasses.replace(CALM, violations=broken))
            (folder / "electrical.json").write_text(json.dumps(said))
            return
        assert (folder / "toy.blif").read_text() == TOY.blif()
        if words[-1] == "0.1":
            raise Crashed("place ended with code -11: no word")
        said = {"routed": words[-1] != "0.2", "width_um": 1.0, "height_um": 2.0, "cells": placed_of().cells}
        (folder / "placed.json").write_text(json.dumps(said))

    def rules(gds: Path, top: str, deck: Path, folder: Path) -> None:
        item = "<item><category>a</category></item>" if "0.30" in str(gds) else ""
        text = f"<r><categories><category/></categories><items>{item}</items></r>"
        (folder / "rules.lyrdb").write_text(text)

    monkeypatch.setattr(environment, "run", place)
    monkeypatch.setattr(checks, "rules", rules)
    with Local(workers, threads=True) as pool:
        tries, placed = layout_of(tmp_path / "work", library).route(pool, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    assert [one.problem for one in tries] == [
        "place ended with code -11: no word",
        "a segment is open",
        "1 violations, a at nowhere",
        "1 violations, m2 antenna of 500, at most 400, at (1, 2)",
        "",
    ]
    assert tries[-1].tree == ClockTree(3, (2, 2), 2)
    assert placed
    assert placed.name.startswith("place-0.50-")
    tries, placed = layout_of(tmp_path / "work", library).route(Local(1), (0.1, 0.2))
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
MARGIN = 3.0
"""Free area that is enough for the spare buffers."""


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> tuple[run.Layout, Path]:
    """Return a placed and routed layout of eight cells, and its folder."""
    folder = tmp_path_factory.mktemp("toy")
    library = run._cells(Stages(folder, lambda stage: None))
    layout = layout_of(folder, library, circuit.read_spice((library / "cells.spi").read_text()))
    return layout, layout.place(MARGIN)


@NEEDS_TOOLS
def test_a_small_layout_is_clean_and_equal(toy: tuple[run.Layout, Path]) -> None:
    layout, placed = toy
    found = layout.judge(MARGIN, placed)
    assert found.problem == ""
    assert found.tree == ClockTree(1, (1, 1), 2)
    assert found.electrical
    assert found.electrical.nets == 7
    assert 0 < found.electrical.largest_ohm < 1000
    assert 0 < found.electrical.density["m1"] < 0.5
    assert found.rules
    assert found.rules.checked > 150
    compared = layout.compare(placed)
    assert compared.equal
    assert compared.ports == 7  # of eight: one is read by nothing
    kinds = ["buf_x4", *(kind for kind, _ in TOY.cells.values())]
    assert compared.transistors == sum(layout.known[kind].text.count("\nM") for kind in kinds)


@NEEDS_TOOLS
@pytest.mark.parametrize("pairs", [{"n5": "n2"}, {"a": "b", "b": "a"}], ids=["a wire moved", "two ports exchanged"])
def test_a_broken_connection_is_found(toy: tuple[run.Layout, Path], tmp_path: Path, pairs: dict[str, str]) -> None:
    layout, placed = toy
    said = json.loads((placed / "placed.json").read_text())
    for kind, pins in said["cells"].values():
        if kind in ("nand2_x0", "xor2_x0", "nor2_x0", "dff_x1"):
            pins |= {pin: pairs.get(wire, wire) for pin, wire in pins.items()}
    (tmp_path / "placed.json").write_text(json.dumps(said))
    (tmp_path / f"{layout.top}.gds").symlink_to(placed / f"{layout.top}.gds")
    compared = layout_of(tmp_path / "work", layout.library, layout.known).compare(tmp_path)
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
    found = layout_of(tmp_path / "work", layout.library, layout.known).judge(MARGIN, tmp_path)
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
    tries, placed = layout_of(tmp_path, layout.library, layout.known).route(Local(1), (MARGIN,))
    assert tries[-1].problem == "a segment is open"
    assert placed is None


DRAW = (
    "import json, sys, klayout.db as db; y = db.Layout(); t = y.create_cell('top')\n"
    "for layer, datatype, *box in json.loads(sys.argv[1]): t.shapes(y.layer(layer, datatype)).insert(db.DBox(*box))\n"
    "y.write('drawn.gds')"
)
DRAIN = [(65, 20, 0, 0, 1, 1), (66, 44, 0.4, 0.4, 0.57, 0.57)]
GATE = [(65, 20, 48, 0, 50, 1), (66, 20, 49, -1, 49.5, 2), (66, 44, 49.1, 1.5, 49.27, 1.67)]
"""Drain and gate, with a contact each: GDS layer, data type, and corners in um."""
WIRE = [(67, 20, 0.4, 0.4, 49.4, 2)]
THIN = [(67, 20, 0.4, 0.46, 49.2, 0.51), (67, 20, 49.1, 0.4, 49.4, 2)]
WIDE = [(68, 20, 0, -1, 50, 1.2)]
ANTENNA = [(67, 20, 49, 1.4, 49.4, 1.8), (67, 44, 49.1, 1.5, 49.27, 1.67), (68, 20, 49, 1.4, 349, 1.8)]
BACK = [
    *((68, 44, 348.5, 1.5, 348.65, 1.65), (69, 20, 0.3, 1.4, 349, 1.8), (68, 44, 0.4, 1.5, 0.55, 1.65)),
    *((68, 20, 0.3, 0.3, 0.7, 1.8), (67, 44, 0.4, 0.4, 0.57, 0.57), (67, 20, 0.3, 0.3, 0.7, 0.7)),
]
"""Two wires in local interconnect; a plate; a long wire at the gate in metal 1, and its way to the drain in metal 2."""


@NEEDS_TOOLS
@pytest.mark.parametrize(
    ("shapes", "violations", "inputs"),
    [
        ([*DRAIN, *GATE, *WIRE], [], 0),
        ([*DRAIN, *GATE, *THIN], ["wire of 11907 ohm, at most 5000, to (49.19, 1.58)"], 0),
        ([*DRAIN, *GATE, *WIRE, *WIDE], ["m1 density of 73 %, at most 70 %, at (0, -1)"], 0),
        ([*DRAIN, *GATE, *ANTENNA, *BACK], ["m1 antenna of 421, at most 400, at (49.00, 1.40)"], 0),
        ([*GATE, *ANTENNA], [], 1),
    ],
    ids=["a good wire", "a thin wire", "a plate of metal", "an antenna", "an input with an antenna"],
)
def test_planted_faults_are_found(
    shapes: list[tuple[float, ...]], violations: list[str], inputs: int, tmp_path: Path
) -> None:
    words = [str(environment.python()), "-I", "-c", DRAW, json.dumps(shapes)]
    subprocess.run(words, check=True, cwd=tmp_path)
    environment.run("electrical", "drawn.gds", "top", folder=tmp_path)
    found = checks.read_electrical(tmp_path / "electrical.json")
    assert list(found.violations) == violations
    assert len(found.inputs) == inputs
    assert found.nets == (0 if inputs else 1)
