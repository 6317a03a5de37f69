"""Test mutation campaigns: distinct mutants, separate processes, verdicts, and restart."""

import ast
import json
from pathlib import Path
from typing import Any

import pytest

from eskin.verify.mutants import campaign, questions
from eskin.verify.mutants.campaign import MODEL, RTL, Done, Finding, arguments, closing_line
from eskin.verify.mutants.checkout import failing, first_failed, original
from eskin.verify.mutants.configs import COUNT, configs
from eskin.verify.mutants.edits import Mutant, mutated, places, sample
from eskin.verify.mutants.judge import Asked, judge
from eskin.verify.mutants.questions import Questions, mutated_files

ROOT = Path(__file__).parents[2]
FILE = "rtl/arbiter.py"


def drawn_from(file: str, text: str, *only: str) -> list[Mutant]:
    """Return all mutants of a text, or those of the places ``only``."""
    every = (place for choices in places(file, text).values() for place in choices)
    chosen = (p for p in every if not only or f"{p.function} {p.operator} {p.number}" in only)
    return [mutant for mutant in (mutated(file, text, place) for place in chosen) if mutant]


def test_every_edit_is_another_program() -> None:
    for file in ("rtl/decay.py", "model/window.py"):
        text = (ROOT / file).read_text()
        found = drawn_from(file, text)
        assert len({mutant.name for mutant in found}) == len(found) > 20
        for mutant in found:
            assert ast.dump(ast.parse(mutant.text)) != ast.dump(ast.parse(text)), mutant.name
        some, count = sample(file, text, 0.3, 3, seed=1)
        assert len(some) == max(round(0.3 * count), 3)
        assert some == sample(file, text, 0.3, 3, seed=1)[0] != sample(file, text, 0.3, 3, seed=2)[0]


def test_hardware_is_edited_as_hardware() -> None:
    text = """class A:
    def elaborate(self, m):
        m.d.comb += [a.eq(1), b.eq(Mux(c, d, e))]
        with m.If(c & d):
            m.d.sync += a.eq(c.any())
        n.d.comb += a
"""
    own = ("DropAssignment", "StickCondition", "SwapChoice", "SwapReduction")
    found = [mutant for mutant in drawn_from("rtl/a.py", text) if mutant.operator in own]
    assert sorted(mutant.edit.partition(" -> ")[2] for mutant in found) == [
        "m.d.comb += [*[], b.eq(Mux(c, d, e))]",
        "m.d.comb += [a.eq(1), *[]]",
        "m.d.comb += [a.eq(1), b.eq(Mux(c, e, d))]",
        "m.d.sync += []",
        "m.d.sync += a.eq(c.all())",
        "with m.If((c & d) == 0):",
        "with m.If(0):",
        "with m.If(1):",
    ]
    assert {mutant.function for mutant in found} == {"A.elaborate"}
    assert not [mutant for mutant in drawn_from("model/a.py", text) if mutant.operator in own]


def test_annotations_and_decorators_are_not_edited() -> None:
    text = "@njit(cache=True)\ndef f(x: 1 + 1, y: int = 1) -> 1 + 1:\n    z: 1 + 1 = 2\n    return z\n"
    assert {mutant.line for mutant in drawn_from("model/a.py", text)} == {2, 3}
    assert all("1 + 1" in mutant.edit.partition(" -> ")[2] for mutant in drawn_from("model/a.py", text))


def test_a_name_says_the_construct_and_not_its_text() -> None:
    text = "def f(x):\n    return x + 1\n\n\ndef g(x):\n    return x + 2\n"
    names = {mutant.name for mutant in drawn_from("model/a.py", text)}
    assert "model/a.py g ReplaceBinaryOperator_Add_Sub 0" in names
    moved = "Y = 3 + 4\n" + text.replace("x + 1", "x + 1 + x").replace("x + 2", "y + 7")
    assert {name for name in names if " g " in name} == {
        mutant.name for mutant in drawn_from("model/a.py", moved) if mutant.function == "g"
    }


