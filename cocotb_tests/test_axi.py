"""Compare the readout behind AXI with the golden models, event by event and access by access."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.axi import run
from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.cocotb_tests.test_verilog import declared, lint
from eskin.model.bus.config import BusConfig
from eskin.model.cases import AXES, singles
from eskin.model.config import ReadoutConfig
from eskin.rtl.delivery import constraints, ports, write
from tests.conftest import run_eskin as call

BASE = ReadoutConfig(rows=3, columns=5, clocks_per_sample=24, leak_period=20)
CASES = [
    (BusConfig(readout=BASE.replace(rows=2, registers="spi"), time_bits=5), "random"),
    (BusConfig(readout=BASE.replace(registers="spi", encoding="nlcs-bipolar", reset="async")), "slow"),
    (BusConfig(readout=BASE.replace(rows=2, columns=6, frontend="analog", encoding="cw-lcs"), time_bits=20), "always"),
    (BusConfig(readout=BASE.replace(rows=1, columns=1, encoding="nlcs"), time_bits=64), "stuck"),
]


@pytest.mark.parametrize(("config", "sink"), CASES, ids=lambda one: one if isinstance(one, str) else "")
def test_foreign_manager_and_sink_see_the_models(config: BusConfig, sink: str, tmp_path: Path) -> None:
    counts = run(config, tmp_path, 7, sink, 3200 if config.readout.registers == "spi" else 1200)
    assert counts["sent"] == counts["events"] > 100
    assert counts["stalls"] > 20 or sink == "always"
    assert counts["longest"] > 1 or config.readout.columns == 1
    if config.readout.registers != "none":
        assert min(counts[name] for name in ("changed", "refused", "counted", "read")) >= 1


@pytest.mark.parametrize("config", singles(**AXES | {"link": ["stream"]}), ids=lambda one: one.encoding)
def test_the_wrapper_of_every_legal_readout_is_clean_and_has_the_listed_ports(
    config: ReadoutConfig, tmp_path: Path
) -> None:
    design = BusConfig(readout=config, time_bits=config.rows)
    paths = {path.name: path for path in write(design, tmp_path)}
    assert paths["eskin_readout.v"].read_text() == verilog_text(config)
    assert lint(paths["eskin_axi.v"], paths["eskin_readout.v"]) == ""
    listed = {port["name"]: (port["direction"], port["width"]) for port in ports(design)}
    assert declared(paths["eskin_axi.v"].read_text(), "eskin_axi") == listed
    assert ("s_axi_wdata" in listed) == (config.registers == "spi")
    timed = constraints(design).replace("[*]", "").replace("{", " ").replace("}", " ").split()
    assert set(listed) <= set(timed)
    assert {"clk", "rst"}.isdisjoint(timed)


def test_the_readout_inside_has_the_files_that_it_has_without_a_bus(tmp_path: Path) -> None:
    options = ("verilog", "--rows", 2, "--columns", 3, "--registers", "spi", "-o")
    alone, inside = tmp_path / "alone", tmp_path / "inside"
    call(*options, alone)
    call(*options, inside, "--bus", "axi", "--time-bits", 16)
    names = {path.name for path in alone.iterdir()}
    assert {path.name for path in inside.iterdir()} - names == {
        *(f"eskin_axi{end}" for end in (".v", ".sdc", ".json", ".core", "_tb.sv", "_datasheet.md", "_stream.svg")),
    }  # fmt: skip
    assert {name: (alone / name).read_bytes() for name in names} == {n: (inside / n).read_bytes() for n in names}
    call("verilog", "--bus", "axi", "-o", inside)
    assert not (inside / "eskin_registers.h").exists()


REFUSED = {
    "--bus axi --link four_phase": "a readout behind a bus must have the link stream, not four_phase",
    "--bus ahb": "--bus must be one of axi, not 'ahb'",
    "--bus axi --time-bits 65": "time_bits must be in 0..64, not 65",
    "--time-bits 3": "--time-bits has no effect without --bus; add --bus axi",
    "--bus axi --word-bits 8": "--word-bits is for the frame readout; add --readout frame",
    "--bus axi --readout frame": "--bus has no effect with --readout frame: leave one of the two out",
    "--bus axi --tiles 2x2": "--bus has no effect with --tiles: leave one of the two out",
}


@pytest.mark.parametrize("options", REFUSED)
def test_what_no_bus_can_carry_is_refused_in_a_sentence(options: str, tmp_path: Path) -> None:
    done = call("verilog", *options.split(), "-o", tmp_path / "out")
    assert done.returncode == 2
    assert REFUSED[options] in done.stderr
    assert not (tmp_path / "out").exists()
