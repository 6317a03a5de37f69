"""Run the cocotb test of one block from pytest."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from eskin.cocotb_tests.bench.block import JOB, Simulator
from eskin.model.tiles.config import MergeConfig, TilesConfig


def cosimulate(
    config: Any, simulator: Simulator, top: str, test: str, folder: Path, seed: int, module: str = "", **more: object
) -> Counter[str]:
    """Run one cocotb test of a block and return its counts.

    The module of the test is by default the test file of the block ``top``; ``more`` are further parts of the job.
    """
    from eskin.cocotb_tests.runner.simulator import build  # not in the simulator, which imports this file too

    job = {"config": config.to_dict(), "seed": seed, **more}
    source = MergeConfig(config) if isinstance(config, TilesConfig) and top == "eskin_merge" else config
    module = module or top.replace("eskin_", "eskin.cocotb_tests.test_")
    build(source, simulator, top=top).test(module, folder, test, {JOB: json.dumps(job)})
    return Counter(json.loads((folder / "counts.json").read_text()))
