"""Run the cocotb test of one block from pytest."""

import json
import pickle
import random
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from eskin.cocotb_tests.bench.block import JOB, STEPS, Simulator, Step
from eskin.model.tiles.config import MergeConfig, TilesConfig


def cosimulate(
    config: Any, simulator: Simulator, top: str, test: str, folder: Path, seed: int, module: str = "", **more: object
) -> Counter[str]:
    """Run one cocotb test of a block and return its counts.

    The module of the test is by default the test file of the block ``top``; ``more`` are further parts of the job.
    """
    from eskin.cocotb_tests.runner.simulator import build  # not in the simulator, which imports this file too

    job = {"config": config.to_dict(), "seed": seed, **more}
    module = module or top.replace("eskin_", "eskin.cocotb_tests.test_")
    build(config, simulator, top=top).test(module, folder, test, {JOB: json.dumps(job)})
    return Counter(json.loads((folder / "counts.json").read_text()))


Steps = Callable[[Any, random.Random, Counter[str]], Iterable[Step]]
"""Function of configuration, random generator, and counts of what happens in the steps."""


def play_steps(config: Any, simulator: Simulator, top: str, steps: Steps, folder: Path, seed: int) -> Counter[str]:
    """Compare a block with the steps of a function, and return the counts; ``checks`` are the compared outputs."""
    from eskin.cocotb_tests.runner.simulator import build

    counts: Counter[str] = Counter()
    played = list(steps(config, random.Random(seed), counts))
    counts["checks"] = sum(len(step.outputs) for step in played)
    (folder / STEPS).write_bytes(pickle.dumps([tuple(step) for step in played]))
    source = MergeConfig(config) if isinstance(config, TilesConfig) and top == "eskin_merge" else config
    build(source, simulator, top=top).test("eskin.cocotb_tests.bench.block", folder, "follow")
    return counts
