"""A cell library as the flow needs it: cells are found by what they are in the liberty file, never by their names."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.errors import InputError

if TYPE_CHECKING:
    from liberty.types import Group

UNIT = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3}

PACKAGE = "liberty-parser is not installed; install it with: pip install -c constraints.txt -e '.[asic]'"


@dataclass(frozen=True)
class Flop:
    """A flip-flop or latch with one data pin.

    Attributes
    ----------
    clock, data : str
        Pins: the clock or a latch's enable, and what is stored.
    outputs : dict of str to bool
        Output pins; True where inverted.
    rising : bool
        It takes data at the rising edge; a latch is open while its enable is high.
    clear, preset : str
        Pins that reset it to 0 and to 1; empty where it has none.
    """

    clock: str
    data: str
    outputs: dict[str, bool]
    rising: bool
    clear: str
    preset: str


@dataclass(frozen=True)
class ClockGate:
    """An integrated clock gate: pins of clock, enable and gated clock, and of test enable where it has one."""

    clock: str
    enable: str
    gated: str
    test: str


@dataclass(frozen=True)
class Cell:
    """A cell of a library.

    Attributes
    ----------
    name : str
    area_um2, leakage_w : float
    inputs : dict of str to float
        Capacitance of every input pin in farad.
    functions : dict of str to str
        Boolean function of every output pin that has one, as the liberty file writes it.
    flop, latch : Flop or None
    gate : ClockGate or None
    dont_use : bool
    """

    name: str
    area_um2: float
    leakage_w: float
    inputs: dict[str, float]
    functions: dict[str, str]
    flop: Flop | None = None
    latch: Flop | None = None
    gate: ClockGate | None = None
    dont_use: bool = False

    def drives(self, function: str) -> str:
        """Return the output pin of a cell of one output with a function, or an empty text."""
        found = [pin for pin, text in self.functions.items() if _plain(text) == function]
        return found[0] if found and len(self.functions) == 1 else ""


@dataclass(frozen=True)
class Library:
    """A cell library at one corner.

    Attributes
    ----------
    path : Path
    name : str
        Of the library, as its file says.
    process, voltage_v, temperature_c : float
        The corner.
    cells : dict of str to Cell
    units : dict of str to float
        Of ``time`` in s, ``capacitance`` in F, ``leakage`` in W, ``voltage`` in V.
    """

    path: Path
    name: str
    process: float
    voltage_v: float
    temperature_c: float
    cells: dict[str, Cell] = field(repr=False)
    units: dict[str, float] = field(repr=False)

    @property
    def flops(self) -> frozenset[str]:
        """Names of the flip-flops."""
        return frozenset(name for name, cell in self.cells.items() if cell.flop)

    @property
    def latches(self) -> frozenset[str]:
        """Names of the latches, clock gates apart."""
        return frozenset(name for name, cell in self.cells.items() if cell.latch)

    @property
    def clock_gate(self) -> Cell | None:
        """The smallest integrated clock gate for rising edges, one with a test enable if there is any."""
        gates = [cell for cell in self.cells.values() if cell.gate]
        return min(gates, key=lambda cell: (not (cell.gate and cell.gate.test), cell.area_um2), default=None)

    @property
    def gate_latch(self) -> Cell | None:
        """The smallest latch that a clock gate can be built with: no clear, no preset."""
        plain = [c for c in self.cells.values() if c.latch and not (c.latch.clear or c.latch.preset)]
        return min(plain, key=lambda cell: (cell.latch.rising if cell.latch else True, cell.area_um2), default=None)

    def tie(self, level: int) -> tuple[str, str] | None:
        """Return cell and pin of a constant 0 or 1, None where the library has none."""
        return self._smallest(str(level))

    @property
    def buffers(self) -> list[Cell]:
        """Buffers from the smallest to the largest."""
        found = [
            c for c in self.cells.values() if len(c.inputs) == 1 and not c.dont_use and c.drives(next(iter(c.inputs)))
        ]
        return sorted(found, key=lambda cell: cell.area_um2)

    def _smallest(self, function: str) -> tuple[str, str] | None:
        found = [(c.area_um2, c.name, c.drives(function)) for c in self.cells.values() if c.drives(function)]
        return min(found)[1:] if found else None


def text_of(value: Any) -> str:
    """Return a value of the parser as text without quotes: the first of several, empty where it is absent."""
    if isinstance(value, list):
        value = value[0] if value else None
    return "" if value is None else str(getattr(value, "value", value)).strip('"').strip()


def number_of(value: Any, default: float = 0.0) -> float:
    """Return a value of the parser as a number."""
    return default if value is None else float(text_of(value))


def _plain(function: str) -> str:
    """Return a Boolean function of one literal without blanks and brackets."""
    return function.replace(" ", "").strip("()")


@functools.lru_cache(maxsize=8)
def parse(path: Path) -> Group:
    """Return the groups of a liberty file, parsed once in a process.

    Raises
    ------
    InputError
        If the file cannot be read or is no whole liberty file.
    """
    try:
        from liberty.parser import parse_liberty
    except ModuleNotFoundError:
        raise InputError(PACKAGE) from None
    try:
        text = path.read_text(errors="replace")
    except OSError as error:
        raise InputError(f"cannot read the cell library {path}: {error.strerror}") from None
    try:
        group = parse_liberty(text)
    except Exception as error:  # a broken file makes the parser raise any of a dozen types
        raise InputError(f"{path} is no liberty file that can be read: {_first_line(error)}; give a .lib") from None
    if group is None or group.group_name != "library":
        raise InputError(f"{path} is no liberty file: it has no library(...); give a .lib")
    return group


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".,;:") if lines else type(error).__name__


def read(path: Path) -> Library:
    """Return the library of a liberty file.

    Raises
    ------
    InputError
        If it cannot be read, or has no corner, no flip-flop or no logic gate.
    """
    group = parse(path)
    units = _units(group)
    cells = {cell.name: cell for cell in (_cell(g, units) for g in group.get_groups("cell"))}
    process, voltage, temperature_c = _corner(group, path)
    library = Library(
        path,
        text_of(group.args[0]) if group.args else path.stem,
        process,
        voltage * units["voltage"],
        temperature_c,
        cells,
        units,
    )
    if not library.flops:
        raise InputError(f"the cell library {path} has no flip-flop: no cell of it has an ff group; give another .lib")
    if not any(len(cell.inputs) > 1 and cell.functions and not (cell.flop or cell.latch) for cell in cells.values()):
        raise InputError(f"the cell library {path} has no logic gate: no cell of it has a function; give another .lib")
    return library


def _corner(group: Group, path: Path) -> tuple[float, float, float]:
    """Return process, voltage and temperature of a library, as it writes them."""
    named = text_of(group.get_attributes("default_operating_conditions")[:1] or "")
    conditions = group.get_groups("operating_conditions")
    chosen = [g for g in conditions if g.args and text_of(g.args[0]) == named] or conditions[:1]
    found = []
    for name in ("process", "voltage", "temperature"):
        values = group.get_attributes(f"nom_{name}") or [v for g in chosen for v in g.get_attributes(name)]
        if not values and name != "process":
            raise InputError(
                f"the cell library {path} has no corner: neither nom_{name} nor operating_conditions; give another .lib"
            )
        found.append(float(values[0]) if values else 1.0)
    return found[0], found[1], found[2]


def _units(group: Group) -> dict[str, float]:
    """Return the units of a library, those of the liberty standard where the file has none."""
    load = next(iter(group.get_attributes("capacitive_load_unit")), [1.0, "pf"])
    return {
        "time": _unit(group, "time_unit", "1ns"),
        "capacitance": float(number_of(load[0])) * UNIT[text_of(load[1])[:-1].lower()],
        "leakage": _unit(group, "leakage_power_unit", "1nW"),
        "voltage": _unit(group, "voltage_unit", "1V"),
    }


def _unit(group: Group, name: str, default: str) -> float:
    """Return a unit such as ``10ps`` as a number."""
    text = text_of(next(iter(group.get_attributes(name)), default))
    digits = len(text) - len(text.lstrip("0123456789."))
    return float(text[:digits] or 1) * UNIT[text[digits:-1]]


def _cell(group: Group, units: dict[str, float]) -> Cell:
    """Return one cell of a library."""
    inputs, functions = {}, {}
    marks: dict[str, str] = {}
    for pin in group.get_groups("pin"):
        name = text_of(pin.args[0])
        direction = text_of(pin.get_attribute("direction", ""))
        if direction == "input":
            inputs[name] = float(pin.get_attribute("capacitance", 0.0)) * units["capacitance"]
        elif function := text_of(pin.get_attribute("function", "")):
            functions[name] = function
        for mark in ("clock", "enable", "out", "test"):
            if text_of(pin.get_attribute(f"clock_gate_{mark}_pin", "false")) == "true":
                marks[mark] = name
    kind = text_of(group.get_attribute("clock_gating_integrated_cell", ""))
    gate = None
    if kind.startswith("latch_posedge") and {"clock", "enable", "out"} <= set(marks) and "obs" not in kind:
        gate = ClockGate(marks["clock"], marks["enable"], marks["out"], marks.get("test", ""))
    return Cell(
        name=text_of(group.args[0]),
        area_um2=float(group.get_attribute("area", 0.0)),
        leakage_w=float(group.get_attribute("cell_leakage_power", 0.0)) * units["leakage"],
        inputs=inputs,
        functions=functions,
        flop=_memory(group.get_groups("ff"), "clocked_on", "next_state", functions),
        latch=_memory(group.get_groups("latch"), "enable", "data_in", functions) if not kind else None,
        gate=gate,
        dont_use=text_of(group.get_attribute("dont_use", "false")) == "true",
    )


def _memory(groups: Iterable[Any], clock: str, data: str, functions: dict[str, str]) -> Flop | None:
    """Return what an ff or latch group says."""
    for group in groups:
        state, inverse = text_of(group.args[0]), text_of(group.args[1])
        on = _plain(text_of(group.get_attribute(clock, "")))
        wanted = {state: False, inverse: True, f"!{state}": True, f"!{inverse}": False}
        return Flop(
            clock=on.strip("!'"),
            data=_plain(text_of(group.get_attribute(data, ""))),
            outputs={pin: wanted[_plain(text)] for pin, text in functions.items() if _plain(text) in wanted},
            rising="!" not in on and "'" not in on,
            clear=_plain(text_of(group.get_attribute("clear", ""))),
            preset=_plain(text_of(group.get_attribute("preset", ""))),
        )
    return None
