"""Add Verilator's coverage counters and functional points to simulations, and collect the counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import astuple
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

    flags = (*(flag for flag in VERILATOR_FLAGS if flag != NO_POINTS), *FLAGS)
    with instrumented(Instruments(flags, text, UNCOUNTED, tested)):
        play()
    different = list(dict.fromkeys(texts.values()))
    return {
        "constructs": [[*astuple(construct), count] for construct, count in sorted(counts.items())],
        "modules": [[name, digest, different.index(text)] for (name, digest), text in texts.items()],
        "texts": different,
    }
