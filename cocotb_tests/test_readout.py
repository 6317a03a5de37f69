"""The whole readout against the model: encoders, arrays, resolutions, links, front ends, sinks, masks, resets."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cocotb
import pytest

from cocotb_tests.bench import Bench
from cocotb_tests.simulator import Simulator, build
from cocotb_tests.stimuli import scenarios
from model.config import ReadoutConfig

ARRAYS = [(1, 1), (1, 4), (3, 5), (8, 8), (12, 16)]


@cocotb.test()
async def play_scenarios(dut) -> None:  # type: ignore[no-untyped-def]
    """Play all scenarios of a seed; what was compared is left in compared.json."""
    job = json.loads(os.environ["ESKIN_JOB"])
    config = ReadoutConfig.from_dict(job["config"])
    bench = Bench(dut, config, Path.cwd(), job["reproduce"])
    drained = 0
    for name, stimulus, rests in scenarios(config, job["seed"], job["ticks"], job["limit"]):
        await bench.check(name, stimulus)
        drained += rests
    board = bench.scoreboard
    Path("compared.json").write_text(
        json.dumps({"runs": board.runs, "clocks": board.clocks, "events": board.events, "drained": drained})
    )


def play(config: ReadoutConfig, simulator: Simulator, folder: Path, ticks: int, limit: int) -> None:
    """Play the scenarios of a configuration in a simulator and see that they compared something."""
    seed = ARRAYS.index((config.rows, config.columns)) if (config.rows, config.columns) in ARRAYS else 0
    program = build(config, simulator)
    job = {
        "config": config.to_dict(),
        "seed": seed,
        "ticks": ticks,
        "limit": limit,
        "reproduce": "make test PYTEST='-k \""
        + os.environ.get("PYTEST_CURRENT_TEST", "").split(" ")[0]
        + "\"'",
    }
    program.test("cocotb_tests.test_readout", folder, "play_scenarios", {"ESKIN_JOB": json.dumps(job)})
    compared = json.loads((folder / "compared.json").read_text())
    assert compared["runs"] == 8
    assert compared["events"] > 0
    assert compared["drained"] > 0
