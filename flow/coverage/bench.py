"""Gives simulation programs the counters of Verilator, puts points into their Verilog, and gathers what they count."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import astuple, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from cocotb_tests.session import runners, simulator
from cocotb_tests.session.store import verilog_text
from flow.coverage.constructs import POINT, Construct, modules, read, with_points
from flow.coverage.points.point import Point
from rtl.verilog import Config

FLAGS = ["--coverage-expr", "--coverage-line", "--coverage-toggle", "--coverage-user", "--coverage-max-width", "128"]
NO_POINTS = "--no-assert"
"""Would leave cover statements out."""
TEXT, COUNTS = "eskin_readout.v", "coverage.dat"
UNCOUNTED = "/* verilator coverage_off */\n"
"""In front of the harness, which is no part of what is delivered."""


@dataclass
class Counts:
    """What simulations reached.

    Attributes
    ----------
    counts : dict of Construct to int
    texts : dict of (str, str) to str
        A Verilog text that holds it, for each module's name and digest.
    """

    counts: dict[Construct, int] = field(default_factory=dict)
    texts: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, counted: str, verilog: str) -> None:
        """Add what a simulation of a text left."""
        for construct, count in read(counted, verilog, TEXT).items():
            self.counts[construct] = self.counts.get(construct, 0) + count
        plain = POINT.sub("", verilog)
        self.texts |= {(module.name, module.digest): plain for module in modules(plain)}

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON content."""
        texts = list(dict.fromkeys(self.texts.values()))
        return {
            "constructs": [[*astuple(construct), count] for construct, count in sorted(self.counts.items())],
            "modules": [[name, digest, texts.index(text)] for (name, digest), text in self.texts.items()],
            "texts": texts,
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Counts:
        """Return what ``to_dict`` gave."""
        counts = {Construct(*fields): count for *fields, count in content["constructs"]}
        return cls(counts, {(name, own): content["texts"][at] for name, own, at in content["modules"]})


@contextmanager
def counting(points: Callable[[Config], list[Point]]) -> Iterator[Counts]:
    """Build with counters within; yield what all simulations played there have reached.

    Parameters
    ----------
    points : callable
        Gives the points of a configuration.
    """
    found = Counts()
    test = simulator.Build.test

    def text(config: Config) -> str:
        return with_points(verilog_text(config), ((p.module, p.label, p.expression) for p in points(config)))

    def counted(program: simulator.Build, module: str, folder: Path, *rest: Any, **more: Any) -> None:
        (folder / COUNTS).unlink(missing_ok=True)
        test(program, module, folder, *rest, **more)
        found.add((folder / COUNTS).read_text(), (program.folder / TEXT).read_text())

    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="coverage-")))
        (folder / "harness.v").write_text(UNCOUNTED + simulator.HARNESS.read_text())
        for place, name, value in (
            (simulator, "HARNESS", folder / "harness.v"),
            (
                simulator,
                "VERILATOR_FLAGS",
                [*(flag for flag in simulator.VERILATOR_FLAGS if flag != NO_POINTS), *FLAGS],
            ),
            (simulator, "verilog_text", text),
            (simulator.Build, "test", counted),
            (runners, "OPTIMISE", "-O0"),  # the runs take less time than optimising them
        ):
            stack.enter_context(patch.object(place, name, value))
        yield found
