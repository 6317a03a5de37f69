"""Test the Verilog of the frame readout: lint, resets, stability, and the files beside it."""

import re
from pathlib import Path

import pytest

from eskin.cocotb_tests.test_frame import frame_config, name
from eskin.cocotb_tests.test_verilog import delivered, written_in_two_processes
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.delivery import ports
from eskin.rtl.verilog import verilog

TOP = "eskin_frame_readout"


CONFIGS = [
    frame_config(1, 4, 6, word_bits=6),
    frame_config(3, 5, 10, "async"),
    frame_config(64, 64, 10, word_bits=64),
]


@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_files_are_clean_complete_and_agree(config: FrameConfig, tmp_path: Path) -> None:
    text, constraints, described = delivered(config, tmp_path)
    blocks = re.findall(r"always @\(([^)]*)\)\s+if \(rst(?: \| [^\n]*)?\) (\w+) <= \d+'[hs]*[0-9a-f]+;", text)
    assert len(blocks) == len(re.findall(r"^  (?:output )?reg ", text, re.MULTILINE)) == text.count("always") > 10
    edges = {"posedge clk"} if config.reset == "sync" else {"posedge clk, posedge rst"}
    assert {edge for edge, *_ in blocks} == edges
    assert FrameConfig.from_dict(described["configuration"]).to_dict() == config.to_dict()
    assert described["clock_hz"] == config.clock_hz
    assert "taxel_enable" not in constraints
    assert "Frame-based" in (tmp_path / f"{TOP}.core").read_text()


def test_ports_are_those_of_the_contract() -> None:
    widths = {p["name"]: p["width"] for p in ports(frame_config(3, 5, 10))}
    scan = {"frame_start": 1, "row_select": 3, "column_select": 5}
    converter = {"adc_start": 1, "adc_done": 1, "adc_code": 10}
    words = {"word_valid": 1, "word_ready": 1, "word_data": 16, "word_sync": 1}
    assert widths == {"clk": 1, "rst": 1} | scan | converter | words | {"frame_overrun": 1}


@pytest.mark.command("verilog")
def test_command_writes_the_text_of_the_library(tmp_path: Path) -> None:
    out = written_in_two_processes(tmp_path, "--readout", "frame", "--rows", "2", "--word-bits", "12")
    suffixes = (".v", ".sdc", ".json", ".core", "_datasheet.md", "_start.svg", "_word.svg")
    assert {f"{TOP}{suffix}" for suffix in suffixes} <= {path.name for path in out.iterdir()}
    assert (out / f"{TOP}.v").read_text() == verilog(FrameConfig(readout=ReadoutConfig(rows=2), word_bits=12))
