"""The datasheet: its pins, numbers and pictures are those of the configuration, and of the Verilog."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from model.config import ReadoutConfig
from model.errors import InputError
from rtl.datasheet.facts import Facts
from rtl.datasheet.netlist import load_report
from rtl.datasheet.page import PICTURES, datasheet, write_datasheet
from rtl.datasheet.waves import Wave, reset_waves, waves
from rtl.delivery import constraints, ports
from rtl.verilog import verilog

STREAM = ReadoutConfig(rows=3, columns=5)
AER = ReadoutConfig(
    rows=2, columns=3, encoding="cw-lcs", frontend="analog", link="four_phase", reset="async", clocks_per_sample=32
)
LEAKY = ReadoutConfig(rows=4, columns=2, encoding="nlcs", decide_every="sample", sample_rate_hz=1000.0, registers="spi",
                      leak_period=9)  # fmt: skip
CONFIGS = [STREAM, AER, LEAKY, ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase", sample_bits=3,
                                             resolution=1, reference_reset=3)]  # fmt: skip
REPORT = {
    "configuration": STREAM.to_dict(),
    "library": "typ.lib",
    "area_um2_per_taxel": 2190.96,
    "fmax_hz": {"typical": 177.14e6, "slow": 113.91e6},
    "leakage_w_per_taxel": 25.5e-9,
    "flops": 1242,
    "gated_flops": 1240,
    "energy_per_event_j": 1.4e-12,
    "equivalence": {"proved": 1250, "of": 1251},
}


def section(page: str, title: str) -> str:
    return page.split(f"\n## {title}\n")[1].split("\n## ")[0]


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in text.splitlines() if line[:2] == "| "][
        1:
    ]


@pytest.mark.parametrize("config", CONFIGS, ids=str)
def test_pins_and_parameters_are_those_of_the_configuration(config: ReadoutConfig) -> None:
    page = datasheet(config)
    told = [[f"`{p['name']}`", p["direction"], f"{p['width']}", p["meaning"]] for p in ports(config)]
    assert cells(section(page, "Pins")) == told
    listed = cells(page.split("\n## ")[0])
    assert listed == [[f"`{name}`", f"{value}"] for name, value in config.to_dict().items()]
    # The words of the page name no signal that is not there.
    names = {port["name"] for port in ports(config)}
    inside = {"awake", "eskin_link", "out", "registers"}
    for word in re.findall(r"\b((?:event|aer|sample|reference|half|step)_[a-z]+)\b", page.split("\n## Pins")[1]):
        if word not in config.to_dict() and word not in inside and not word.startswith("sample_bits"):
            assert word in names, word


@pytest.mark.parametrize("config", CONFIGS, ids=str)
def test_times_are_those_of_the_microarchitecture(config: ReadoutConfig) -> None:
    facts = Facts.of(config)
    stream = config.link == "stream"
    assert (facts.latency, facts.clocks_per_event) == ((3, 1) if stream else (4, 7))
    assert facts.bound_events == (config.rows + 1) * config.columns + (not stream)
    assert facts.bound_clocks == facts.bound_events * facts.clocks_per_event + 2
    assert config.taxels * facts.clocks_per_event <= facts.longest_gap <= facts.bound_clocks
    table = cells(section(datasheet(config), "Latency, throughput and the longest wait"))
    clocks = [facts.latency, facts.latency - 1, facts.clocks_per_event, facts.bound_clocks, facts.longest_gap]
    assert [int(row[1]) for row in table] == clocks[-len(table) :]
    for _, number, time in table:
        value, unit = time.split()
        scale = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}[unit]
        assert float(value) * scale == pytest.approx(int(number) / config.clock_hz, rel=1e-4)


def test_who_drives_what_when_is_what_the_constraints_say() -> None:
    lines = section(datasheet(AER), "Signals in")
    period_ns = 1e9 / AER.clock_hz
    sdc = constraints(AER)
    delays = {
        name: float(share)
        for share, names in re.findall(r"_delay \[expr ([\d.]+) .*\{(.*)\}", sdc)
        for name in names.replace("[*]", "").split()
    }
    leaves, settled = 1 - delays["reference_code"], delays["above"]
    assert delays["half_width"] == delays["reference_code"]
    assert delays["below"] == delays["above"]
    told = [row[3] for row in cells(lines) if len(row) == 4]
    spans = [float(text.removesuffix(" ns")) for text in told if text.endswith(" ns")]
    expected = [leaves * period_ns, (settled - leaves) * period_ns, (1 - settled) * period_ns]
    assert spans == pytest.approx(expected, rel=1e-4)
    assert sum(spans) == pytest.approx(period_ns, rel=1e-4)
    assert "| half width | 4 to 16, in steps of 4 | 0.00195312 to 0.0078125 |" in lines
    assert "| reference | -2048 to 2044, in steps of 4 |" in lines


def test_another_configuration_is_another_page_and_the_same_is_the_same(tmp_path: Path) -> None:
    first, second = tmp_path / "1", tmp_path / "2"
    for folder in (first, second):
        folder.mkdir()
        assert {path.name for path in write_datasheet(AER, folder)} == {"eskin_readout_datasheet.md", *PICTURES}
    kept = {path.name: path.read_bytes() for path in first.iterdir()}
    assert kept == {path.name: path.read_bytes() for path in second.iterdir()}
    for changes in ({"rows": 4}, {"clocks_per_sample": 16}, {"link": "stream"}, {"resolution": 5}, {"reset": "sync"}):
        assert datasheet(AER.replace(**changes)).split("\n## Pins")[1] != datasheet(AER).split("\n## Pins")[1], changes
    write_datasheet(AER.replace(link="stream"), second)
    assert all(kept[name] != (second / name).read_bytes() for name in PICTURES)


def test_numbers_of_the_netlist_come_from_its_report_alone(tmp_path: Path) -> None:
    title = "Area, power and highest clock"
    assert "make asic" in section(datasheet(STREAM), title)
    path = tmp_path / "report.json"
    path.write_text(json.dumps(REPORT))
    page = section(datasheet(STREAM, load_report(path, STREAM)), title)
    told = ("2191 um2", "177.14 MHz", "113.91 MHz", "25.5 nW", "1242, 1240", "1.4 pJ", "1250 of 1251", "typ.lib")
    assert all(number in page for number in told), page
    assert page.count("not in the report") == 2
    with pytest.raises(InputError, match="rows = 3, not 4; give that of this configuration"):
        load_report(path, STREAM.replace(rows=4))
    path.write_text("{}")
    with pytest.raises(InputError, match="no report of make asic: it has no configuration"):
        load_report(path, STREAM)


def bench_of(config: ReadoutConfig, shown: list[Wave]) -> str:
    """Return a testbench that drives the inputs of a diagram and holds the outputs to it, clock by clock."""
    found = {port["name"]: port for port in ports(config)}
    indexed = {"sample, taxel 0": "sample", "above, taxel 0": "above"}
    indexed |= {"reference, taxel 0": "reference_code", "half width, taxel 0": "half_width"}
    wires = ""
    for name, port in found.items():
        kind, start = ("reg", " = 0") if port["direction"] == "input" else ("wire", "")
        wires += f"{kind} [{port['width'] - 1}:0] {name}{start};\n"
    drive, check = [], []
    for clock in range(len(shown[0].values)):
        lines = []
        for wave in shown:
            name, value = indexed.get(wave.name, wave.name), wave.values[clock]
            if name not in found or value is None:
                continue
            width = found[name]["width"] // (config.taxels if wave.name in indexed else 1)
            if found[name]["direction"] == "output":
                check.append(
                    f"if (clock == {clock} && {name}[{width - 1}:0] !== {width}'d{value}) errors = errors + 1;"
                )
                check.append(f"if (clock == {clock}) checks = checks + 1;")
            elif wave.name in indexed:
                count = min(3, config.taxels)
                lines.append(f"{name} = {{{count}{{{width}'d{value}}}}};")
            else:
                lines.append(f"{name} = {value};")
        drive.append(f"{clock}: begin {' '.join(lines)} end")
    pins = ", ".join(f".{name}({name})" for name in found)
    return f"""module bench;
{wires}integer clock; integer errors = 0; integer checks = 0;
eskin_readout dut({pins});
initial begin
  rst = 1; taxel_enable = ~0; repeat (3) begin #5 clk = 1; #5 clk = 0; end
  rst = 0;
  for (clock = 0; clock < {len(shown[0].values)}; clock = clock + 1) begin
    case (clock) {" ".join(drive)} endcase
    #5 {" ".join(check)}
    clk = 1; #5 clk = 0;
  end
  $display("%0d errors of %0d", errors, checks); $finish;
end
endmodule
"""


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
@pytest.mark.parametrize("config", [STREAM, AER], ids=["stream", "aer"])
def test_the_verilog_does_what_the_pictures_show(config: ReadoutConfig, tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text(verilog(config))
    for number, shown in enumerate((waves(config), reset_waves(config))):
        (tmp_path / "bench.v").write_text(bench_of(config, shown))
        subprocess.run(["iverilog", "-o", f"sim{number}", "bench.v", "dut.v"], cwd=tmp_path, check=True)
        said = subprocess.run(["vvp", f"sim{number}"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
        outputs = {port["name"] for port in ports(config) if port["direction"] == "output"}
        names = outputs | ({"reference, taxel 0", "half width, taxel 0"} if config.frontend == "analog" else set())
        checks = sum(value is not None for wave in shown if wave.name in names for value in wave.values)
        assert checks > 20
        assert said == f"0 errors of {checks}\n"
