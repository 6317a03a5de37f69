"""Run all stages from the RTL of a readout to a checked layout."""

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, make_folder
from eskin.base.workers.engine import Pool, each
from eskin.flow.asic import synthesis
from eskin.flow.asic.equivalence import prove
from eskin.flow.layout import cells, checks, circuit, environment
from eskin.flow.layout.checks import Comparison, Electrical
from eskin.flow.layout.circuit import GROUND, SUPPLY, Circuit, SpiceCell
from eskin.flow.layout.environment import PROGRAMS, REQUIREMENTS, Crashed
from eskin.flow.layout.report import Report, Try, name_of
from eskin.flow.layout.stages import Stages
from eskin.flow.layout.tree import tree_of
from eskin.model.config import ReadoutConfig
from eskin.rtl.verilog import rtlil

MARGINS = (0.4, 0.35, 0.45, 0.5, 0.6, 0.75, 0.3)
"""Free area as a share of the cell area, in the order in which placement tries the values."""


def run(
    config: ReadoutConfig, name: str, out: Path, compare: bool, pool: Pool, on_stage: Callable[[str], None]
) -> Report:
    """Write a layout to OUT/NAME and return its report; an empty name follows from the configuration.

    The pool tries several margins at the same time; the report is that of one after the other.
    """
    if config.reset != "sync":
        raise InputError(f"reset must be sync, not {config.reset!r}: the flip-flop of the layout's cells has no reset")
    environment.check()
    name = name or name_of(config)
    folder = make_folder(out, name)
    stages = Stages(make_folder(folder, "work"), on_stage)
    library = _cells(stages)
    known = circuit.read_spice((library / "cells.spi").read_text())
    usable = cells.usable(known)
    areas = json.loads((library / "cells.json").read_text())
    made, proved, of = _netlist(config, cells.liberty(usable, areas), stages)
    on_stage(f"{len(made.cells)} cells, {proved} of {of} points equal to the RTL")
    area = sum(areas[kind] * number for kind, number in made.kinds.items())
    layout = Layout(made, area, library, known, stages)
    tries, placed = layout.route(pool)
    on_stage(f"margin {tries[-1].margin:.2f}: {tries[-1].problem or 'routed, no violation'}")
    comparison = layout.compare(placed) if compare and placed and not tries[-1].problem else None
    if placed:
        _deliver(placed, layout.top, folder, stages)
    return Report(name, config, made, area, proved, of, tuple(tries), comparison, stages.seconds)


def _cells(stages: Stages) -> Path:
    """Return the folder with cells, technology and rule decks."""
    inputs = ((PROGRAMS / "generate.py").read_text(), REQUIREMENTS.read_text())
    return stages.made("cells", inputs, lambda part: environment.run("generate", ".", folder=part))


def _netlist(config: ReadoutConfig, liberty: str, stages: Stages) -> tuple[Circuit, int, int]:
    """Return the readout as standard cells, and the number of its flops and outputs proved equal to the RTL."""

    def make(part: Path) -> None:
        library = part / "cells.lib"
        library.write_text(liberty)
        made = circuit.synthesise(config, library)
        (part / "netlist.v").write_text(made.text)
        proof = prove(made)
        said = {"proved": proof.proved, "of": proof.of, "circuit": asdict(circuit.circuit_of(made))}
        (part / "netlist.json").write_text(json.dumps(said))

    inputs = (rtlil(config), liberty, circuit.BUFFERED, circuit.SPLIT, Path(synthesis.__file__).read_text())
    said = json.loads((stages.made("netlist", inputs, make) / "netlist.json").read_text())
    return Circuit.from_dict(said["circuit"]), said["proved"], said["of"]


