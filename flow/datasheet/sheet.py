"""Common parts of all datasheets: Markdown pages from ``templates``, with pictures."""

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from eskin.base.files import atomic_write
from eskin.base.pages import templates
from eskin.base.units import counted
from eskin.model import __version__
from eskin.rtl.delivery import ports
from eskin.rtl.verilog import Config, top_block

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}

RESETS = {
    "sync": "The reset is active high and sampled at the rising edge of `clk`.",
    "async": "The reset is active high and asynchronous at every flop. Assert the reset at any time, and release it "
    "synchronously to `clk`.",
}


class Wave(NamedTuple):
    """A waveform: the value of a signal just before every rising edge, None where undefined."""

    name: str
    values: tuple[int | None, ...]
    bus: bool = False  # a word instead of one bit
    delay: float = 0.0  # clocks from the edge to the change of the signal


class Picture(NamedTuple):
    """A timing diagram."""

    name: str  # part of the file name
    title: str
    waves: list[Wave]
    first: int = 0  # clock of its first column

    def svg(self) -> str:
        """Return the diagram as SVG text."""
        runs = []  # of each wave: first clock, clock after the last, and value of each stretch of equal values
        for wave in self.waves:
            stretches = [(value, len([*group])) for value, group in itertools.groupby(wave.values)]
            ends = [*itertools.accumulate(length for _, length in stretches)]
            runs.append([(end - length, end, value) for end, (value, length) in zip(ends, stretches, strict=True)])
        return PAGES.get_template("timing.svg").render(
            waves=[*zip(self.waves, runs, strict=True)],
            title=self.title,
            first=self.first,
            clocks=len(self.waves[0].values),
        )


@dataclass(frozen=True)
class Sheet:
    """The content of a datasheet."""

    config: Config
    what: str  # the design in a few words
    template: str  # name of the page in ``templates``
    values: Mapping[str, Any]  # values of the page beside those of every datasheet
    pictures: tuple[Picture, ...]
    gated: bool = False  # whether the Verilog has clock gates

    @property
    def top(self) -> str:
        """Name of the module, the first part of its file names."""
        return top_block(self.config).module_name

    def text(self) -> str:
        """Return the Markdown page."""
        pins = list(ports(self.config, self.gated))
        of_all = {
            "config": self.config,
            "top": self.top,
            "what": self.what,
            "version": __version__,
            "reset": RESETS[self.config.reset],
            "pictures": {picture.name: picture for picture in self.pictures},
            "fields": [(f"`{name}`", f"{value}") for name, value in self.config.to_dict().items()],
            "pins": [(f"`{pin['name']}`", pin["direction"], f"{pin['width']}", pin["meaning"]) for pin in pins],
            "names": [pin["name"] for pin in pins],
            "meanings": {pin["name"]: pin["meaning"] for pin in pins},
            "table": table,
            "times": partial(time_table, clock_hz=self.config.clock_hz),
        }
        return PAGES.get_template(self.template).render(of_all | dict(self.values))

    def write(self, folder: Path) -> list[Path]:
        """Write page and pictures into a folder; return their paths."""
        texts = {f"{self.top}_datasheet.md": self.text()}
        texts |= {f"{self.top}_{shown.name}.svg": shown.svg() for shown in self.pictures}
        for name, text in texts.items():
            with atomic_write(folder / name) as file:
                file.write(text.encode())
        return [folder / name for name in texts]


def time_table(rows: Iterable[tuple[str, int]], clock_hz: float) -> str:
    """Return a Markdown table of latencies in clocks."""
    return table("from, to | clocks | time", ((what, f"{clocks}", si(clocks / clock_hz, "s")) for what, clocks in rows))


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


def table(head: str, rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table with titles between `` | ``."""
    titles = head.split(" | ")
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in [titles, *rows]]
    return "\n".join([lines[0], "|" + "---|" * len(titles), *lines[1:]])


PAGES = templates(Path(__file__).parent / "templates")
PAGES.filters |= {
    "si": si,
    "clocks": lambda number: counted(number, "clock"),
    "quoted": lambda names: ", ".join(f"`{name}`" for name in names),
}