def test_questions_follow_from_names_and_imports(tmp_path: Path) -> None:
    for name, text in {
        "model/pulse.py": "",
        "model/inner.py": "",
        "model/room/user.py": "from eskin.model.inner import x",
        "tests/model/test_pulse.py": "",
        "tests/model/test_room.py": "",
        "tests/other/test_pulse.py": "",
        "tests/other/test_more.py": "from eskin.model import pulse",
        "cocotb_tests/test_pulse.py": "",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert questions.questions("model/pulse.py", tmp_path).tests == (
        "cocotb_tests/test_pulse.py",
        "tests/model/test_pulse.py",
        "tests/other/test_more.py",
    )
    assert questions.questions("model/inner.py", tmp_path).tests == ("tests/model/test_room.py",)


def test_every_mutated_file_has_tests_and_blocks_of_the_rtl_have_their_proofs() -> None:
    for packages in (RTL, MODEL):
        files = mutated_files(packages)
        assert len(files) > 20
        assert [file for file in files if not questions.questions(file).tests] == []
    assert questions.questions("app/commands/learn/train.py").tests[-1] == questions.COMMANDS
    assert questions.questions("rtl/frame.py").proofs == ("frame_readout",)
    assert questions.questions("rtl/registers/spi.py").proofs == ("spi", "registers")
    assert "taxel" in questions.questions("rtl/encoders/lcs.py").proofs


def test_every_argument_speaks_of_a_mutant() -> None:
    by_file: dict[str, set[str]] = {}
    for name, why in arguments().items():
        assert len(why) > 40
        by_file.setdefault(name.partition(" ")[0], set()).add(name)
    for file, names in by_file.items():
        every = places(file, (ROOT / file).read_text()).values()
        known = {f"{file} {p.function or 'module'} {p.operator} {p.number}" for found in every for p in found}
        assert names <= known


def test_tests_run_to_the_first_failure_and_within_their_time(tmp_path: Path) -> None:
    original, mutant = tmp_path / "original", tmp_path / "mutant"
    for place, worse in ((original, "pass"), (mutant, "assert 0")):
        place.mkdir()
        (place / "test_it.py").write_text(
            "import pytest\ndef test_good(): pass\ndef test_bad(): assert 0\n"
            f"@pytest.mark.parametrize('x', ['a [b] c', 'd'])\ndef test_worse(x): {worse}\n"
        )
        (place / "test_hangs.py").write_text("def test_hangs():\n    while True: pass\n")
        (place / "test_broken.py").write_text("import nothing_that_is_there\n" * (place == mutant))

    def first(*tests: str, limit_s: float = 60) -> str:
        return first_failed(mutant, tests, original, quick=False, limit_s=limit_s)

    assert first("test_it.py") == "test_it.py::test_worse[a [b] c]"
    assert failing(original) == ["test_it.py::test_bad"]  # it fails without the mutant too, and says nothing of it
    assert first("test_broken.py") == "test_broken.py"
    assert first("test_hangs.py", limit_s=1) == "test_hangs.py (no end within 1 s)"
    assert first() == ""


def test_a_mutant_is_compared_in_many_configurations() -> None:
    for file in mutated_files(RTL):
        found = configs(file, 1)
        assert len(set(map(repr, found))) == len(found) == COUNT
        assert found == configs(file, 1) != configs(file, 2)


def test_what_tests_do_not_kill_is_equivalent_or_alive_and_the_generator_may_refuse(tmp_path: Path) -> None:
    # A mask of more bits than rows has bits that nothing reads; a row that waits for every bit is no row at all.
    checkout = original(tmp_path)
    assert (checkout / "build").readlink() == tmp_path / "build"  # programs never lie among the sources
    asked = Asked(checkout, Questions(()), 1, designs=2)
    operators = ("ReplaceBinaryOperator_Sub_Add 0", "SwapReduction 4", "ReplaceUnaryOperator_Invert_Not 3")
    names = [f"Arbiter.elaborate {operator}" for operator in operators]
    mutants = {one.name: one for one in drawn_from(FILE, (ROOT / FILE).read_text(), *names)}
    same, other, refused = (mutants[f"{FILE} {name}"] for name in names)
    assert judge(same, asked) == {"verdict": "equivalent"}
    found = judge(other, asked)
    assert found["verdict"] == "left"
    assert found["differs"].startswith("eskin_arbiter differs in ")
    assert judge(refused, asked) == {"verdict": "stillborn"}


def test_a_campaign_judges_keeps_and_goes_on(call: Any, folder: Path) -> None:
    line = "dev mutants --block window --limit 1 --workers 1 -o out"
    code, out, error = call(line)
    lines = out.splitlines()
    assert code == 0, error
    assert [line.split()[0] for line in lines[:-1]] == ["killed"]
    assert all(" by cocotb_tests/test_window.py::test_" in line for line in lines[:-1])
    kept = json.loads((folder / "out" / "mutants.json").read_text())["rtl"]
    assert (kept["total"], kept["killed"], kept["survivors"], kept["result"]) == (1, 1, [], lines[-1])
    log = folder / "out" / ".mutants.json.pieces"
    assert call(line)[1].splitlines() == lines[-1:]
    log.write_text(log.read_text().rstrip()[:-20])  # as one that was stopped while it wrote
    assert call(line)[1].splitlines() == lines


def test_the_closing_line_counts_what_is_alive_and_what_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    verdicts = ["killed", "killed", "killed", "alive", "equivalent", "stillborn", "argued"]
    mutant = Mutant("rtl/link.py", "", "AddNot", 0, 1, "", "")
    found = Done(9, {}, [Finding(mutant, verdict, quick=n < 2) for n, verdict in enumerate(verdicts)], {"one test"})
    assert closing_line(found) == (
        "mutants: 6, 1 proved equivalent, 1 argued; of the others 3 killed (75.0 %, 95 % interval 30.1 to 95.4 %), by "
        "the quick check alone 50.0 %; 1 alive, 2 not yet judged; 1 tests fail without a mutant and are not asked"
    )
    monkeypatch.setattr("eskin.verify.mutants.campaign.arguments", lambda: {mutant.name: "because"})
    assert campaign._finding(mutant, {"verdict": "alive"}).verdict == "argued"
    assert campaign._finding(mutant, {"verdict": "killed"}).verdict == "killed"
