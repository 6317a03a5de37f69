"""Lint the delivered Verilog and the bound properties with slang, a second and stricter front end."""

import re
import sys
from collections.abc import Mapping

import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.text.slang import compilation, ports_of, top_of
from eskin.rtl.verilog import top_block, verilog
from eskin.verify.proofs.bind import properties

WAIVED = {
    "sign-conversion": "a register of a number is signed; a vector that only passes bits on is unsigned",
    "arith-op-mismatch": "likewise; another lint checks that the widths are equal",
    "width-expand": "a narrower operand is extended as Verilog defines it",
    "bitwise-op-mismatch": "likewise",
    "sign-compare": "an unsigned bit pattern that stands for a signed constant of the same width",
    "case-overlap": "each condition of a case compares one state: at most one of them holds",
    "case-too-complex": "a case that slang does not look through to the end",
    "unused-port": "a checker has a port for every port of its block",
}
"""Waived warnings, each with the reason why the code is intended."""

MESSAGE = re.compile(r"^(\S+:\d+:\d+: (?:error|warning): .*?)(?: \[-W([\w-]+)\])?$", re.MULTILINE)

FEW = ReadoutConfig(rows=2, columns=2, window_period=3)
DELIVERED = [
    FEW,
    FEW.replace(encoding="cw-lcs", link="four_phase"),
    FEW.replace(encoding="nlcs-bipolar", link="four_phase_dual"),
    FEW.replace(rows=3, columns=5, encoding="nlcs", frontend="analog"),
    FEW.replace(rows=1, columns=1, frontend="analog", link="four_phase"),
    FEW.replace(registers="spi", encoding="nlcs"),
    FrameConfig(readout=FEW),
]


def problems(texts: Mapping[str, str], top: str) -> list[str]:
    """Return slang's messages about a design, without waived ones."""
    design, sources = compilation(texts, top)
    from pyslang import DiagnosticEngine

    messages = MESSAGE.findall(DiagnosticEngine.reportAll(sources, design.getAllDiagnostics()))
    found = [message for message, flag in messages if flag not in WAIVED]
    return found if top_of(design, top) else [*found, f"no module {top}"]


@pytest.mark.parametrize("config", DELIVERED, ids=lambda config: getattr(config, "encoding", "frame"))
def test_slang_accepts_the_delivered_texts(config: ReadoutConfig | FrameConfig) -> None:
    top = top_block(config).module_name
    texts = {f"{top}.v": verilog(config)}
    assert problems(texts, top) == []
    assert problems(texts | {f"{top}_properties.sv": properties(config)}, top) == []


def test_slang_finds_what_other_front_ends_accept() -> None:
    late = "module late(input wire a, output wire y); assign y = b; wire b; assign b = a; endmodule"
    assert problems({"late.v": late}, "late") == ["late.v:1:54: error: identifier 'b' used before its declaration"]
    assert problems({"late.v": late}, "later")[-1] == "no module later"


def test_without_slang_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyslang", None)
    with pytest.raises(
        InputError, match=r"^this needs pyslang, which is not installed; in the checkout: make setup FOR=lint"
    ):
        problems({"a.v": "module a; endmodule"}, "a")


def test_a_module_in_a_comment_is_no_module() -> None:
    with pytest.raises(InputError, match="contains no module eskin_readout \\(its modules: other\\)"):
        ports_of("// module eskin_readout\n/* module eskin_readout */ module other; endmodule", "eskin_readout")
    assert ports_of("module other; endmodul\nmodule eskin_readout; endmodule", "eskin_readout") == {}
