"""Test that pins, numbers and pictures of the datasheet match configuration and Verilog."""

import functools
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.flow import programs
from eskin.flow.datasheet import classifier, frame_readout, skin
from eskin.flow.datasheet.page import load_report, sheet_of
from eskin.flow.datasheet.sheet import Wave
from eskin.flow.datasheet.waves import latencies, reset_waves, waves
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import constraints, ports
from eskin.rtl.verilog import Config, top_block, verilog

PICTURES = ("eskin_readout_event.svg", "eskin_readout_reset.svg")
STREAM = ReadoutConfig(rows=3, columns=5)
AER = ReadoutConfig(
    rows=2, columns=3, encoding="cw-lcs", frontend="analog", link="four_phase", reset="async", clocks_per_sample=32
)
LEAKY = ReadoutConfig(rows=4, columns=2, encoding="nlcs", decide_every="sample", sample_rate_hz=1000.0, registers="spi",
                      leak_period=9)  # fmt: skip
CONFIGS = [STREAM, AER, LEAKY, ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase", sample_bits=3,
                                             resolution=1, reference_reset=3)]  # fmt: skip
FRAMES = FrameConfig(readout=ReadoutConfig(rows=2, columns=3, resolution=5), settle_clocks=2)
NEURONS = ClassifierConfig(inputs=5, hidden=6, classes=3, lanes=2, clocks_per_bin=100)
MERGE = MergeConfig(TilesConfig.of(ReadoutConfig(rows=2, columns=2), 2, 2))
needs_icarus = pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
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


text_of = functools.cache(verilog)


def datasheet(config: ReadoutConfig, report: dict[str, Any] | None = None) -> str:
    return sheet_of(config, report).text()


def section(page: str, title: str) -> str:
    return page.split(f"\n## {title}\n")[1].split("\n## ")[0]


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in text.splitlines() if line[:2] == "| "][
        1:
    ]


@pytest.mark.parametrize("config", [*CONFIGS, FRAMES, NEURONS, MERGE, MERGE.skin], ids=lambda config: str(config)[:60])
def test_a_page_has_the_pins_and_parameters_of_its_design(config: Any, tmp_path: Path) -> None:
    sheet = sheet_of(config)
    page, names = sheet.text(), {path.name for path in sheet.write(tmp_path)}
    assert (tmp_path / f"{sheet.top}_datasheet.md").read_text() == page
    assert set(re.findall(r"\]\((.*\.svg)\)", page)) == names - {f"{sheet.top}_datasheet.md"}
    told = [[f"`{p['name']}`", p["direction"], f"{p['width']}", p["meaning"]] for p in ports(config)]
    assert cells(section(page, "Pins")) == told
    assert cells(page.split("\n## ")[0]) == [[f"`{name}`", f"{value}"] for name, value in config.to_dict().items()]
    # The words of the page name no signal that is not there.
    signals = {port["name"] for port in ports(config)} | {"awake", "load_*"}
    signals |= {wave.name for wave in sheet.pictures[0].waves} | set(config.to_dict())
    if config in CONFIGS:
        words = re.findall(r"\b((?:event|aer|sample|reference|half|step)_[a-z]+)\b", page.split("\n## Pins")[1])
    else:
        words = re.findall(r"`([a-z]+_[a-z_*]+|awake)`", page.split("\n## Clock")[1])
    assert words
    assert {word for word in words if not word.startswith("sample_bits")} <= signals


@pytest.mark.parametrize("config", CONFIGS, ids=str)
def test_times_are_those_of_the_microarchitecture(config: ReadoutConfig) -> None:
    found = latencies(config)
    stream = config.link == "stream"
    assert (found.latency, found.clocks_per_event) == ((3, 1) if stream else (4, 7))
    assert found.bound_events == (config.rows + 1) * config.columns + (not stream)
    assert found.bound_clocks == found.bound_events * found.clocks_per_event + 2
    assert config.taxels * found.clocks_per_event <= found.longest_gap <= found.bound_clocks
    table = cells(section(datasheet(config), "Latency, throughput and the longest wait"))
    clocks = [found.latency, found.latency - 1, found.clocks_per_event, found.bound_clocks, found.longest_gap]
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


