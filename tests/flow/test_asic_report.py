"""``python -m flow asic``: netlist, proof, rules and timing of a small readout, and what it says of bad input."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flow.asic import timing
from flow.asic.equivalence import design_of
from flow.asic.library import read
from flow.asic.report import constant_outputs
from flow.asic.synthesis import netlist
from model.config import ReadoutConfig
from model.errors import InputError
from tests.flow import quill

NEEDS_STA = pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")


def written(corner: quill.Corner, folder: Path) -> Path:
    """Return the file of our own library at a corner."""
    path = folder / f"{corner.name}.lib"
    path.write_text(quill.library(corner))
    return path


def asic(*words: str) -> subprocess.CompletedProcess[str]:
    """Run the command."""
    return subprocess.run([sys.executable, "-m", "flow", "asic", *words], capture_output=True, text=True, check=False)


@NEEDS_STA
def test_a_run_leaves_a_report_and_says_what_matters(tmp_path: Path) -> None:
    typical, slow = written(quill.TYPICAL, tmp_path), written(quill.SLOW, tmp_path)
    out = tmp_path / "out"
    done = asic("--rows=1", "--columns=2", f"--lib={typical}", f"--slow={slow}", "--name=mine", f"--out={out}")
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((out / "mine" / "report.json").read_text())
    assert sorted(path.name for path in (out / "mine").iterdir()) == [
        *("eskin_readout.netlist.v", "eskin_readout.sdc", "report.json"),
    ]
    area, fmax = report["area_um2_per_taxel"], report["fmax_hz"]
    assert done.stdout.splitlines()[-1] == f"asic: mine, {area:.0f} um2 per taxel, {fmax['typical'] / 1e6:.1f} MHz"
    assert fmax["slow"] < fmax["typical"]
    assert report["equivalence"]["proved"] == report["equivalence"]["of"] > report["flops"] >= report["gated_flops"] > 0
    assert sum(block["area_um2"] for block in report["blocks"].values()) == pytest.approx(2 * area)
    assert sum(block["flops"] for block in report["blocks"].values()) == report["flops"]
    assert {"row", "arbiter"} <= set(report["blocks"])
    assert report["timing"]["slow"]["check_setup"] == []
    assert report["command"] == "make asic LIB=quill_typ.lib SLOW=quill_slow.lib ROWS=1 COLUMNS=2"
    assert str(tmp_path) not in (out / "mine" / "report.json").read_text()


@NEEDS_STA
@pytest.mark.parametrize("frontend", ["analog", "digital"])
def test_no_end_is_without_a_constraint_and_the_highest_clock_has_no_slack(frontend: str, tmp_path: Path) -> None:
    config = ReadoutConfig(rows=2, columns=1, frontend=frontend, link="four_phase", encoding="nlcs")  # type: ignore[arg-type]
    library = read(written(quill.TYPICAL, tmp_path))
    made = netlist(config, library)
    constant = constant_outputs(made, design_of(made))
    assert bool(constant) == (frontend == "analog")  # a reference of N-LCS is never below zero
    found = timing.analyse(made, library, constant)
    assert found.complaints == ()
    assert found.depth > 2
    assert found.hold_slack_s > -1e-9
    faster = netlist(config.replace(sample_rate_hz=found.fmax_hz / 64), library)
    assert timing.analyse(faster, library).setup_slack_s == pytest.approx(0.0, abs=2e-12)


@NEEDS_STA
def test_a_port_that_is_forgotten_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = read(written(quill.TYPICAL, tmp_path))
    made = netlist(ReadoutConfig(rows=1, columns=1), library)
    whole = timing.sdc(made, "$period")
    monkeypatch.setattr(timing, "sdc", lambda *_: whole.replace("event_valid", "event_polarity", 1))
    assert any("unconstrained" in line for line in timing.analyse(made, library).complaints)


def test_bad_input_is_one_sentence_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = tmp_path / "few.lib"
    nothing.write_text("module few; endmodule")
    out = tmp_path / "out"
    for words, sentence in (
        ([f"--lib={nothing}"], "few.lib is no liberty file that can be read: "),
        ([f"--lib={nothing}", "--name=../up"], "--name must be the plain name of a folder, not '../up'"),
        ([f"--lib={nothing}", "--readout=other"], "--readout must be one of spiking, frame, not 'other'"),
    ):
        done = asic(*words, f"--out={out}")
        if shutil.which("sta"):
            assert done.returncode == 2
            assert sentence in done.stderr
            assert done.stderr.count("\n") == 1
    assert not out.exists()
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(InputError, match=r"^OpenSTA not found; install with: apt-get install opensta$"):
        timing.check_program()
