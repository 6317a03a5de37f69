"""Test that Verilog with clock gates is equivalent to the RTL, by proof and simulation."""

import dataclasses
import json
import re
from pathlib import Path

import pytest

from eskin.cocotb_tests.test_chip import chip
from eskin.cocotb_tests.test_verilog import lint
from eskin.cocotb_tests.touch.noise import play
from eskin.flow.datasheet.page import deliver
from eskin.model.bus.config import BusConfig
from eskin.model.cases import AXES, singles, values_of
from eskin.model.config import ReadoutConfig
from eskin.rtl.delivery import description, write
from eskin.rtl.gates.clock_gates import BEHAVIOUR, GATE, TEST
from eskin.rtl.verilog import verilog
from eskin.verify.proofs.delivered import Different
from eskin.verify.proofs.gated import prove_gated
from tests.conftest import run_eskin as call

FEW = ReadoutConfig(rows=1, columns=2, sample_bits=6, resolution=2, encoding="cw-lcs", link="four_phase")


def test_every_flop_and_output_is_proved_and_a_gate_that_sleeps_too_much_is_found() -> None:
    text = verilog(FEW, gated=True)
    assert prove_gated(FEW, text) > 30
    for good, bad in (("gate_0_enable = rst | moves", "gate_0_enable = moves"), ("= awake | rst", "= rst")):
        assert good in text
        with pytest.raises(Different, match=r"^with clock gates not proved equal: "):
            prove_gated(FEW, text.replace(good, bad))
    with pytest.raises(Different, match=r"has another clock than clk$"):
        prove_gated(FEW, text.replace("gate_0 (\n    .clk(clk)", "gate_0 (\n    .clk(rst)", 1))


GATED = singles(FEW.replace(link="stream", leak_period=9, window_period=3, closing_shift=1, resolution=3), **AXES)
"""Small readouts with every value of every axis."""


BUS = BusConfig(readout=FEW.replace(link="stream", registers="spi", reset="async"), time_bits=3)


def test_behind_a_bus_readout_and_wrapper_have_clock_gates(tmp_path: Path) -> None:
    files = {path.name: path for path in write(BUS, tmp_path, gated=True)}
    texts = [files[f"{name}.v"] for name in ("eskin_axi", "eskin_readout", GATE)]
    assert lint(*texts) == ""
    assert all(f"  {GATE} gate_0 (" in path.read_text() for path in texts[:2])
    assert f"files: [eskin_axi.v, eskin_readout.v, {GATE}.v]" in files["eskin_axi.core"].read_text()
    assert prove_gated(BUS, "".join(path.read_text() for path in texts[:2])) > 300
    wrong = texts[0].read_text().replace("m_axis_tlast <= ~goes_on", "m_axis_tlast <= goes_on")
    assert wrong != texts[0].read_text()
    with pytest.raises(Different, match="not proved equal: "):
        prove_gated(BUS, wrong + texts[1].read_text())


@pytest.mark.parametrize("config", GATED, ids=lambda config: "-".join(values_of(config).values()))
def test_every_kind_of_readout_with_clock_gates_is_proved(config: ReadoutConfig) -> None:
    assert prove_gated(config) > 20


def test_every_large_enable_and_every_awake_has_a_gate_and_all_test_enables_are_a_port() -> None:
    text = verilog(FEW, gated=True)
    modules = {m[1]: m[0] for m in re.finditer(r"^module (\w+)\(.*?^endmodule$", text, re.MULTILINE | re.DOTALL)}
    for name in ("eskin_readout", "eskin_row", "eskin_arbiter"):
        assert f"{GATE} block_gate (" in modules[name]
    assert modules["eskin_taxel"].count(f"  {GATE} ") == 2
    assert modules["eskin_window"].count(f"  {GATE} ") == 1
    assert GATE not in modules["eskin_link"].replace(f"{GATE} gate_", "")
    assert text.count(".test_enable(test_enable)") >= text.count(f"  {GATE} ")
    assert "if (moves)" not in modules["eskin_taxel"]