@pytest.mark.parametrize("registers", ["none", "spi"])
def test_a_page_says_flops_of_a_half_width_only_where_its_dac_sees_flops(registers: str) -> None:
    config = ReadoutConfig(rows=1, columns=1, encoding="cw-lcs", frontend="analog", registers=registers)
    page = datasheet(config)
    (meaning,) = (port["meaning"] for port in ports(config) if port["name"] == "half_width")
    assert ("from flops" in meaning) is (registers == "none")
    assert "at the pin" in page
    assert ("the readout, from flops" in page) is (registers == "none")


def test_another_configuration_is_another_page_and_the_same_is_the_same(tmp_path: Path) -> None:
    first, second = tmp_path / "1", tmp_path / "2"
    for folder in (first, second):
        folder.mkdir()
        assert {path.name for path in sheet_of(AER).write(folder)} == {"eskin_readout_datasheet.md", *PICTURES}
    kept = {path.name: path.read_bytes() for path in first.iterdir()}
    assert kept == {path.name: path.read_bytes() for path in second.iterdir()}
    for changes in ({"rows": 4}, {"clocks_per_sample": 16}, {"link": "stream"}, {"resolution": 5}, {"reset": "sync"}):
        assert datasheet(AER.replace(**changes)).split("\n## Pins")[1] != datasheet(AER).split("\n## Pins")[1], changes
    sheet_of(AER.replace(link="stream")).write(second)
    assert "divided by 2^shift" in datasheet(STREAM.replace(receptive_fields="neighbours"))
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
    with pytest.raises(InputError, match="rows = 3, not 4; give the report of this configuration"):
        load_report(path, STREAM.replace(rows=4))
    path.write_text("{}")
    with pytest.raises(InputError, match="lacks configuration and is not a report of make asic"):
        load_report(path, STREAM)


def checked(config: Config, shown: list[Wave], folder: Path, before: str = "") -> int:
    """Apply the inputs of a timing diagram to the Verilog, and return the number of outputs that are as in the diagram.

    ``before``: Verilog statements during reset.
    """
    found = {port["name"]: port for port in ports(config)}
    indexed = {"sample, taxel 0": "sample", "above, taxel 0": "above"}
    indexed |= {"reference, taxel 0": "reference_code", "half width, taxel 0": "half_width"}
    wires = [
        f"{'reg' if port['direction'] == 'input' else 'wire'} [{port['width'] - 1}:0] {name};"
        for name, port in found.items()
    ]
    clocks, checks = [], 0
    for clock in range(len(shown[0].values)):
        drive, check = [], []
        for wave in shown:
            name, value = indexed.get(wave.name, wave.name), wave.values[clock]
            if name not in found or value is None:
                continue
            taxels = config.taxels if isinstance(config, ReadoutConfig) and wave.name in indexed else 1
            width = found[name]["width"] // taxels
            if found[name]["direction"] == "output":
                check.append(f'if ({name}[{width - 1}:0] !== {width}\'d{value}) $display("{clock} {name}");')
            elif wave.name in indexed:
                drive.append(f"{name} = {{{min(3, taxels)}{{{width}'d{value}}}}};")
            else:
                drive.append(f"{name} = {value};")
        clocks += [*drive, "#5", *check, "clk = 1; #5 clk = 0;"]
        checks += len(check)
    zero = [f"{name} = 0;" for name, port in found.items() if port["direction"] == "input"]
    enable = ["taxel_enable = ~0;"] if "taxel_enable" in found else []
    reset = ["rst = 1;", *enable, before, "repeat (3) begin #5 clk = 1; #5 clk = 0; end", "rst = 0;"]
    pins = ", ".join(f".{name}({name})" for name in found)
    bench = [
        "module bench;",
        "integer clock;",
        *wires,
        f"{top_block(config).module_name} dut({pins});",
        "initial begin",
    ]
    bench += [*zero, *reset, *clocks, '$display("end"); $finish;', "end", "endmodule"]
    assert programs.icarus([text_of(config), *bench], "bench", folder) == "end\n"
    return checks


@needs_icarus
@pytest.mark.parametrize("config", [STREAM, AER], ids=["stream", "aer"])
def test_the_verilog_does_what_the_pictures_show(config: ReadoutConfig, tmp_path: Path) -> None:
    for shown in (waves(config), reset_waves(config)):
        assert checked(config, shown, tmp_path) > 20


