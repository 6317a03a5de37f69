"""Cocotb test that plays scans on a chip and compares them with both models."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cocotb

from eskin.cocotb_tests.runner.player import told_to_the_caller

JOB = "ESKIN_TOUCH_JOB"
"""Environment variable that names the file with the job."""


@dataclass(frozen=True)
class Job:
    """The scans of one simulation."""

    network: str  # file of the integer network
    config: dict[str, Any]  # fields of the ChipConfig
    # the names of what is played, each with what its result shall say of it
    played: dict[str, dict[str, Any]] = field(default_factory=dict)
    arrays: str = ""  # an .npz with the samples of each, under ``array/NAME``
    keep: str = ""  # folder for the results, a file for each
    reproduce: str = ""  # the command that shows a mismatch again, without the name
    # the names for which the harness skips the clocks in which the chip is not awake, if it can
    skip: list[str] = field(default_factory=list)

    def write(self, path: Path) -> None:
        """Write the job to a JSON file."""
        path.write_text(json.dumps(asdict(self)))


@cocotb.test()
async def play(dut: Any) -> None:
    """Play all scans of a job, compare them with the models, and write progress to progress.jsonl."""
    import numpy as np

    from eskin.base.files import write_arrays
    from eskin.cocotb_tests.bench.chip import ChipBench
    from eskin.model.classifier.chip_config import ChipConfig
    from eskin.model.classifier.file import IntegerWeights

    job = Job(**json.loads(Path(os.environ[JOB]).read_text()))
    parent = os.getppid()
    with Path("progress.jsonl").open("w", buffering=1) as progress, told_to_the_caller():
        weights = IntegerWeights.load(Path(job.network))
        bench = ChipBench(dut, ChipConfig.from_dict(job.config), weights.network, Path.cwd())
        with np.load(job.arrays) as arrays:
            for name, said in job.played.items():
                again, skip = f"{job.reproduce} ONLY={name}", name in job.skip
                found, recorded = await bench.check(arrays[f"array/{name}"], again, skip)
                recorded["metadata"] = np.array(json.dumps(said | found))
                write_arrays(Path(job.keep) / f"{name}.npz", recorded, compressed=True)
                progress.write(json.dumps({"name": name} | found) + "\n")
                if os.getppid() != parent:  # who asked for this was killed
                    raise SystemExit(1)