def test_header_and_description_tell_of_the_gates() -> None:
    for gated in (False, True):
        text = verilog(FEW, gated=gated)
        assert ("//   clock_gates = True\n" in text) is gated
        assert json.loads(description(FEW, gated))["clock_gates"] is gated
        assert "never for that of link or host registers" in text


def test_the_synchronisers_and_the_limiter_are_marked_in_both_texts() -> None:
    for gated in (False, True):
        text = verilog(FEW.replace(registers="spi"), gated=gated)
        marked = re.findall(
            r'^  \(\* async_reg = "true", keep = "true" \*\) reg (?:\[\d+:0\] )?(\w+);$', text, re.MULTILINE
        )
        assert sorted(marked) == ["ack_meta", "ack_sync", "cs_n", "mosi", "sck"]
        narrow = verilog(chip(1, 2, 4, 5).classifier.replace(membrane_bits=9), gated=gated)
        assert '(* keep_hierarchy = "yes" *)\nmodule eskin_limit(' in narrow


def test_the_model_and_the_delivered_text_give_the_same_events(tmp_path: Path) -> None:
    config = ReadoutConfig(rows=1, columns=2, encoding="cw-lcs", link="four_phase")
    paths = {path.name for path in deliver(config, tmp_path, gated=True)}
    ports = json.loads((tmp_path / "eskin_readout.json").read_text())["ports"]
    pins = (tmp_path / "eskin_readout_datasheet.md").read_text().split("## Pins")[1].split("\n## ")[0]
    assert re.findall(r"^\| `(\w+)`", pins, re.MULTILINE) == [port["name"] for port in ports]
    assert ports[-1]["name"] == TEST
    assert {"eskin_readout.v", f"{GATE}.v", "eskin_readout.sdc"} <= paths
    gate = tmp_path / f"{GATE}.v"
    assert gate.read_text().endswith(BEHAVIOUR)
    words = ["--dut", tmp_path / "eskin_readout.v", "--dut", gate, "--sim", "icarus", "--ticks", 60]
    words += ["--rows", 1, "--columns", 2, "--encoding", "cw-lcs", "--link", "four_phase", "-o", tmp_path / "sim"]
    done = call("sim", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"bit-exact: \d+ runs, \d+ clocks, [1-9]\d* events, 0 mismatches", done.stdout)


def test_a_chip_with_lanes_that_saturate_is_proved() -> None:
    whole = chip(1, 2, 4, 5)
    narrow = whole.classifier.replace(membrane_bits=10, output_bits=10, evidence_bits=8, bias_bits=4)
    config = dataclasses.replace(whole, classifier=narrow)
    text = verilog(config, gated=True)
    assert prove_gated(config, text) > 300
    good = "assign other = set_valid |"
    assert good in text
    with pytest.raises(Different, match=r"^with clock gates not proved equal: "):
        prove_gated(config, text.replace(good, "assign other = ~set_valid |"))


def test_a_chip_with_clock_gates_is_proved_and_simulated(tmp_path: Path) -> None:
    config = chip(1, 2, 4, 5)
    texts = {path.name: path.read_text() for path in write(config, tmp_path, gated=True)}
    text = texts["eskin_chip.v"]
    assert prove_gated(config, text) > 300
    assert "gate_0_enable = ~set_group &" in text
    with pytest.raises(Different, match=r"^with clock gates not proved equal: "):
        prove_gated(config, text.replace("gate_0_enable = ~set_group &", "gate_0_enable = set_group &"))
    words = "always @(posedge clk)\n    if (read_valid"
    assert words in text
    with pytest.raises(Different, match=r"has another clock than clk$"):
        prove_gated(config, text.replace(words, words.replace("clk", "write_valid"), 1))
    assert play(config, "icarus", tmp_path, text=text + BEHAVIOUR)["events"] > 20
    assert lint(tmp_path / "eskin_chip.v", tmp_path / f"{GATE}.v") == ""
    assert TEST in texts["eskin_chip.sdc"]
