"""Add Verilator's coverage counters and functional points to simulations, and collect the counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.cocotb_tests.runner.cocotb_runners import VERILATOR_FLAGS
from eskin.cocotb_tests.runner.simulator import Build, Instruments, instrumented
from eskin.rtl.verilog import Config
from eskin.verify.coverage.constructs import POINT, Construct, modules, read, with_points
from eskin.verify.coverage.points.point import Point

FLAGS = ["--coverage-expr", "--coverage-line", "--coverage-toggle", "--coverage-user", "--coverage-max-width", "128"]
NO_POINTS = "--no-assert"
"""Option of Verilator that leaves cover statements out."""
TEXT, COUNTS = "eskin_readout.v", "coverage.dat"
UNCOUNTED = "/* verilator coverage_off */\n"
"""Directive before the harness, which coverage does not count because it is not delivered."""


@dataclass
class Counts:
    """Coverage counts of several simulations."""

    counts: Counter[Construct] = field(default_factory=Counter)
    # a Verilog text that holds it, for each module's name and digest
    texts: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, counted: str, verilog: str) -> None:
        """Add the coverage counts of one simulation."""
        self.counts.update(read(counted, verilog, TEXT))
        plain = POINT.sub("", verilog)
        self.texts |= {(module.name, module.digest): plain for module in modules(plain)}

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as a dictionary for JSON."""
        texts = list(dict.fromkeys(self.texts.values()))
        return {
            "constructs": [[*astuple(construct), count] for construct, count in sorted(self.counts.items())],
            "modules": [[name, digest, texts.index(text)] for (name, digest), text in self.texts.items()],
            "texts": texts,
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Counts:
        """Return the counts for a dictionary written by ``to_dict``."""
        counts = Counter({Construct(*fields): count for *fields, count in content["constructs"]})
        return cls(counts, {(name, own): content["texts"][at] for name, own, at in content["modules"]})


@contextmanager
def counting(points: Callable[[Config], list[Point]]) -> Iterator[Counts]:
    """Build simulations with coverage counters, and yield the collected counts.

    ``points`` returns the points of a configuration.
    """
    found = Counts()

    def text(config: Config) -> str:
        return with_points(verilog_text(config), ((p.module, p.label, p.expression) for p in points(config)))

    def tested(program: Build, folder: Path) -> None:
        found.add((folder / COUNTS).read_text(), (program.folder / TEXT).read_text())
        (folder / COUNTS).unlink()  # otherwise a run without counts would count the old file again

    flags = (*(flag for flag in VERILATOR_FLAGS if flag != NO_POINTS), *FLAGS)
    with instrumented(Instruments(flags, text, UNCOUNTED, tested)):
        yield found
