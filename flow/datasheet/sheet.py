"""Common parts of all datasheets: Markdown page with pictures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from eskin.base.files import atomic_write
from eskin.flow.datasheet.pictures import timing_diagram
from eskin.flow.datasheet.waves import Wave
from eskin.model import __version__
from eskin.rtl.delivery import ports
from eskin.rtl.verilog import Config, top_block

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}

RESETS = {
    "sync": "Active high, sampled at the rising edge of `clk`.",
    "async": "Active high, asynchronous at every flop: assert it at any time, release it in step with `clk`.",
}
NO_NETLIST = ["Not known to this page: `make asic` makes no netlist of this design."]


@dataclass(frozen=True)
class Picture:
    """A timing diagram.

    Attributes
    ----------
    name : str
        What it is called within the names of files.
    title : str
    waves : list of Wave
    first : int
        Clock of its first column.
    """

    name: str
    title: str
    waves: list[Wave]
    first: int = 0


@dataclass(frozen=True)
class Sheet:
    """The content of a datasheet.

    Attributes
    ----------
    config : Config
    what : str
        The design in a few words.
    sections : mapping of str to list of str
        Lines by titles; pins come before all.
    pictures : tuple of Picture
    """

    config: Config
    what: str
    sections: Mapping[str, Iterable[str]]
    pictures: tuple[Picture, ...]

    @property
    def top(self) -> str:
        """Name of the module, the first part of its file names."""
        return top_block(self.config).module_name

    def text(self) -> str:
        """Return the Markdown page."""
        head = [f"# {self.top}: {self.what}", ""]
        head += [f"Version {__version__}. Made from this configuration; every number is of it:", ""]
        fields = ((f"`{name}`", f"{value}") for name, value in self.config.to_dict().items())
        sections = {"Pins": _pins(self.config), **self.sections}
        body = (line for title, lines in sections.items() for line in ("", f"## {title}", "", *lines))
        return "\n".join([*head, *markdown(("parameter", "value"), fields), *body]) + "\n"

    def write(self, folder: Path) -> list[Path]:
        """Write page and pictures into a folder; return their paths."""
        texts = {f"{self.top}_datasheet.md": self.text()}
        for shown in self.pictures:
            texts[file_of(self.top, shown.name)] = timing_diagram(shown.waves, shown.title, shown.first)
        for name, text in texts.items():
            with atomic_write(folder / name) as file:
                file.write(text.encode())
        return [folder / name for name in texts]


def file_of(top: str, name: str) -> str:
    """Return the file name of a picture."""
    return f"{top}_{name}.svg"


def shown(top: str, picture: Picture) -> str:
    """Return the Markdown line that shows a picture."""
    return f"![{picture.title}]({file_of(top, picture.name)})"


def time_table(rows: Iterable[tuple[str, int]], clock_hz: float) -> list[str]:
    """Return a Markdown table of latencies in clocks."""
    table = ((what, f"{clocks}", si(clocks / clock_hz, "s")) for what, clocks in rows)
    return markdown(("from, to", "clocks", "time"), table)


def _pins(config: Config) -> list[str]:
    """Return a Markdown table of ports."""
    return markdown(
        ("pin", "direction", "bits", "meaning"),
        ((f"`{port['name']}`", port["direction"], f"{port['width']}", port["meaning"]) for port in ports(config)),
    )


def si(value: float, unit: str) -> str:
    """Return a value as text with SI prefix and unit, to five digits.

    Examples
    --------
    >>> si(781.25e-9, "s"), si(1_280_000, "Hz"), si(0, "W")
    ('781.25 ns', '1.28 MHz', '0 W')
    """
    if not value:
        return f"0 {unit}"
    power = min(max(3 * math.floor(math.log10(abs(value) * (1 + 1e-9)) / 3), -15), 12)
    return f"{value / 10.0**power:.5g} {PREFIXES[power]}{unit}"


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return a Markdown table as lines."""
    head = list(head)
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in [head, *map(list, rows)]]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]
