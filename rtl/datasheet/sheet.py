"""A datasheet as a page of Markdown with its pictures: what those of all designs have in common."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from model import __version__
from model.files import atomic_write
from rtl.datasheet.pictures import timing_diagram
from rtl.datasheet.units import markdown, si
from rtl.datasheet.waves import Wave
from rtl.delivery import ports
from rtl.verilog import Config, top_block

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
    """What a datasheet says.

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
        """Name of the module, which its files begin with."""
        return top_block(self.config).module_name

    def text(self) -> str:
        """Return the page."""
        head = [f"# {self.top}: {self.what}", ""]
        head += [f"Version {__version__}. Made from this configuration; every number is of it:", ""]
        fields = ((f"`{name}`", f"{value}") for name, value in self.config.to_dict().items())
        sections = {"Pins": _pins(self.config), **self.sections}
        body = (line for title, lines in sections.items() for line in ("", f"## {title}", "", *lines))
        return "\n".join([*head, *markdown(("parameter", "value"), fields), *body]) + "\n"

    def write(self, folder: Path) -> list[Path]:
        """Write page and pictures into a folder, each whole or not at all; return their paths."""
        texts = {f"{self.top}_datasheet.md": self.text()}
        for shown in self.pictures:
            texts[file_of(self.top, shown.name)] = timing_diagram(shown.waves, shown.title, shown.first)
        for name, text in texts.items():
            with atomic_write(folder / name) as file:
                file.write(text.encode())
        return [folder / name for name in texts]


def file_of(top: str, name: str) -> str:
    """Return the name of the file of a picture."""
    return f"{top}_{name}.svg"


def shown(top: str, picture: Picture) -> str:
    """Return the line that shows a picture on the page."""
    return f"![{picture.title}]({file_of(top, picture.name)})"


def times(rows: Iterable[tuple[str, int]], clock_hz: float) -> list[str]:
    """Return a table of what takes how many clocks."""
    table = ((what, f"{clocks}", si(clocks / clock_hz, "s")) for what, clocks in rows)
    return markdown(("from, to", "clocks", "time"), table)


def _pins(config: Config) -> list[str]:
    """Return the table of ports."""
    return markdown(
        ("pin", "direction", "bits", "meaning"),
        ((f"`{port['name']}`", port["direction"], f"{port['width']}", port["meaning"]) for port in ports(config)),
    )