@needs_icarus
@pytest.mark.parametrize("stall", [0, frame_readout.STALLED])
def test_frames_do_what_their_pictures_show(stall: int, tmp_path: Path) -> None:
    scan = frame_readout.Scan(FRAMES, stall)
    shown = scan.waves(tuple(dict.fromkeys(frame_readout.AT_ADC + frame_readout.AT_SINK)))
    assert checked(FRAMES, shown, tmp_path) > 100
    picture = sheet_of(FRAMES).pictures[stall > 0]
    by_name = {wave.name: wave.values for wave in shown}
    for wave in picture.waves:
        assert wave.values == by_name[wave.name][picture.first : picture.first + len(wave.values)]
    seen = {wave.name: wave.values for wave in picture.waves}
    assert not stall or (1 in seen["frame_overrun"] and seen["word_ready"].count(0) == stall)


@needs_icarus
def test_a_classifier_does_what_its_pictures_show(tmp_path: Path) -> None:
    shown, _, _ = classifier.two_events(NEURONS)
    words = max(NEURONS.weight_words, NEURONS.neuron_words)
    load = "load_valid = 1; for (clock = 0; clock < %d; clock = clock + 1) begin load_address = clock; "
    load += "load_neurons = 0; #5 clk = 1; #5 clk = 0; load_neurons = 1; #5 clk = 1; #5 clk = 0; end load_valid = 0;"
    assert checked(NEURONS, shown, tmp_path, load % words) > 50
    by_name = {wave.name: wave.values for wave in shown}
    for picture in sheet_of(NEURONS).pictures:
        for wave in picture.waves:
            assert wave.values == by_name[wave.name][picture.first : picture.first + len(wave.values)]
    assert sum(sheet_of(NEURONS).pictures[0].waves[1].values) > 0
    assert sum(next(w for w in sheet_of(NEURONS).pictures[1].waves if w.name == "class_valid").values) == 1


@needs_icarus
def test_a_merge_does_what_its_picture_shows(tmp_path: Path) -> None:
    shown = sheet_of(MERGE).pictures[0].waves
    assert checked(MERGE, shown, tmp_path) > 30
    ready, valid = (next(w.values for w in shown if w.name == name) for name in ("event_ready", "event_valid"))
    assert sum(bool(r and v) for r, v in zip(ready, valid, strict=True)) == 3 * skin.EVENTS


def test_times_of_other_designs_are_those_of_their_reference() -> None:
    def clocks(config: Any) -> list[int]:
        return [int(row[1]) for row in cells(section(sheet_of(config).text(), "Latency and throughput"))]

    settle, turn, taxels = FRAMES.settle_clocks, FRAMES.settle_clocks + 1 + FRAMES.adc_clocks, FRAMES.taxels
    first_word = -(-FRAMES.word_bits // FRAMES.resolution)
    assert clocks(FRAMES) == [1, 1 + settle, turn, first_word * turn + 2, taxels * turn + 3, FRAMES.frame_clocks]
    h, c, groups = NEURONS.hidden, NEURONS.classes, NEURONS.groups
    quiet = 3 * h + 2 + c + 3
    assert clocks(NEURONS) == [h + c + 2, h + c + 3, groups, quiet, quiet + h * (groups - 1) + h * (c - 1)]
    assert clocks(MERGE) == [1, 1, MERGE.skin.tiles + 2]
    assert clocks(MERGE.skin) == [4, 1, 1, MERGE.skin.tiles + 2]
    assert clocks(MERGE.skin.replace(relays=2)) == [6, 3, 1, MERGE.skin.tiles + 2]


def test_a_report_of_frames_stands_on_their_page(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    content = REPORT | {"configuration": FRAMES.to_dict(), "energy_per_event_j": 3.97e-12}
    path.write_text(json.dumps(content))
    page = section(sheet_of(FRAMES, load_report(path, FRAMES)).text(), "Area, power and highest clock")
    assert "| energy per sample, for whole frames | 3.97 pJ |" in page
    assert "lone" not in page
    with pytest.raises(InputError, match="word_bits = 16, not 20; give the report of this configuration"):
        load_report(path, FRAMES.replace(word_bits=20))
    path.write_text(json.dumps(REPORT | {"closing_w_per_taxel": 40e-9, "energy_per_closed_window_j": 50e-12}))
    page = section(datasheet(STREAM, load_report(path, STREAM)), "Area, power and highest clock")
    assert "| power per taxel while its window closes | 40 nW |" in page
