"""Cocotb test that plays scans on a chip and compares them with both models."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cocotb

from eskin.cocotb_tests.runner.player import given_job


@cocotb.test()
async def play(dut: Any) -> None:
    """Play all scans of a job, compare them with the models, and write progress to progress.jsonl."""
    import numpy as np

    from eskin.base.files import write_arrays
    from eskin.cocotb_tests.bench.chip import ChipBench
    from eskin.model.classifier.chip_config import ChipConfig
    from eskin.model.classifier.file import IntegerWeights

    with given_job() as (job, tell):
        weights = IntegerWeights.load(Path(job.network))
        bench = ChipBench(dut, ChipConfig.from_dict(job.config), weights.network, Path.cwd())
        with np.load(job.arrays) as arrays:
            for name, said in job.played.items():
                again, skip = f"{job.reproduce} ONLY={name}", name in job.skip
                found, recorded = await bench.check(arrays[f"array/{name}"], again, skip)
                recorded["metadata"] = np.array(json.dumps(said | found))
                write_arrays(Path(job.keep) / f"{name}.npz", recorded, compressed=True)
                tell({"name": name} | found)
