"""Test the Verilog of the frame readout: lint, resets, stability, and the files beside it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from eskin.cocotb_tests.test_verilog import lint
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.delivery import ports, write
from eskin.rtl.verilog import verilog

TOP = "eskin_frame_readout"


def frame_config(rows: int, columns: int, resolution: int, reset: str, word_bits: int) -> FrameConfig:
    """Return a frame readout configuration."""
    shared = {"rows": rows, "columns": columns, "resolution": resolution, "reset": reset}
    return FrameConfig.from_dict(shared | {"word_bits": word_bits})


CONFIGS = [
    frame_config(1, 4, 6, "sync", 6),
    frame_config(3, 5, 10, "async", 16),
    frame_config(64, 64, 10, "sync", 64),
]


def name(config: FrameConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{config.resolution}b-{config.word_bits}b-{config.reset}"


@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_files_are_clean_complete_and_agree(config: FrameConfig, tmp_path: Path) -> None:
    write(config, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{TOP}.{s}" for s in ("core", "json", "sdc", "v")]
    assert lint(tmp_path / f"{TOP}.v") == ""

    text = (tmp_path / f"{TOP}.v").read_text()
    blocks = re.findall(r"always @\(([^)]*)\)\s+if \(rst(?: \| [^\n]*)?\) (\w+) <= \d+'[hs]*[0-9a-f]+;", text)
    assert len(blocks) == len(re.findall(r"^  (?:output )?reg ", text, re.MULTILINE)) == text.count("always") > 10
    edges = {"posedge clk"} if config.reset == "sync" else {"posedge clk, posedge rst"}
    assert {edge for edge, *_ in blocks} == edges
    assert "initial" not in text
    assert not re.search(r"'[bh][0-9a-f]*x", text)

    described = json.loads((tmp_path / f"{TOP}.json").read_text())
    assert described["top"] == TOP
    assert FrameConfig.from_dict(described["configuration"]).to_dict() == config.to_dict()
    assert described["clock_hz"] == config.clock_hz
    top = text[text.index(f"module {TOP}(") :]
    found = re.findall(
        r"^  (input|output) (?:wire|reg) (?:\[(\d+):0\] )?(\w+);", top[: top.index("endmodule")], re.MULTILINE
    )
    listed = {p["name"]: (p["direction"], p["width"]) for p in described["ports"]}
    assert {n: (way, int(high or 0) + 1) for way, high, n in found} == listed
    constraints = (tmp_path / f"{TOP}.sdc").read_text()
    assert all(port in constraints for port in listed if port != "rst")
    assert "taxel_enable" not in constraints
    assert "Frame-based" in (tmp_path / f"{TOP}.core").read_text()


def test_ports_are_those_of_the_contract() -> None:
    widths = {p["name"]: p["width"] for p in ports(frame_config(3, 5, 10, "sync", 16))}
    scan = {"frame_start": 1, "row_select": 3, "column_select": 5}
    converter = {"adc_start": 1, "adc_done": 1, "adc_code": 10}
    words = {"word_valid": 1, "word_ready": 1, "word_data": 16, "word_sync": 1}
    assert widths == {"clk": 1, "rst": 1} | scan | converter | words | {"frame_overrun": 1}


def test_command_writes_the_text_of_the_library(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "eskin", "verilog", "--readout", "frame", "--rows", "2", "--word-bits", "12"]
    for seed in ("1", "2"):
        subprocess.run(
            [*command, "-o", str(tmp_path / seed)], check=True, capture_output=True, env={"PYTHONHASHSEED": seed}
        )
    for suffix in (".v", ".sdc", ".json", ".core", "_datasheet.md", "_start.svg", "_word.svg"):
        first, second = ((tmp_path / seed / f"{TOP}{suffix}").read_bytes() for seed in ("1", "2"))
        assert first == second
    assert (tmp_path / "1" / f"{TOP}.v").read_text() == verilog(
        FrameConfig(readout=ReadoutConfig(rows=2), word_bits=12)
    )
