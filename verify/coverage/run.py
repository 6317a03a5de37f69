"""Run all coverage simulations, store their results, and summarise the coverage."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, astuple, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from eskin import cocotb_tests, model, rtl
from eskin.base.files import Pieces
from eskin.board.config import BoardConfig
from eskin.cocotb_tests.runner.build_cache import digest, scratch_folder, sources, verilog_text
from eskin.cocotb_tests.runner.cocotb_runners import VERILATOR_FLAGS
from eskin.cocotb_tests.runner.simulator import Build, Instruments, instrumented
from eskin.rtl.verilog import Config
from eskin.verify import coverage
from eskin.verify.coverage.constructs import POINT, Construct, modules, read, with_points
from eskin.verify.coverage.plan import Run
from eskin.verify.coverage.points.designs import points
from eskin.verify.coverage.points.point import Point
from eskin.verify.coverage.waivers import Waiver, claim, unproved

SOURCES = sources(
    (
        *((package, "**/*.py") for package in (rtl, model, cocotb_tests)),
        (cocotb_tests, "**/*.v"),
        *((coverage, f"{name}.py") for name in ("run", "constructs", "stimuli", "boards/*")),
    )
)
FLAGS = ["--coverage-expr", "--coverage-line", "--coverage-toggle", "--coverage-user", "--coverage-max-width", "128"]
TEXT, COUNTS = "eskin_readout.v", "coverage.dat"


@dataclass
class Reached:
    """Coverage of several runs together."""

    counts: Counter[Construct] = field(default_factory=Counter)  # over all runs
    # a Verilog text that holds it, for each module's name and digest
    texts: dict[tuple[str, str], str] = field(default_factory=dict)
    points: Counter[tuple[str, str]] = field(default_factory=Counter)  # by group and name
    runs: list[str] = field(default_factory=list)

    def add(self, run: Run, piece: dict[str, Any], wanted: Iterable[Point]) -> list[int]:
        """Add the coverage counts of a run (see ``counted``), and return those of its constructs."""
        self.runs.append(run.name)
        by_label: Counter[str] = Counter()
        own: Counter[Construct] = Counter()
        for *fields, count in piece["constructs"]:
            construct = Construct(*fields)
            if construct.kind == "point":
                by_label[construct.what] += count
            elif not run.only or construct.module in run.only:
                own[construct] = count
        self.counts.update(own)
        self.texts |= {(name, digest): piece["texts"][at] for name, digest, at in piece["modules"]}
        for point in wanted:
            self.points[point.group, point.name] += by_label[f"point_{point.label}"]
        return list(own.values())

    def of(self, kind: str) -> list[Construct]:
        """Return all constructs of a kind."""
        return [construct for construct in self.counts if construct.kind == kind]


@dataclass
class Verdict:
    """Result of a coverage campaign."""

    explained: dict[Construct, Waiver]
    # points that are missing, constructs without a reason, reasons without a construct, proofs that failed
    problems: list[str]


def play(runs: Iterable[Run], folder: Path, on_run: Callable[[str, int, int], None]) -> Reached:
    """Simulate the runs without stored results; return the coverage of all runs.

    The folder keeps what each run reached. ``on_run`` is called with the name of each run, its constructs, and how many
    of them it reached.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pieces, reached = Pieces(folder / "coverage.json", SOURCES), Reached()
    for run in runs:
        wanted = points(run.config)
        fields = asdict(run.config) if isinstance(run.config, BoardConfig) else run.config.to_dict()
        key = [run.name, fields, [asdict(point) for point in wanted]]
        own = reached.add(run, pieces.of(digest(key), partial(_played, run, folder)), wanted)
        on_run(run.name, len(own), sum(count > 0 for count in own))
    return reached


def _played(run: Run, folder: Path) -> dict[str, Any]:
    with scratch_folder(folder, "run") as running:
        return counted(points, partial(run.player, run.config, running.resolve()))


