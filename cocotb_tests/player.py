"""The one cocotb test that plays whole runs of the readout harness: scenarios and texture scans."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cocotb

from cocotb_tests.bench import Bench, Mismatch
from cocotb_tests.stimuli import scenarios
from model.config import ReadoutConfig
from model.readout import Stimulus

JOB = "ESKIN_JOB"
"""Environment variable that names the file with the job."""


@dataclass(frozen=True)
class Job:
    """What a simulation shall play.

    Attributes
    ----------
    config : dict
        Fields of the ReadoutConfig.
    reproduce : str
        The command that shows a mismatch again.
    seed : int or None
        Play the scenarios of this seed, if any.
    dataset, preset, textures, ticks, start_row
        Play scans: the dataset's place (None for the default), the preset, the names of the textures, the most
        sample ticks of each (None for all), and the image row where the array starts.
    home : str
        The folder from which relative places count.
    keep : str
        Folder for the RTL's events, a file per scan; empty for none.
    """

    config: dict[str, Any]
    reproduce: str
    seed: int | None = None
    dataset: str | None = None
    preset: str = "physical"
    textures: list[str] = field(default_factory=list)
    ticks: int | None = None
    start_row: float = 0.0
    home: str = field(default_factory=os.getcwd)
    keep: str = ""

    def write(self, path: Path) -> None:
        """Write the job as JSON."""
        path.write_text(json.dumps(asdict(self)))


@dataclass(frozen=True)
class Run:
    """One run: its name, what to play, whether it ends with nothing outstanding, and where to keep the events."""

    name: str
    stimulus: Stimulus
    drained: bool
    keep: Path | None = None
    metadata: dict[str, Any] = field(default_factory=dict)


def _runs(job: Job, config: ReadoutConfig) -> Iterator[Run]:
    """Yield the runs of a job."""
    if job.seed is not None:
        for name, stimulus, drained in scenarios(config, job.seed):
            yield Run(name, stimulus, drained)
    if job.textures:
        from model.dataset import open_dataset
        from model.texture import preset

        with contextlib.chdir(job.home):
            dataset, scan = open_dataset(job.dataset), preset(job.preset)
        by_name = {texture.name: texture for texture in dataset}
        for texture in map(by_name.__getitem__, job.textures):
            samples, clipped = scan.samples(config, texture.load(), job.start_row)
            stimulus = Stimulus.from_samples(config, samples[: job.ticks])
            keep = Path(job.keep) / f"{texture.name}.npz" if job.keep else None
            metadata = {
                "name": texture.name,
                "class": texture.class_name,
                "label": texture.label,
                "dataset": dataset.name,
                "preset": job.preset,
                "start_row": job.start_row,
                "clipped_samples": clipped,
                "source": "rtl",
            }
            yield Run(f"scan of {texture.name}", stimulus, False, keep, metadata)


@cocotb.test()
async def play(dut: Any) -> None:
    """Play all runs of a job against the model; a line of progress.jsonl tells of each, mismatch.txt of a failure."""
    from model.events import Recording

    fields = json.loads(Path(os.environ[JOB]).read_text())
    job = Job(**fields)
    config = ReadoutConfig.from_dict(job.config)
    bench = Bench(dut, config, Path.cwd(), job.reproduce)
    parent = os.getppid()
    with Path("progress.jsonl").open("w", buffering=1) as progress:
        for run in _runs(job, config):
            try:
                events = await bench.check(run.name, run.stimulus)
            except Mismatch as mismatch:
                Path("mismatch.txt").write_text(str(mismatch))
                raise
            if run.keep is not None:
                run.keep.parent.mkdir(parents=True, exist_ok=True)
                Recording(events, config, run.stimulus.clocks, metadata=run.metadata).save(run.keep)
            done = {
                "name": run.name,
                "clocks": run.stimulus.clocks,
                "events": len(events),
                "drained": run.drained,
            }
            progress.write(json.dumps(done) + "\n")
            if os.getppid() != parent:  # who asked for this was killed
                raise SystemExit(1)
