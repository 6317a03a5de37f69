"""Check a layout with KLayout: design rules (DRC), layout against netlist (LVS), antennas, density, resistance."""

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eskin.flow.layout import environment

NAMES = (Path(__file__).parents[1] / "templates" / "names.rb").read_text()
COMPARE = (Path(__file__).parents[1] / "templates" / "compare.rb").read_text()


@dataclass(frozen=True)
class Rules:
    """Results of the design rule check."""

    checked: int  # number of rules
    violations: tuple[str, ...]  # rule and place of each


@dataclass(frozen=True)
class Comparison:
    """Results of the netlist comparison."""

    equal: bool
    # nets, transistors, ports: of the layout; only ports with compared names
    nets: int
    transistors: int
    ports: int
    differ: tuple[str, ...] = ()  # first nets that differ, that of the layout and that of the netlist


@dataclass(frozen=True)
class Electrical:
    """Results of the checks of antennas, metal density and wire resistance."""

    antenna_share: float  # largest antenna as a share of its limit, without inputs
    inputs: tuple[str, ...]  # inputs that need a diode outside
    density: dict[str, float]  # largest share of each metal in a window
    # nets: wires from a cell to another; largest_ohm: largest resistance of a wire
    nets: int
    largest_ohm: float
    violations: tuple[str, ...]  # kind, value, limit and place of each


def rules(gds: Path, top: str, deck: Path, folder: Path) -> None:
    """Check the design rules of a layout; violations are written to rules.lyrdb."""
    report = (folder / "rules.lyrdb").resolve()
    variables = {"SOURCE_FILE": str(gds.resolve()), "CELL_NAME": top, "REPORT_FILE": str(report)}
    environment.klayout(deck, variables, folder)


def read_rules(report: Path) -> Rules:
    """Return the violations in a report written by ``rules``."""
    root = ElementTree.parse(report).getroot()
    checked = len(root.findall("./categories/category"))
    if not checked:
        raise environment.Crashed("the rule check checked nothing")
    violations = []
    for item in root.findall("./items/item"):
        place = item.findtext("./values/value", "nowhere")
        violations.append(f"{item.findtext('category', '').strip(chr(39))} at {place}")
    return Rules(checked, tuple(violations))


def read_electrical(path: Path) -> Electrical:
    """Return the results written by the program ``electrical``."""
    said = json.loads(path.read_text())
    return Electrical(**said | {name: tuple(said[name]) for name in ("inputs", "violations")})


def comparing(deck: str) -> str:
    """Return the comparison deck with net names and a check of port names added, without diodes.

    The exported deck knows no names: it would accept two inputs that change places. The netlist has no diodes.
    """
    head, devices, tail = deck.partition("\n# Resistors\n")
    body, end, _ = tail.partition("\nalign\n")
    if not devices or not end:
        raise environment.Crashed("the exported comparison deck has another form; see flow/layout/requirements.txt")
    body = re.sub(r"\n# Diodes\n.*?(?=\n# Transistors\n)", "", body, flags=re.DOTALL)
    return head + NAMES + devices + body + COMPARE


def compare(gds: Path, top: str, spice: str, ports: Sequence[str], deck: str, folder: Path) -> None:
    """Compare the netlist of a layout with a SPICE netlist; results are written to counts.json and compare.lvsdb.

    ``top`` names cell and netlist, ``ports`` the ports whose names are compared, and ``deck`` is from ``comparing``.
    """
    (folder / "circuit.spi").write_text(spice)
    (folder / "compare.lvs").write_text(deck)
    variables = {
        "SOURCE_FILE": str(gds.resolve()),
        "CELL_NAME": top,
        "SPICE_FILE": str((folder / "circuit.spi").resolve()),
        "REPORT_FILE": str((folder / "compare.lvsdb").resolve()),
        "COUNTS_FILE": str((folder / "counts.json").resolve()),
        "PORTS": ",".join(ports),
    }
    environment.klayout(folder / "compare.lvs", variables, folder)


def read_comparison(counts: Path) -> Comparison:
    """Return the results written by ``compare``."""
    said = json.loads(counts.read_text())
    return Comparison(bool(said["equal"]), said["nets"], said["devices"], said["ports"], tuple(said["differ"]))