def counted(points: Callable[[Config], list[Point]], play: Callable[[], object]) -> dict[str, Any]:
    """Run simulations with coverage counters, and return the counts of all constructs as a dictionary for JSON.

    ``points`` returns the points of a configuration. The dictionary has a text for every module, by name and digest.
    """
    counts: Counter[Construct] = Counter()
    texts: dict[tuple[str, str], str] = {}

    def text(config: Config) -> str:
        return with_points(verilog_text(config), ((p.module, p.label, p.expression) for p in points(config)))

    def tested(program: Build, folder: Path) -> None:
        verilog = (program.folder / TEXT).read_text()
        counts.update(read((folder / COUNTS).read_text(), verilog, TEXT))
        (folder / COUNTS).unlink()  # otherwise a run without counts would count the old file again
        plain = POINT.sub("", verilog)
        texts.update({(module.name, module.digest): plain for module in modules(plain)})

    flags = (*(flag for flag in VERILATOR_FLAGS if flag != "--no-assert"), *FLAGS)  # it leaves cover statements out
    uncounted = "/* verilator coverage_off */\n"  # the harness is not delivered
    with instrumented(Instruments(flags, text, uncounted, tested)):
        play()
    different = list(dict.fromkeys(texts.values()))
    return {
        "constructs": [[*astuple(construct), count] for construct, count in sorted(counts.items())],
        "modules": [[name, digest, different.index(text)] for (name, digest), text in texts.items()],
        "texts": different,
    }


def judge(reached: Reached, listed: list[Waiver], whole: bool = True) -> Verdict:
    """Return the coverage result after applying the waivers."""
    found: dict[Construct, Waiver] = {}
    rest = []
    for construct in sorted(construct for construct, count in reached.counts.items() if not count):
        if waiver := next((one for one in listed if one.explains(construct)), None):
            found[construct] = waiver
        else:
            rest.append(construct)
    problems = [f"not reached: {group}: {name}" for (group, name), count in reached.points.items() if not count]
    problems += [f"not reached, and no reason given: {construct.said}" for construct in rest]
    if whole:
        problems += [
            f"explains nothing: the waiver of {waiver.kind} {waiver.signal}: {waiver.reason}"
            for waiver in listed
            if waiver not in found.values()
        ]
    claims: dict[tuple[str, str], dict[Construct, str]] = {}
    for construct, waiver in found.items():
        if waiver.proof:
            key = construct.module, construct.text
            rise = replace(construct, what=f"{construct.what.partition(':')[0]}:0->1")
            became_1 = reached.counts[rise] > 0
            claims.setdefault(key, {})[construct] = claim(construct, became_1, reached.texts[key])
    for (module, text), of_module in claims.items():
        failed = unproved(reached.texts[module, text], module, of_module)
        problems += [f"reason not proved: {construct.said}" for construct in failed]
    return Verdict(found, problems)


def _of_kinds(reached: Reached, verdict: Verdict) -> dict[str, dict[str, int]]:
    """Return the number of all, reached and waived constructs of each kind."""
    return {
        kind: {
            "total": len(own),
            "reached": sum(reached.counts[construct] > 0 for construct in own),
            "explained": sum(construct in verdict.explained for construct in own),
        }
        for kind in ("line", "branch", "toggle", "condition")
        for own in [reached.of(kind)]
    }


def closing_line(reached: Reached, verdict: Verdict) -> str:
    """Return the final message of ``make coverage``."""
    words = zip(_of_kinds(reached, verdict).values(), ("lines", "branches", "toggles", "conditions"), strict=True)
    parts = [f"{own['reached'] + own['explained']:,} of {own['total']:,} {word}" for own, word in words]
    hit = sum(count > 0 for count in reached.points.values())
    told = f"{', '.join(parts)} ({len(verdict.explained):,} explained)"
    return f"coverage: {told}, {hit:,} of {len(reached.points):,} points"


def summary(reached: Reached, verdict: Verdict) -> dict[str, Any]:
    """Return the result as a dictionary for JSON."""
    reasons = {
        waiver.reason: {"constructs": count, "proved": waiver.proof}
        for waiver, count in Counter(verdict.explained.values()).items()
    }
    points = Counter(group for group, _ in reached.points)
    hit = Counter(group for (group, _), count in reached.points.items() if count)
    modules = Counter(construct.module for construct in reached.counts)
    return {
        "result": closing_line(reached, verdict),
        "constructs": _of_kinds(reached, verdict),
        "modules": dict(sorted(modules.items())),
        "reasons": reasons,
        "points": {group: {"points": count, "reached": hit[group]} for group, count in points.items()},
        "runs": reached.runs,
        "problems": verdict.problems,
    }
