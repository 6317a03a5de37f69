"""Test that the soak continues after a stop, finds a faulty readout, and shrinks the failure."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

import eskin.cocotb_tests.runner.simulator as simulator
from eskin.cocotb_tests.bench.draw import Draw
from eskin.cocotb_tests.runner.build_cache import SOURCES
from eskin.model.readout import simulate
from eskin.verify.soak import campaign, play
from eskin.verify.soak.campaign import MOST_SAMPLES, Plan, draws_of
from eskin.verify.soak.play import Failure, shrink
from tests.conftest import run_eskin as call

SMALL = ("--sim", "icarus", "--clocks", 600)
BREAKABLE = 27
"""A seed of an array of some columns whose events have a polarity and leave at any time."""


def test_it_goes_on_where_it_was_and_keeps_its_sums(tmp_path: Path) -> None:
    out, kept = tmp_path / "soak", tmp_path / "soak.json"
    for done in (1, 2):  # time for the first that is missing
        left = call("dev", "soak", "--hours", 1e-7, "--seed", 4, *SMALL, "--keep", kept, "-o", out)
        assert left.returncode == 0, left.stderr
        lines = left.stdout.splitlines()
        assert len(lines) == 2, "one configuration, one sum"
        assert re.fullmatch(
            rf"soak: {600 * done:,} clocks, [\d,]+ events, {done} configurations, 0 mismatches", lines[1]
        )
    content = json.loads(kept.read_text())
    assert content["seeds"] == [4, 5]
    assert re.fullmatch(r"make soak HOURS=0\.0\d SEED=4 CLOCKS=600", content["command"])  # of some seconds, in all
    assert content["result"] == lines[1]
    assert (content["configurations"], content["clocks"], content["mismatches"]) == (2, 1200, 0)
    piece = out / "pieces" / "4.json"
    piece.write_text(json.dumps(json.loads(piece.read_text()) | {"sources": "others"}))
    assert call("dev", "soak", "--hours", 1e-7, "--seed", 4, *SMALL, "-o", out).stdout.startswith("seed 4: ")
    assert json.loads(piece.read_text())["sources"] == SOURCES


def test_a_configuration_that_is_cut_off_keeps_its_runs_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "RUN_CLOCKS", 250)
    told: list[dict[str, Any]] = []
    campaign.soak(Plan(1e-9, 4, 600, "icarus", tmp_path), told.append)  # time for one run alone
    campaign.soak(Plan(1e-9, 4, 600, "icarus", tmp_path), told.append)
    assert [(piece["seed"], piece["runs"], piece["clocks"]) for piece in told] == [(4, 1, 250), (4, 2, 500)]
    campaign.soak(Plan(1e-9, 4, 600, "icarus", tmp_path), told.append)
    campaign.soak(Plan(1e-9, 4, 600, "icarus", tmp_path), told.append)
    assert [(piece["seed"], piece["clocks"]) for piece in told[2:]] == [(4, 600), (5, 250)]
    events = sum(
        len(simulate(draw.config, draw.stimulus)) for draw in campaign.draws_of(Plan(1, 4, 600, "icarus", tmp_path), 4)
    )
    assert told[2]["events"] == events


def test_a_broken_readout_becomes_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = simulator.verilog_text
    before, after = "event_polarity = |(", "event_polarity = ~|("
    assert before in text(Draw(BREAKABLE).config)
    monkeypatch.setattr(simulator, "verilog_text", lambda config: text(config).replace(before, after))
    monkeypatch.setattr(simulator, "BUILD", tmp_path)
    monkeypatch.setattr(play, "SIMPLER", {})  # every try starts a simulator
    failed = call("dev", "soak", "--hours", 1, "--seed", BREAKABLE, *SMALL, "-o", tmp_path / "soak")
    assert failed.returncode == 1
    assert failed.stdout.endswith("MISMATCH\n")
    (command,) = re.findall(r"^reproduce: make soak (.*)$", failed.stdout, re.MULTILINE)
    words = dict(word.split("=", 1) for word in shlex.split(command))
    assert words["ONLY"] == str(BREAKABLE)
    assert int(words["CLOCKS"]) < 100
    assert (
        (tmp_path / "soak" / "mismatches" / f"{BREAKABLE}.txt")
        .read_text()
        .startswith(f"seed {BREAKABLE}, run 0: RTL and model differ")
    )
    parts = [option for part in words.get("SET", "").split() for option in ("--set", part)]
    again = call("dev", "soak", "--only", BREAKABLE, "--clocks", words["CLOCKS"], "--sim", words["SIM"], *parts)
    assert again.returncode == 1
    assert f"reproduce: make soak {command}" in again.stdout
    summed = call("dev", "soak", "--hours", 0, "-o", tmp_path / "soak")
    assert summed.stdout == "soak: 0 clocks, 0 events, 0 configurations, 1 mismatches\n"


def test_shrinking_leaves_what_the_failure_needs() -> None:
    def fails(draw: Draw) -> Failure | None:
        config = draw.config
        bad = config.rows >= 2 and config.link == "four_phase" and draw.clocks > 57
        return Failure(draw, 57, "bad") if bad else None

    draw = Draw(5, clocks=10**6, set={"rows": 4, "columns": 4, "link": "four_phase", "masks": 100})
    best = shrink(Failure(draw, 57, "bad"), fails).draw
    config = best.config
    assert (config.rows, config.columns, config.link, best.clocks) == (2, 1, "four_phase", 59)
    assert (config.encoding, config.frontend, best.set["masks"], best.set["sink"]) == ("lcs", "digital", 0, "always")


def test_the_command_of_a_small_draw_draws_the_same() -> None:
    draw = Draw(3, clocks=50, run=2, most_taxels=10, set={"sink": "slow"})
    words = dict(word.split("=", 1) for word in shlex.split(play.command(draw, "icarus"))[2:])
    assert words.pop("SET") == f"sink=slow rows={draw.config.rows} columns={draw.config.columns}"
    assert words == {"ONLY": "3", "RUN": "2", "CLOCKS": "50", "SIM": "icarus"}
    same = Draw(3, 50, 2, {"sink": "slow", "rows": draw.config.rows, "columns": draw.config.columns})
    assert same.config == draw.config
    assert (same.stimulus.samples == draw.stimulus.samples).all()


def test_a_run_fits_the_memory_and_a_configuration_has_all_its_clocks() -> None:
    for seed in range(30):
        draws = draws_of(Plan(1, 0, 5_000_000, "verilator", Path()), seed)
        assert sum(draw.clocks for draw in draws) == 5_000_000
        assert {draw.config for draw in draws} == {draws[0].config}
        assert all(draw.clocks / draw.mean_gap * draw.config.taxels < 1.1 * MOST_SAMPLES for draw in draws)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--hours -1", "--hours must be in 0..10000, not -1.0"),
        ("--set rows=1", "--set has no effect without --only; add --only, or leave it out"),
        ("--only 1 --set row=1",
         "--set needs NAME=VALUE with a field of the configuration or signal, gap, sink, masks, share, not 'row=1'"),
        ("--only 1 --set rows=65", "rows must be in 1..64, not 65"),
        ("--only 1 --set signal=rare --set sink=none --set gap=3 --set masks=x",
         "signal must be one of noise, walk, square, hold, near, rare, sink one of always, random, slow, stuck, gap in "
         "1..1000000, masks in 0..1000 and share in 0..1, not rare, none, 3, x, 0.7"),
    ],
)  # fmt: skip
def test_mistakes_are_one_sentence(words: str, sentence: str, refuses: Any) -> None:
    refuses(f"error: {sentence}\n", "dev soak --sim icarus", words)
