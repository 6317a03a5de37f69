"""Cocotb test that plays scenarios and texture scans on the readout harness."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cocotb

from eskin.base.errors import InputError
from eskin.base.files import make_folder
from eskin.cocotb_tests.bench.readout import Bench, Mismatch, Prepared
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:  # these imports take longer than most runs
    from eskin.model.readout import Stimulus

JOB = "ESKIN_JOB"
"""Environment variable that names the file with the job."""


@dataclass(frozen=True)
class Job:
    """The runs of one simulation."""

    config: dict[str, Any]  # fields of the ReadoutConfig, or of the ChipConfig
    reproduce: str  # command that repeats a mismatch
    seed: int | None = None  # play the scenarios of this seed, if any
    scenarios: list[dict[str, Any]] = field(default_factory=list)  # prepared scenarios
    # scans: name of the dataset, preset (empty for samples), start row of the array in the image, and the largest
    # number of sample ticks of each scan (None for all)
    dataset: str = ""
    preset: str = ""
    start_row: float = 0.0
    ticks: int | None = None
    # metadata for the recording of each input, by name: class, label, proof
    played: dict[str, dict[str, Any]] = field(default_factory=dict)
    arrays: str = ""  # .npz with an image or samples for each input, under ``array/NAME``
    keep: str = ""  # folder for the RTL's events, a file per scan; empty for none
    # inputs for which the harness may skip the clocks in which nothing is awake
    skip: list[str] = field(default_factory=list)
    network: str = ""  # file of the integer network of a chip


@dataclass(frozen=True)
class Scan:
    """A texture scan: its stimulus, outstanding requests at its end, and event file."""

    name: str
    stimulus: Stimulus
    outstanding: int
    keep: Path
    metadata: dict[str, Any]


def _scans(job: Job, config: ReadoutConfig) -> Iterator[Scan]:
    """Yield the scans or recordings of a job."""
    if not job.played:
        return
    import numpy as np

    from eskin.cocotb_tests.bench.stimuli import outstanding, settled

    with np.load(job.arrays) as arrays:
        for name, said in job.played.items():
            array = arrays[f"array/{name}"]
            samples, of_scan = _samples_of(job, config, array) if job.preset else (array, {})
            stimulus = settled(config, samples[: job.ticks])
            own = {key: value for key, value in said.items() if key != "proof"}
            metadata = {"name": name} | own | {"dataset": job.dataset} | of_scan
            metadata |= {"ticks": len(stimulus.samples), "proof": said["proof"], "source": "rtl"}
            yield Scan(name, stimulus, outstanding(config, stimulus), Path(job.keep) / f"{name}.npz", metadata)


def _samples_of(job: Job, config: ReadoutConfig, image: Any) -> tuple[Any, dict[str, Any]]:
    """Return the samples of an image scan, and the metadata of its event file."""
    from eskin.cocotb_tests.bench.textures import large_enough
    from eskin.skin.textures.presets import preset

    if job.dataset == "embedded":
        image = large_enough(image, config)
    samples, clipped = preset(job.preset).samples(config, image, job.start_row)
    return samples, {"preset": job.preset, "start_row": job.start_row, "clipped_samples": clipped}


@contextlib.contextmanager
def given_job() -> Iterator[tuple[Job, Callable[[dict[str, Any]], None]]]:
    """Yield the job, and a function that writes a finished run to progress.jsonl.

    The message of a mismatch goes to mismatch.txt, and that of an input error to refused.txt.
    """
    parent = os.getppid()
    with Path("progress.jsonl").open("w", buffering=1) as progress:

        def tell(run: dict[str, Any]) -> None:
            progress.write(json.dumps(run) + "\n")
            if os.getppid() != parent:  # the parent process was killed
                raise SystemExit(1)

        try:
            yield Job(**json.loads(Path(os.environ[JOB]).read_text())), tell
        except Mismatch as mismatch:
            Path("mismatch.txt").write_text(str(mismatch))
            raise
        except InputError as refused:
            Path("refused.txt").write_text(str(refused))
            raise


async def _play_scenarios(bench: Bench, job: Job, config: ReadoutConfig) -> AsyncIterator[dict[str, Any]]:
    """Play the scenarios of a job; yield a report on each."""
    for number, prepared in enumerate(job.scenarios):
        run = Prepared(**prepared)
        bench.scoreboard.reproduce = run.reproduce or job.reproduce

        def again(number: int = number, draw: dict[str, Any] | None = run.draw) -> Stimulus:
            from eskin.cocotb_tests.bench.draw import Draw
            from eskin.cocotb_tests.bench.stimuli import scenarios

            if draw is not None:
                return Draw(**draw).stimulus
            assert job.seed is not None
            return list(scenarios(config, job.seed))[number].stimulus

        events = await bench.check_prepared(run, again)
        if not len(events) and run.draw is None:
            raise Mismatch(f"{run.name}: there was no event, so nothing was compared; reproduce: {job.reproduce}")
        yield {"name": run.name, "clocks": run.clocks, "events": len(events), "outstanding": run.outstanding}


async def _play_scans(bench: Bench, job: Job, config: ReadoutConfig) -> AsyncIterator[dict[str, Any]]:
    """Play the scans of a job and store the RTL's events; yield a report on each."""
    from eskin.model.events.recording import Recording

    for scan in _scans(job, config):
        bench.scoreboard.reproduce = f"{re.sub(' --seed [0-9]+', '', job.reproduce)} --only {scan.name}"  # no scenarios
        events = await bench.check(f"scan of {scan.name}", scan.stimulus, skip=scan.name in job.skip)
        make_folder(Path(job.keep), Path(scan.name).parent)
        Recording(events, config, scan.stimulus.clocks, metadata=scan.metadata).save(scan.keep)
        told = {"name": f"scan of {scan.name}", "clocks": scan.stimulus.clocks, "events": len(events)}
        yield told | {"outstanding": scan.outstanding}


@cocotb.test()
async def play(dut: Any) -> None:
    """Play all runs of a job, compare them with the model, and write progress to progress.jsonl."""
    with given_job() as (job, tell):
        config = ReadoutConfig.from_dict(job.config)
        bench = Bench(dut, config, Path.cwd())
        for played in (_play_scenarios, _play_scans):
            async for told in played(bench, job, config):
                tell(told)
