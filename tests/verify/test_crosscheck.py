"""Test that a second solver, a third simulator and a second front end agree, and that a difference is a failure."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.text.slang import ports_of
from eskin.rtl.verilog import verilog
from eskin.verify.crosscheck import cxxrtl, prove, sby
from eskin.verify.crosscheck.check import Mismatch, play, problems, texts
from eskin.verify.proofs.plan import proofs

FEW = ReadoutConfig(rows=2, columns=2, window_period=3)
DELIVERED = [
    FEW,
    FEW.replace(encoding="cw-lcs", link="four_phase"),
    FEW.replace(rows=3, columns=5, encoding="nlcs", frontend="analog"),
    FEW.replace(rows=1, columns=1, frontend="analog", link="four_phase"),
    FEW.replace(registers="spi", encoding="nlcs"),
    FrameConfig(readout=FEW),
]
LINK = next(proof for proof in proofs() if proof.block == "link" and proof.small)


@pytest.fixture(autouse=True)
def quickly_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile without optimisation, because runs are short."""
    monkeypatch.setattr(cxxrtl, "OPTIMISE", "-O0")


def test_the_third_simulator_plays_a_texture_as_the_model(call: Any, folder: Path) -> None:
    # Compiling what CXXRTL makes takes some seconds: the smallest array with rows and columns.
    array = "--rows 2 --columns 2 --encoding cw-lcs --window-period 3 --ticks 400"
    code, out, error = call("dev crosscheck", array, "--out found.json")
    assert code == 0, error
    kept = json.loads((folder / "found.json").read_text())
    assert kept["runs"] > 8
    assert 100 < kept["of_texture"] < kept["events"]
    assert out.splitlines()[-1].endswith(f"{kept['of_texture']} of a texture; slang: 0 problems")


def test_the_third_simulator_finds_a_bug() -> None:
    config = ReadoutConfig(rows=1, columns=2)
    text, right, wrong = verilog(config), "assign rest = waiting & ~first;", "assign rest = waiting & first;"
    assert right in text
    with pytest.raises(Mismatch, match="event 1 differs in column: model clock 4, row 0, column 1, ON; CXXRTL clock 4"):
        play(config, ticks=100, text=text.replace(right, wrong))


@pytest.mark.parametrize("config", DELIVERED, ids=lambda config: getattr(config, "encoding", "frame"))
def test_slang_takes_what_is_delivered(config: ReadoutConfig | FrameConfig) -> None:
    assert texts(config) == {"verilog": [], "properties": []}


def test_slang_would_find_what_others_let_pass() -> None:
    late = "module late(input wire a, output wire y); assign y = b; wire b; assign b = a; endmodule"
    (said,) = problems({"late.v": late}, "late")
    assert said == "late.v:1:54: error: identifier 'b' used before its declaration"
    assert problems({"late.v": late}, "later")[-1] == "no module later"


def test_what_cannot_be_played_and_what_is_missing_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="CXXRTL needs a digital front end, the stream link, and no registers"):
        play(FEW.replace(link="four_phase"))
    monkeypatch.setitem(sys.modules, "pyslang", None)
    with pytest.raises(
        InputError, match="this needs pyslang, which is not installed; in the checkout: make setup FOR=lint"
    ):
        problems({"a.v": "module a; endmodule"}, "a")


def test_a_module_in_a_comment_is_no_module() -> None:
    with pytest.raises(InputError, match="contains no module eskin_readout \\(its modules: other\\)"):
        ports_of("// module eskin_readout\n/* module eskin_readout */ module other; endmodule", "eskin_readout")
    assert ports_of("module other; endmodul\nmodule eskin_readout; endmodule", "eskin_readout") == {}


def test_both_find_the_same_first_clocks_of_a_block_and_of_mutants(
    call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prove, "MUTANTS", 1)
    code, out, error = call("dev crossproof --block relay --small --mutants --out found.json")
    assert code == 0, error
    kept = json.loads((folder / "found.json").read_text())
    line = (
        "crossproof: 7 properties of 1 designs, 1 generated mutants, 1 of them killed; "
        "z3 finds the first clocks that ABC finds, 0 problems"
    )
    assert out.splitlines()[-1] == kept["result"] == line
    whole, changed = kept["designs"]
    assert (whole["mutant"], whole["failed"]) == ("", {})
    assert changed["mutant"].startswith("-mode ")
    assert changed["failed"]


def test_a_difference_is_a_problem(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(checker: Any, depth: int, rtlil: str = "") -> Any:
        return replace(prove.solve(checker, depth, 0), failed={"one_at_a_time": 3}, reached={})

    monkeypatch.setattr(prove, "search", wrong)
    code, out, _ = call("dev crossproof --block link --small")
    assert code == 1
    assert "PROBLEM: one_at_a_time fails in clock None by ABC, 3 by z3" in out
    assert "PROBLEM: address_stable is seen in clock 1 by ABC, None by z3" in out


def test_an_answer_that_is_missing_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sby, "_ask", lambda text, job: "reached cover statement bench.bad_one_at_a_time_0 at  step 3")
    with pytest.raises(sby.SolverFailed, match="1 answers to 18 questions about eskin_link_properties"):
        sby.search(LINK.checker(LINK.config), LINK.depth)


def test_without_the_solver_there_is_one_sentence(refuses: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sby, "find_spec", lambda name: None)
    refuses(
        "this needs z3-solver, which is not installed; in the checkout: make setup FOR=proof",
        "dev crossproof --block link --small",
    )
