"""Test the delivered Verilog: lint, style, stability, and the files beside it."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.cocotb_tests.runner.cocotb_runners import build_environment
from eskin.cocotb_tests.runner.simulator import require_programs
from eskin.cocotb_tests.test_host import CONFIGS as HOSTS
from eskin.cocotb_tests.test_readout import breadth, name
from eskin.model.cases import CHOICES, axes, cases, pairs
from eskin.model.config import ReadoutConfig
from eskin.model.registers.export import c_header, ip_xact, page, system_rdl
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import constraints, core, description, ports, write
from eskin.rtl.gates.clock_gates import BEHAVIOUR, GATE
from eskin.rtl.testbench import has_testbench
from eskin.rtl.text.fold import LONGEST
from eskin.rtl.verilog import Config, top_block, verilog
from tests.conftest import run_eskin as call

ENCODINGS = CHOICES["encoding"]
ASYNCHRONOUS = ("aer_ack", "spi_sck", "spi_cs_n", "spi_mosi")


def with_registers() -> list[ReadoutConfig]:
    """Return the configurations of the host tests, one with two request lines, and two with the narrowest registers."""
    base = ReadoutConfig(rows=3, columns=5, registers="spi", leak_period=9)
    ends = {"sample_bits": 3, "resolution": 1, "closing_shift": 0, "window_period": 1, "leak_shift": 1}
    return [
        *HOSTS,
        base.replace(frontend="analog", link="four_phase_dual", reset="async"),
        *(base.replace(encoding=encoding, fraction_bits=0, **ends) for encoding in ("cw-lcs", "nlcs-bipolar")),
    ]


WIDTHS = tuple({"sample_bits": bits, "resolution": resolution} for bits, resolution in ((3, 1), (12, 10), (24, 1)))
LIMITS = (
    {"window_period": 1, "leak_period": 1, "leak_shift": 16, "fraction_bits": 0},
    {"closing_shift": 0, "leak_period": 2**20, "leak_shift": 1},
    {"closing_shift": 16, "window_period": 2**16},
)


def extremes() -> list[ReadoutConfig]:
    """Return configurations with every encoder at the limits of its fields."""
    base = ReadoutConfig(rows=2, columns=3, fraction_bits=7)
    # Decay ticks: all rows in one phase, several rows in each, and a phase for every row.
    phases = [
        {"rows": rows, "columns": columns, "leak_period": period}
        for rows, columns, period in ((64, 1, 1), (5, 1, 2), (3, 5, 3))
    ]
    return [
        *pairs(base, **axes("encoding", "frontend", "decide_every"), widths=WIDTHS, limits=LIMITS),
        *cases(encoding=["nlcs"], phases=phases),
    ]


def lint(path: Path, *more: Path) -> str:
    """Return all messages of both linters on a file, and on the files of the modules that it uses."""
    require_programs("icarus")
    top, files = path.stem, [str(path), *map(str, more)]
    said = ""
    with build_environment():
        for command in (
            ["verilator_bin", "--lint-only", "-Wall", "--top-module", top, *files],
            ["iverilog", "-g2005", "-Wall", "-t", "null", "-s", top, *files],
        ):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            said += done.stderr + (f"exit code {done.returncode}" if done.returncode else "")
    return said


def declared(text: str, top: str) -> dict[str, tuple[str, int]]:
    """Return direction and width of the ports that a module declares."""
    module = text[text.index(f"module {top}(") :]
    module = module[: module.index("endmodule")]
    found = re.findall(r"^  (input|output) (?:wire|reg) (?:signed )?(?:\[(\d+):0\] )?(\w+),?$", module, re.MULTILINE)
    return {port: (way, int(high or 0) + 1) for way, high, port in found}


def delivered(config: Config, folder: Path) -> tuple[str, str, dict[str, Any]]:
    """Write and check the files of a design; return Verilog, constraints and description."""
    top = top_block(config).module_name
    written = write(config, folder)
    ends = [".v", ".sdc", ".json", ".core", *(["_tb.sv"] if has_testbench(config) else [])]
    assert written == [folder / f"{top}{end}" for end in ends]
    assert set(folder.iterdir()) == set(written)
    assert lint(written[0]) == ""
    text, constraints, described = (path.read_text() for path in written[:3])
    assert "initial" not in text
    assert not re.search(r"'[bh][0-9a-f]*x", text)
    said = json.loads(described)
    assert said["top"] == top
    assert said["configuration"] == config.to_dict()
    assert declared(text, top) == {port["name"]: (port["direction"], port["width"]) for port in said["ports"]}
    assert all(port["name"] in constraints for port in said["ports"] if port["name"] != "rst")
    return text, constraints, said


def written_in_two_processes(folder: Path, *options: str) -> Path:
    """Run the command twice with other hashes; check that it writes equal files; return a folder of them."""
    command = [sys.executable, "-m", "eskin", "verilog", *options, "-o"]
    first, second = (folder / seed for seed in ("1", "2"))
    for out in (first, second):
        subprocess.run([*command, str(out)], check=True, capture_output=True, env={"PYTHONHASHSEED": out.name})
    assert {path.name: path.read_bytes() for path in first.iterdir()} == {
        path.name: path.read_bytes() for path in second.iterdir()
    }
    return first


@pytest.mark.representative(block="verilog")
@pytest.mark.parametrize("config", [*breadth(), *with_registers(), *extremes()], ids=name)
def test_lint_is_clean(config: ReadoutConfig, tmp_path: Path) -> None:
    path = tmp_path / "eskin_readout.v"
    path.write_text(verilog_text(config))
    assert lint(path) == ""
    assert max(map(len, path.read_text().splitlines())) <= LONGEST


GATED = ReadoutConfig(rows=2, columns=3, window_period=5, leak_period=9)


@pytest.mark.parametrize("config", pairs(GATED, **axes("encoding", "frontend", "registers", "link", "reset")), ids=name)
def test_lint_is_clean_with_clock_gates_and_registers_keep_their_names(config: ReadoutConfig, tmp_path: Path) -> None:
    text = verilog(config, gated=True)
    path, gate = tmp_path / "eskin_readout.v", tmp_path / f"{GATE}.v"
    path.write_text(text)
    gate.write_text(BEHAVIOUR)
    assert lint(path, gate) == ""
    assert not re.search(r"^  reg .*_part\w*;", text, re.MULTILINE)
    assert max(map(len, text.splitlines())) <= LONGEST


SKINS = [(1, 2, "lcs", 0), (2, 2, "cw-lcs", 2), (5, 1, "nlcs", 1)]


@pytest.mark.parametrize(("down", "across", "encoding", "relays"), SKINS)
@pytest.mark.parametrize("alone", [False, True], ids=["tiles", "merge"])
def test_a_skin_and_its_merge_are_delivered_as_the_readout_is(
    down: int, across: int, encoding: Any, relays: int, alone: bool, tmp_path: Path
) -> None:
    skin = TilesConfig.of(ReadoutConfig(rows=2, columns=1, encoding=encoding), down, across, relays)
    text, constraints, _ = delivered(MergeConfig(skin) if alone else skin, tmp_path)
    listed = declared(text, "eskin_merge" if alone else "eskin_tiles")
    assert listed["event_tile"] == ("output", skin.tile_bits)
    assert alone or listed["sample_valid"] == ("input", skin.tiles if relays else 1)
    assert not alone or listed["tile_ready"] == ("output", skin.tiles)
    assert text.count("module eskin_taxel(") == (0 if alone else 1)
    assert len(re.findall(r"^  eskin_relay relay_\d_\d \(", text, re.MULTILINE)) == (
        0 if alone else relays * skin.tiles
    )
    timed = re.findall(r"^set_\w+_delay .*\{(.*)\}\]$", constraints, re.MULTILINE)
    assert {pin.removesuffix("[*]") for pins in timed for pin in pins.split()} == {*listed} - {"clk"}


def test_lint_would_find_a_width_that_does_not_fit(tmp_path: Path) -> None:
    path = tmp_path / "eskin_readout.v"
    text = verilog_text(ReadoutConfig(rows=2, columns=2))
    path.write_text(text.replace("output wire event_valid", "output wire [1:0] event_valid", 1))
    assert "WIDTH" in lint(path)


def test_largest_array_is_one_module_per_block() -> None:
    text = verilog_text(ReadoutConfig(rows=64, columns=64, encoding="nlcs", link="four_phase"))
    modules = re.findall(r"^module (\w+)", text, re.MULTILINE)
    assert sorted(modules) == [
        "eskin_arbiter", "eskin_decay", "eskin_link", "eskin_readout", "eskin_row", "eskin_taxel",
    ]  # fmt: skip
    assert text.count("eskin_taxel taxel_") == 64
    assert text.count("eskin_row row_") == 64


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("reset", ["sync", "async"])
def test_every_register_has_a_reset_and_none_an_initial_value(encoding: str, reset: str) -> None:
    text = verilog_text(
        ReadoutConfig.from_dict({"rows": 3, "columns": 5, "encoding": encoding, "reset": reset, "link": "four_phase"})
    )
    blocks = re.findall(r"always @\(([^)]*)\)\s+if \((rst.*)\) (\w+) <= \d+'[hs]*([0-9a-f]+);", text)
    registers = re.findall(r"^  (?:\(\*.*\*\) )?(?:output )?reg ", text, re.MULTILINE)
    assert len(blocks) == len(registers) == text.count("always") > 5
    edges = {edge for edge, *_ in blocks}
    assert edges == ({"posedge clk"} if reset == "sync" else {"posedge clk, posedge rst"})
    assert "initial" not in text
    assert not re.search(r"^  (output )?reg .*=", text, re.MULTILINE)
    assert not re.search(r"'[bh][0-9a-f]*x", text)


def test_no_register_of_the_host_is_clocked_for_nothing() -> None:
    text = verilog_text(ReadoutConfig(rows=3, columns=5, registers="spi", encoding="nlcs"))
    free = set()
    for module in ("eskin_host", "eskin_registers", "eskin_pattern", "eskin_spi", "eskin_decay"):
        body = text[text.index(f"module {module}(") :]
        body = body[: body.index("endmodule")]
        free |= set(re.findall(r"^    else (\w+) <= ", body, re.MULTILINE))
    assert free == {"sck", "cs_n", "mosi"}  # the synchronisers


def test_header_and_page_go_with_registers(tmp_path: Path) -> None:
    config = ReadoutConfig(rows=3, columns=5, registers="spi")
    done = call("verilog", "--rows", 3, "--columns", 5, "--registers", "spi", "-o", tmp_path)
    *lines, load = done.stdout.splitlines()
    assert load == "the link stream sends at most 1,280,000 events/s (1 clock per event, clock 1.28e+06 Hz)"
    names = [Path(line).name for line in lines]
    assert names[-7:-3] == [f"eskin_registers.{end}" for end in ("h", "md", "rdl", "xml")]
    assert names[-3] == "eskin_readout_datasheet.md"
    header = (tmp_path / "eskin_registers.h").read_text()
    assert header.endswith(c_header(config))
    assert "//   registers = spi" in header
    assert (tmp_path / "eskin_registers.md").read_text() == page(config)
    assert (tmp_path / "eskin_registers.rdl").read_text().endswith(system_rdl(config))
    assert (tmp_path / "eskin_registers.xml").read_text() == ip_xact(config)
    stored = json.loads((tmp_path / "eskin_readout.json").read_text())["configuration"]
    assert ReadoutConfig.from_dict(stored) == config


def test_without_registers_the_text_does_not_speak_of_them() -> None:
    config = ReadoutConfig(rows=2, columns=2)
    for text in (verilog_text(config), constraints(config), description(config), core(config)):
        assert "spi_" not in text
        assert "registers =" not in text
        assert '"registers"' not in text


def test_text_is_stable_from_one_process_to_the_next(tmp_path: Path) -> None:
    config = ReadoutConfig(rows=3, columns=5, encoding="cw-lcs")
    out = written_in_two_processes(tmp_path, "--rows", "3", "--columns", "5", "--encoding", "cw-lcs")
    texts = {"v": verilog(config), "sdc": constraints(config), "json": description(config) + "\n", "core": core(config)}
    for suffix, text in texts.items():
        assert (out / f"eskin_readout.{suffix}").read_text() == text


@pytest.mark.representative(block="delivery")
@pytest.mark.parametrize("config", [*breadth(), *with_registers()], ids=name)
def test_port_list_is_that_of_the_module(config: ReadoutConfig) -> None:
    described = json.loads(description(config))
    assert described["configuration"] == config.to_dict()
    listed = declared(verilog_text(config), "eskin_readout")
    assert listed == {p["name"]: (p["direction"], p["width"]) for p in described["ports"]}
    assert list(listed)[:2] == ["clk", "rst"]
    if config.taxels == 1 and not config.has_polarity:
        assert "aer_addr" not in listed
    if config.rows == 1:
        assert "event_row" not in listed

    def pins(*names: str) -> list[str]:
        return [n + ("[*]" if listed[n][1] > 1 else "") for n in names]

    sdc = constraints(config)
    groups = re.findall(r"^(\w+) .*\[get_ports \{([^}]*)\}\]$", sdc, re.MULTILINE)
    assert len(groups) == sdc.count("get_ports")
    named: dict[str, list[str]] = {}
    for command, names in groups:
        named.setdefault(command, []).extend(names.split())
    asynchronous = [n for n in ASYNCHRONOUS if n in listed]
    order = list(listed)  # those of comparators and DACs have a line of their own
    for pinned in named.values():
        pinned.sort(key=lambda pin: order.index(pin.removesuffix("[*]")))
    assert named == {
        "create_clock": ["clk"],
        "set_input_transition": pins(*(n for n, (way, _) in listed.items() if way == "input")),
        "set_input_delay": pins(
            *(n for n, (way, _) in listed.items() if way == "input" and n not in ("clk", *ASYNCHRONOUS))
        ),
        "set_output_delay": pins(*(n for n, (way, _) in listed.items() if way == "output")),
    } | ({"set_false_path": asynchronous} if asynchronous else {})


def test_ports_are_those_of_the_contract() -> None:
    def widths(**fields: object) -> dict[str, int]:
        return {p["name"]: p["width"] for p in ports(ReadoutConfig.from_dict({"rows": 3, "columns": 5, **fields}))}

    common = {"clk": 1, "rst": 1, "taxel_enable": 15}
    stream = {"event_valid": 1, "event_ready": 1, "event_row": 2, "event_col": 3}
    assert widths() == common | {"sample": 180, "sample_valid": 1} | stream | {"event_polarity": 1}
    assert widths(encoding="nlcs") == common | {"sample": 180, "sample_valid": 1} | stream
    comparators = {"sample_valid": 1, "above": 15, "below": 15, "compare": 15, "reference_code": 180}
    aer = {"aer_req": 1, "aer_ack": 1, "aer_addr": 6}
    assert widths(frontend="analog", link="four_phase") == common | comparators | aer
    assert widths(frontend="analog", link="four_phase", encoding="nlcs") == common | {
        "sample_valid": 1, "above": 15, "compare": 15, "reference_code": 180,
        "aer_req": 1, "aer_ack": 1, "aer_addr": 5,
    }  # fmt: skip
