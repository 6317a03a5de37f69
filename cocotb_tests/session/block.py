"""From pytest into the simulator and back, for the test of one block."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from cocotb_tests.bench.block import JOB
from model.config import ReadoutConfig
from model.tiles.config import MergeConfig, TilesConfig

if TYPE_CHECKING:
    from cocotb_tests.session.runners import Simulator

MERGE = "eskin_merge"


def cosimulate(
    config: ReadoutConfig, simulator: Simulator, top: str, test: str, folder: Path, seed: int
) -> Counter[str]:
    """Run one cocotb test of a block and return what it counted.

    Parameters
    ----------
    config : ReadoutConfig
    simulator : "icarus" or "verilator"
    top : str
        The block: ``eskin_taxel``, ``eskin_arbiter``, ``eskin_merge``, ...; its test file has the name of the block.
    test : str
        Name of the cocotb test.
    folder : Path
        Where it runs and leaves its log.
    seed : int
        For everything random in it.
    """
    from cocotb_tests.session.simulator import build  # not in the simulator, which imports this file too

    job = {"config": config.to_dict(), "seed": seed}
    module = top.replace("eskin_", "cocotb_tests.test_")
    source = MergeConfig(config) if isinstance(config, TilesConfig) and top == MERGE else config
    build(source, simulator, top=top).test(module, folder, test, {JOB: json.dumps(job)})
    return Counter(json.loads((folder / "counts.json").read_text()))
