"""Test the delivered Verilog in CXXRTL and in slang."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.text.slang import ports_of
from eskin.rtl.verilog import verilog
from eskin.verify.crosscheck import cxxrtl
from eskin.verify.crosscheck.check import Mismatch, play, problems, texts

FEW = ReadoutConfig(rows=2, columns=2, window_period=3)
DELIVERED = [
    FEW,
    FEW.replace(encoding="cw-lcs", link="four_phase"),
    FEW.replace(rows=3, columns=5, encoding="nlcs", frontend="analog"),
    FEW.replace(rows=1, columns=1, frontend="analog", link="four_phase"),
    FEW.replace(registers="spi", encoding="nlcs"),
    FrameConfig(readout=FEW),
]


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
    with pytest.raises(InputError, match="slang is not installed; install with: pip install"):
        problems({"a.v": "module a; endmodule"}, "a")


def test_a_module_in_a_comment_is_no_module() -> None:
    with pytest.raises(InputError, match="contains no module eskin_readout \\(its modules: other\\)"):
        ports_of("// module eskin_readout\n/* module eskin_readout */ module other; endmodule", "eskin_readout")
    assert ports_of("module other; endmodul\nmodule eskin_readout; endmodule", "eskin_readout") == {}
