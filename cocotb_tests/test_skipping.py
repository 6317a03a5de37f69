"""Test that the harness skips idle clocks without a change of events, and that a wrong ``awake`` is found."""

import re
from pathlib import Path

import numpy as np
import pytest

from eskin.cocotb_tests.bench.textures import random_scan
from eskin.cocotb_tests.runner import simulator
from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.cocotb_tests.runner.chunk import Scans
from eskin.cocotb_tests.runner.process import MismatchFound, Tally, play_runs
from eskin.cocotb_tests.test_chip import chip
from eskin.cocotb_tests.touch.noise import play as play_chip
from eskin.model.cases import axes, cases
from eskin.model.config import Encoding, ReadoutConfig
from eskin.rtl.verilog import Config

CHIP = chip(2, 2, 8, 3)


def play(encoding: Encoding, folder: Path) -> Tally:
    """Play a scan with every clock; then skip idle clocks for the scan, for a lone taxel and for a constant signal."""
    config = ReadoutConfig(rows=2, columns=3, encoding=encoding)
    samples = random_scan(config, 60, np.random.default_rng(3))
    arrays = {"all": samples, "skipped": samples, "rest": np.repeat(samples[30:31], 60, axis=0)}
    arrays["lone"] = samples * (np.arange(config.taxels) == 1)
    scans = Scans(config, arrays, "again", {name: {"proof": ""} for name in arrays}, skip=["skipped", "rest", "lone"])
    return play_runs(simulator.build(config, "icarus"), scans.runs(folder / "events"), folder)


@pytest.mark.parametrize("encoding", [config.encoding for config in cases(**axes("encoding"))])
def test_skipped_runs_have_the_events_of_the_model(encoding: Encoding, tmp_path: Path) -> None:
    tally = play(encoding, tmp_path)
    assert (tally.runs, tally.clocks) == (4, 4 * 60 * 64)
    assert tally.events > 100


def test_skipped_scans_of_a_chip_have_the_potentials_and_classes_of_the_models(tmp_path: Path) -> None:
    found = play_chip(CHIP, "icarus", tmp_path)
    assert found["events"] > 100
    assert found["bins"] > 10
    assert found["hidden_spikes"] > 5


BROKEN: dict[str, tuple[Encoding, str, str, str]] = {
    "stuck low": ("lcs", "eskin_readout", r"(assign awake =)[^;]*;", r"\1 1'b0;"),
    "without a row": ("nlcs", "eskin_readout", r"(\| )row_1_awake", r"\g<1>1'b0"),
    "without a taxel": ("lcs", "eskin_row", r"(\| )taxel_1_needs_clock", r"\g<1>1'b0"),
}


def break_text(monkeypatch: pytest.MonkeyPatch, module: str, pattern: str, replacement: str) -> None:
    """Change one place of a module of the simulated Verilog."""

    def broken(config: Config) -> str:
        before, name, after = verilog_text(config).partition(f"module {module}(")
        inside, end, rest = after.partition("endmodule")
        changed, count = re.subn(pattern, replacement, inside)
        assert count == 1
        return before + name + changed + end + rest

    monkeypatch.setattr(simulator, "verilog_text", broken)


@pytest.mark.parametrize("fault", BROKEN)
def test_a_wrong_awake_is_found(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    encoding, *change = BROKEN[fault]
    break_text(monkeypatch, *change)
    with pytest.raises(MismatchFound, match=r"scan of (skipped|lone): RTL and model differ"):
        play(encoding, tmp_path)


@pytest.mark.parametrize(("term", "end"), [(r"[^;]*", "1'b0"), (r"([^;]*)\bpending\b", r"\2 1'b0")])
def test_a_classifier_that_sleeps_too_much_is_found(
    term: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_text(monkeypatch, "eskin_classifier", rf"(assign awake =){term}", rf"\1 {end}")
    with pytest.raises(MismatchFound, match=r"RTL[\s\S]*reproduce: again ONLY=skipped"):
        play_chip(CHIP, "icarus", tmp_path)
