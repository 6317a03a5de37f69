"""Test ``eskin asic``: netlist, proof, checks and timing of a small readout, and invalid input."""

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.readout import read_events
from eskin.flow import programs
from eskin.flow.asic import timing
from eskin.flow.asic.synthesis import synthesise
from eskin.flow.liberty.library import Library, read
from eskin.flow.power import event_bench
from eskin.flow.power.results import why_not
from eskin.flow.report import Report, command_of, measured, run
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.power.synthesis import SynthesisReport
from tests.conftest import run_eskin
from tests.flow import example_library

NEEDS_STA = pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")


NEEDS_ICARUS = pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")


@NEEDS_STA
@NEEDS_ICARUS
def test_a_run_leaves_a_report_and_says_what_matters(tmp_path: Path) -> None:
    typical, slow = example_library.written(tmp_path), example_library.written(tmp_path, example_library.SLOW)
    out = tmp_path / "out"
    done = run_eskin("asic", "--rows=2", "--columns=1", "--lib", typical, "--slow", slow, "--name=mine", "--out", out)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((out / "mine" / "report.json").read_text())
    assert sorted(path.name for path in (out / "mine").iterdir()) == [
        *("eskin_readout.netlist.v", "eskin_readout.sdc", "report.json"),
    ]
    area, fmax = report["area_um2_per_taxel"], report["fmax_hz"]
    idle, event = report["idle_w_per_taxel"], report["energy_per_event_j"]
    assert done.stdout.splitlines()[-1] == (
        f"asic: mine, {area:.0f} um2 per taxel, {fmax['typical'] / 1e6:.1f} MHz, "
        f"idle {1e9 * idle:.1f} nW per taxel, {1e12 * event:.2f} pJ per event"
    )
    assert idle > report["leakage_w_per_taxel"] > 0
    assert report["energy_per_lone_event_j"] > event > 0
    events = report["gate_level_events"]
    assert events["netlist"] == events["rtl"] == sum(s["events"] for s in report["power"].values()) > 100
    assert "power_not_measured" not in report
    wired = report["with_wires"]
    assert wired["pitch_um"] == 200 > report["pitch_um"] == 0
    assert all("blocks" in stretch for stretch in report["power"].values())
    assert not any("blocks" in stretch for stretch in wired["scenarios"].values())
    assert SynthesisReport.from_dict(report).power_w(8, 0.0) == pytest.approx(8 * idle)
    assert fmax["slow"] < fmax["typical"]
    assert report["equivalence"]["proved"] == report["equivalence"]["of"] > report["flops"] >= report["gated_flops"] > 0
    assert sum(block["area_um2"] for block in report["blocks"].values()) == pytest.approx(2 * area)
    assert sum(block["flops"] for block in report["blocks"].values()) == report["flops"]
    assert {"row", "arbiter"} <= set(report["blocks"])
    assert report["timing"]["slow"]["check_setup"] == []
    assert report["command"] == "make asic LIB=quill_typ.lib SLOW=quill_slow.lib ROWS=2 COLUMNS=1"
    assert str(tmp_path) not in (out / "mine" / "report.json").read_text()


@pytest.fixture(scope="module")
def unpowered(library: Library) -> Report:
    return run(ReadoutConfig(rows=1, columns=2), {"typical": library.path}, "two", lambda _: None, power=False)


