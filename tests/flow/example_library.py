"""Quill, an example cell library for tests with few cells and unusual names."""

from pathlib import Path
from typing import NamedTuple

from eskin.base.pages import templates


class Corner(NamedTuple):
    """Corner of the library: supply, temperature, and factors of delays and leakage."""

    name: str
    voltage_v: float
    temperature_c: float
    delay: float
    leakage: float


TYPICAL = Corner("quill_typ", 1.2, 25, 1.0, 1.0)
SLOW = Corner("quill_slow", 1.08, 125, 1.6, 5.0)
FAST = Corner("quill_fast", 1.32, -40, 0.7, 0.5)

LOGIC = {
    "HOOT": ("!A", "negative_unate", 2),
    "ECHO": ("A", "positive_unate", 3),
    "NEITHER": ("!(A + B)", "negative_unate", 3),
    "UNLESS": ("!(A B)", "negative_unate", 3),
    "DIFFER": ("(A & !B) | (!A & B)", "non_unate", 6),
}
"""Function, sense and area in um2; the functions are written in each of the ways that liberty knows."""


def library(corner: Corner = TYPICAL, without: tuple[str, ...] = ()) -> str:
    """Return the text of the Liberty file.

    ``without``: names of cells that are left out.
    """
    grid = {"slews": (0.02, 0.5), "loads": (0.001, 0.1), "edges": ("rise", "fall")}
    page = templates(Path(__file__).parent).get_template("quill.lib")
    return page.render(corner._asdict() | grid, logic=LOGIC, without=without)


def written(folder: Path, corner: Corner = TYPICAL, without: tuple[str, ...] = ()) -> Path:
    """Write the library into a folder and return the path of its file."""
    path = folder / f"{corner.name}.lib"
    path.write_text(library(corner, without))
    return path
