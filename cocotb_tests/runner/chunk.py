"""Simulate a part of the inputs as one task of a worker pool."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, make_folder
from eskin.base.workers.engine import MAX_DEATHS
from eskin.cocotb_tests.bench.stimuli import settled
from eskin.cocotb_tests.runner.build_cache import BUILD, scratch_folder
from eskin.cocotb_tests.runner.inputs import Inputs
from eskin.cocotb_tests.runner.process import ReadoutRun, Tally, play_runs
from eskin.cocotb_tests.runner.simulator import Build, SimulationDied, build
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.presets import preset

T = TypeVar("T")


@dataclass(frozen=True)
class Scans:
    """Scans of textures, or recordings, for a readout."""

    config: ReadoutConfig
    arrays: dict[str, NDArray[Any]]  # image or codes by name
    repeat_command: str  # command that repeats all of them
    said: dict[str, dict[str, Any]]  # metadata of the recordings by name
    dataset: str = ""
    preset: str = ""  # empty for recordings
    start_row: float = 0.0
    ticks: int | None = None  # largest number of sample ticks of each
    skip: Sequence[str] = ()  # those for which the harness may skip clocks

    @classmethod
    def of(
        cls,
        material: Inputs,
        names: Sequence[str],
        config: ReadoutConfig,
        program: Build,
        repeat_command: str,
        **own: Any,
    ) -> Scans:
        """Return a part of the inputs."""
        said = {name: own | {"proof": material.proof(name, program)} for name, own in material.said(names).items()}
        place = (material.name, material.preset, material.start_row)
        arrays = {name: material.array(name, config) for name in names}
        return cls(config, arrays, repeat_command, said, *place, **own)

    def runs(self, keep: Path) -> Iterator[ReadoutRun]:
        """Yield a run for each; the RTL's events go into a folder."""
        for name, array in self.arrays.items():
            samples, scanned = array, {}
            if self.preset:
                samples, clipped = preset(self.preset).samples(self.config, array, self.start_row)
                scanned = {"preset": self.preset, "start_row": self.start_row, "clipped_samples": clipped}
            stimulus = settled(self.config, samples[: self.ticks])
            own = {key: value for key, value in self.said[name].items() if key != "proof"}
            metadata = {"name": name} | own | {"dataset": self.dataset} | scanned
            metadata |= {"ticks": len(stimulus.samples), "proof": self.said[name]["proof"], "source": "rtl"}
            make_folder(keep, Path(name).parent)
            repeat_command, skips = f"{self.repeat_command} --only {name}", name in self.skip
            yield ReadoutRun(
                self.config,
                f"scan of {name}",
                stimulus,
                repeat_command,
                skips,
                keep=keep / f"{name}.npz",
                metadata=metadata,
            )


def play_part(scans: Scans) -> tuple[Tally, dict[str, bytes]]:
    """Play scans on this machine and return totals and event files; restart a crashed simulation."""
    program = build(scans.config, "verilator")

    def play(running: Path) -> tuple[Tally, dict[str, bytes]]:
        events = make_folder(running, "events")
        tally = play_runs(program, scans.runs(events), running)
        return tally, {name: (events / f"{name}.npz").read_bytes() for name in scans.arrays}

    return retry_after_crash("replay", play)


def store(folder: Path, files: dict[str, bytes], on_run: Callable[[], object]) -> None:
    """Write result files into a folder, each file whole or not at all."""
    for name, content in files.items():
        make_folder(folder, Path(name).parent)
        with atomic_write(folder / f"{name}.npz") as file:
            file.write(content)
        on_run()


def retry_after_crash(name: str, play: Callable[[Path], T]) -> T:
    """Return the result of a simulation, restarted in a new folder after a crash."""
    for _ in range(MAX_DEATHS + 1):
        with scratch_folder(BUILD / "run", name) as running:
            try:
                return play(running)
            except SimulationDied as died:
                last = str(died).strip().splitlines()[-1]
    raise InputError(
        f"the simulation crashed {MAX_DEATHS + 1} times, perhaps from lack of memory ({last}); use fewer --workers"
    )