@dataclass(frozen=True)
class Layout:
    """A circuit and the stages of its layout."""

    circuit: Circuit
    area_um2: float  # area of the cells
    library: Path  # folder with cells, technology and decks
    known: dict[str, SpiceCell]
    stages: Stages

    @property
    def top(self) -> str:
        """Name of the top cell after routing by Coriolis."""
        return f"{self.circuit.top}_cts_r"

    def route(self, pool: Pool, margins: tuple[float, ...] = MARGINS) -> tuple[list[Try], Path | None]:
        """Return all routing attempts up to the first without violations, and the folder of the last attempt."""
        tries: list[Try] = []
        placed = None
        for done, folder, seconds in each(pool, attempt, [(self, margin) for margin in margins]):
            tries.append(done)
            placed = folder
            self.stages.seconds |= seconds
            if not done.problem:
                break
            self.stages.on_stage(f"margin {done.margin:.2f}: {done.problem}")
        return tries, placed if tries[-1].rules else None

    def place(self, margin: float) -> Path:
        """Return the folder with the results of Coriolis for an area margin."""
        blif = self.circuit.blif()
        said = json.dumps({"pins": self.circuit.ports, "area_um2": self.area_um2})

        def make(part: Path) -> None:
            (part / f"{self.circuit.top}.blif").write_text(blif)
            (part / "pins.json").write_text(said)
            try:
                environment.run("place", str(self.library.resolve()), self.circuit.top, str(margin), folder=part)
            except Crashed as crash:  # the router crashes for a few margins
                (part / "placed.json").write_text(json.dumps({"problem": str(crash)}))

        inputs = (blif, said, (PROGRAMS / "place.py").read_text(), self.library.name)
        return self.stages.made(f"place-{margin:.2f}", inputs, make)

    def judge(self, margin: float, placed: Path) -> Try:
        """Return the result of an attempt with an area margin."""
        said = json.loads((placed / "placed.json").read_text())
        if "problem" in said:
            return Try(margin, said["problem"])
        size = (said["width_um"], said["height_um"])
        if not said["routed"]:
            return Try(margin, "a segment is open", *size)
        tree = tree_of(self.circuit, self.circuit_in(said))
        if not tree:
            return Try(margin, "the netlist without the clock tree is another", *size)
        gds, deck = placed / f"{self.top}.gds", self.library / "drc.drc"
        checked = self.stages.made(
            f"rules-{margin:.2f}", (placed.name, deck.read_text()), lambda part: checks.rules(gds, self.top, deck, part)
        )
        rules = checks.read_rules(checked / "rules.lyrdb")
        electrical = self.electrical(margin, placed)
        broken = rules.violations + electrical.violations
        problem = f"{len(broken)} violations, {broken[0]}" if broken else ""
        return Try(margin, problem, *size, rules, tree, electrical)

    def electrical(self, margin: float, placed: Path) -> Electrical:
        """Return antennas, densities and resistances of an attempt with an area margin."""
        words = (str((placed / f"{self.top}.gds").resolve()), self.top)
        inputs = (placed.name, (PROGRAMS / "electrical.py").read_text())
        stage = f"electrical-{margin:.2f}"
        made = self.stages.made(stage, inputs, lambda part: environment.run("electrical", *words, folder=part))
        return checks.read_electrical(made / "electrical.json")

    def circuit_in(self, said: dict[str, Any]) -> Circuit:
        """Return the circuit behind a layout, from the results of Coriolis."""
        return Circuit.from_dict({**asdict(self.circuit), "cells": said["cells"]})

    def compare(self, placed: Path) -> Comparison:
        """Return the comparison of the layout with the circuit behind it, which contains the clock tree."""
        circuit = self.circuit_in(json.loads((placed / "placed.json").read_text()))
        gds, text = placed / f"{self.top}.gds", circuit.spice(self.known, self.top)
        deck = checks.comparing((self.library / "lvs.lvs").read_text())
        ports = [SUPPLY, GROUND, *self.circuit.read_ports]

        def make(part: Path) -> None:
            checks.compare(gds, self.top, text, ports, deck, part)

        done = self.stages.made("comparison", (placed.name, text, deck), make)
        return checks.read_comparison(done / "counts.json")


def attempt(layout: Layout, margin: float) -> tuple[Try, Path, dict[str, float]]:
    """Return the result of one margin, the folder with the results of Coriolis, and the time of all stages so far."""
    placed = layout.place(margin)
    return layout.judge(margin, placed), placed, layout.stages.seconds


def _deliver(placed: Path, top: str, folder: Path, stages: Stages) -> None:
    """Copy GDS and DEF to the folder of the run, and draw a picture."""

    def draw(part: Path) -> None:
        environment.run("picture", str((placed / f"{top}.gds").resolve()), "layout.png", folder=part)

    picture = stages.made("picture", (placed.name, (PROGRAMS / "picture.py").read_text()), draw)
    for source, name in (
        (placed / f"{top}.gds", "layout.gds"),
        (placed / f"{top}_export.def", "layout.def"),
        (picture / "layout.png", "layout.png"),
    ):
        _copy(source, folder / name)


def _copy(source: Path, path: Path) -> None:
    """Copy a file whole or not at all."""
    with atomic_write(path) as file, source.open("rb") as made:
        shutil.copyfileobj(made, file)