@NEEDS_STA
def test_a_report_without_power_says_why(unpowered: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    found = unpowered.to_dict("make asic")
    assert unpowered.problems == []
    assert unpowered.closing_line().endswith(" MHz, power not measured: simulation is switched off (POWER=0)")
    assert not {"idle_w_per_taxel", "energy_per_event_j", "gate_level_events"} & set(found)
    assert found["power_not_measured"] == "simulation is switched off (POWER=0)"
    short = ReadoutConfig(rows=1, columns=2, resolution=1)
    assert why_not(short) == "resolution 1 is too low for a saturated stretch; choose a higher one"
    monkeypatch.setattr(shutil, "which", lambda _: None)
    absent = dataclasses.replace(unpowered, unmeasured=why_not(unpowered.netlist.config))
    assert absent.closing_line().endswith(
        "power not measured: iverilog not found; install with: apt-get install iverilog"
    )


def test_the_command_of_a_run_names_what_is_not_by_default_as_make_knows_it() -> None:
    config = ReadoutConfig(rows=4, encoding="nlcs", registers="spi", sample_rate_hz=500.0)
    corners = {"typical": Path("a.lib"), "slow": Path("b.lib")}
    words = "ROWS=4 ENCODING=nlcs SAMPLE_RATE=500.0 REGISTERS=spi"
    assert command_of(config, corners) == f"make asic LIB=a.lib SLOW=b.lib {words}"
    frames = FrameConfig(readout=ReadoutConfig(), word_bits=24)
    assert command_of(frames, corners) == "make asic READOUT=frame LIB=a.lib SLOW=b.lib WORD_BITS=24"


@NEEDS_STA
def test_each_check_that_fails_is_a_sentence(unpowered: Report) -> None:
    proof, timing = unpowered.equivalence, unpowered.timing["typical"]
    wrong = dataclasses.replace(
        unpowered,
        structure=dataclasses.replace(unpowered.structure, without_reset=("row_0.wild_reg",)),
        equivalence=dataclasses.replace(proof, proved=proof.of - 1, unproved=("event_valid",)),
        timing={
            "typical": dataclasses.replace(timing, complaints=("aer_ack has no constraint", "more")),
            "slow": dataclasses.replace(timing, setup_slack_s=-2e-9),
        },
    )
    assert wrong.problems == [
        "row_0.wild_reg has no reset",
        "1 points differ from the RTL, event_valid first",
        "typical: aer_ack has no constraint",
        "slow: the setup slack is -2 ns at the clock of the readout",
    ]
    empty = dataclasses.replace(proof, proved=proof.flops, of=proof.flops, unproved=())
    assert dataclasses.replace(unpowered, equivalence=empty).problems == ["0 points differ from the RTL, nothing first"]
    apart = {"gate_level_events": {"netlist": 0, "rtl": 0}, "difference": "OpenSTA and the tables differ"}
    assert dataclasses.replace(unpowered, more=apart, unmeasured="").problems == ["OpenSTA and the tables differ"]


@NEEDS_STA
@NEEDS_ICARUS
def test_a_library_without_an_integrated_gate_does_for_a_leaking_taxel_too(tmp_path: Path) -> None:
    path = example_library.written(tmp_path, without=("SLUMBER",))
    config = ReadoutConfig(rows=1, columns=2, encoding="nlcs", frontend="analog", link="four_phase")
    found = run(config, {"typical": path}, "leaky", lambda _: None)
    assert found.problems == []
    assert found.more["gate_level_events"]["netlist"] > 10
    assert (found.more["readout"], found.more["leak"]) == ("nlcs", "digital")
    assert found.more["with_wires"]["energy_per_event_j"] > found.more["energy_per_event_j"] > 0


@NEEDS_STA
@NEEDS_ICARUS
def test_an_event_that_the_netlist_loses_is_a_problem(unpowered: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_bench, "read_events", lambda *where: read_events(*where)[:-1])
    lossy = dataclasses.replace(unpowered, more=measured(unpowered.netlist), unmeasured="")
    events = lossy.to_dict("make asic")["gate_level_events"]
    assert events["netlist"] == events["rtl"] - 1 > 0
    assert len(lossy.problems) == 1
    assert "lone: the netlist does not do what the model does: " in lossy.problems[0]
    assert lossy.closing_line().endswith(" MHz, power not measured: a check of it failed")
    silent = dataclasses.replace(unpowered, more={"gate_level_events": {"netlist": 0, "rtl": 0}}, unmeasured="")
    assert silent.problems == ["the netlist sends 0 events in simulation, the RTL 0"]


@NEEDS_STA
@pytest.mark.parametrize("frontend", ["analog", "digital"])
def test_the_highest_clock_is_found_where_the_latch_of_a_gate_borrows_time(frontend: str, tmp_path: Path) -> None:
    """Check the search for the highest clock with latch-based clock gates, whose slack can be 0."""
    path = example_library.written(tmp_path, without=("SLUMBER",))
    library = read(path)
    config = ReadoutConfig(rows=1, columns=2, frontend=frontend)  # type: ignore[arg-type]
    made = synthesise(config, library)
    found = timing.analyse(made, library)
    assert found.fmax_hz > 50e6
    assert (found.setup_slack_s == 0) == (frontend == "analog")  # the decision comes when the latch is open

    def slack(hertz: float) -> float:
        faster = dataclasses.replace(made, config=config.replace(sample_rate_hz=hertz / 64))  # of the same cells
        return timing.analyse(faster, library).setup_slack_s

    assert slack(found.fmax_hz) >= -2e-12
    assert slack(1.0005 * found.fmax_hz) < 0


@NEEDS_STA
def test_a_wrong_table_of_a_cell_that_is_used_is_one_sentence(call: Any, folder: Path) -> None:
    (folder / "own.lib").write_text(example_library.library().replace('values ("0.038', 'values ("nan'))
    sentence = "error: the cell library own.lib is wrong: values of cell_rise of timing of pin Z of cell "
    code, _, error = call("asic --rows=1 --columns=1 --lib=own.lib --out=out")
    assert (code, error.startswith(sentence), error.count("\n")) == (2, True, 1)
    assert not (folder / "out").exists()


@pytest.mark.command("asic")  # runs take ten seconds and more
def test_bad_input_is_one_sentence_and_leaves_nothing(
    refuses: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "few.lib").write_text("module few; endmodule")
    for words, sentence in (
        ("", "few.lib cannot be read as a Liberty file: "),
        ("--name=../up", "--name must be the plain name of a folder, not '../up'"),
        ("--readout=other", "--readout must be one of spiking, frame, not 'other'"),
        ("--readout=frame --from-verilog", "--from-verilog is for the spiking readout"),
    ):
        refuses(sentence if shutil.which("sta") else "error", "asic --lib=few.lib --out=out", words)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(InputError, match=r"^OpenSTA not found; install with: apt-get install opensta$"):
        programs.check("sta")
