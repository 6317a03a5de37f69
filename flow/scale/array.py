"""Model of an array as cells: one synthesised taxel, replicated, and the logic around it."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from eskin.flow.asic.synthesis import mapped
from eskin.flow.liberty.library import Cell, Library
from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block
from eskin.rtl.gates.clock_gates import TEST
from eskin.rtl.verilog import top_block

TAXEL = "eskin_taxel"
TREES = ("clk", "rst", TEST)
"""Ports with nets that layout buffers as trees."""

NONE = -1
"""Net of a pin on a constant."""


class End(NamedTuple):
    """Endpoint of a top-level net."""

    what: str  # ``cell``, ``taxel`` or ``port``
    number: int  # index of the cell, taxel or port
    pin: str  # pin of the cell, or port and bit of the taxel
    load_f: float
    pins: int  # pins that the endpoint stands for, with those inside the taxel that read its output


@dataclass
class Array:
    """A readout as cells, with one cell list shared by all taxels."""

    config: ReadoutConfig
    kinds: dict[str, Cell]  # used library cells, and the repeaters
    # names, cells, pins: name, kind and nets of the pins of every cell that stands in no taxel
    names: list[str]
    cells: list[str]
    pins: list[dict[str, int]]
    taxel: dict[str, Any]  # Yosys module of a taxel
    taxel_bits: dict[str, tuple[str, Any]]  # direction and inner net of every port bit
    taxels: list[dict[str, int]]  # net of every port bit, by taxel
    ports: list[tuple[str, str, int, int]]  # direction, name, bit and net of every port bit of the top
    nets: int
    port_load_f: float = field(default=0.05e-12)

    def area_um2(self) -> float:
        """Return the total cell area."""
        return sum(self.kinds[c].area_um2 for c in self.cells) + len(self.taxels) * self.taxel_area_um2

    @property
    def taxel_area_um2(self) -> float:
        """Cell area of one taxel."""
        return sum(self.kinds[c["type"]].area_um2 for c in self.taxel["cells"].values())

    def copy(self) -> Array:
        """Return an array with independent copies of cells, pins and ports."""
        return dataclasses.replace(
            self,
            names=[*self.names],
            cells=[*self.cells],
            pins=[dict(pins) for pins in self.pins],
            taxels=[dict(taxel) for taxel in self.taxels],
            ports=[*self.ports],
        )

    def add(self, name: str, kind: str, pins: dict[str, int]) -> int:
        """Add a cell and return its index."""
        self.names.append(name)
        self.cells.append(kind)
        self.pins.append(pins)
        return len(self.cells) - 1

    def new_net(self) -> int:
        """Return the number of an unused net."""
        self.nets += 1
        return self.nets - 1

    def move(self, end: End, net: int) -> None:
        """Connect an endpoint to another net."""
        if end.what == "cell":
            self.pins[end.number][end.pin] = net
        elif end.what == "taxel":
            self.taxels[end.number][end.pin] = net
        else:
            way, name, bit, _ = self.ports[end.number]
            self.ports[end.number] = way, name, bit, net

    def trees(self) -> set[int]:
        """Return the top-level nets that layout buffers as trees: clocks, reset and test enable."""
        found = {net for _, name, _, net in self.ports if name in TREES}
        found |= {pins[k.launch] for c, pins in zip(self.cells, self.pins, strict=True) if (k := self.kinds[c]).launch}
        return found | {taxel["clk 0"] for taxel in self.taxels}

    def ends(self) -> tuple[dict[int, End], dict[int, list[End]]]:
        """Return the driver and the readers of every top-level net."""
        drivers: dict[int, End] = {}
        readers: dict[int, list[End]] = defaultdict(list)
        for index, (name, pins) in enumerate(zip(self.cells, self.pins, strict=True)):
            kind = self.kinds[name]
            for pin, net in pins.items():
                if pin in kind.outputs:
                    drivers[net] = End("cell", index, pin, 0.0, 0)
                elif net != NONE:
                    readers[net].append(End("cell", index, pin, kind.loads.get(pin, 0.0), 1))
        inside = {bit: self._inside(bit) for bit in self.taxel_bits}
        for index, taxel in enumerate(self.taxels):
            for bit, net in taxel.items():
                if self.taxel_bits[bit][0] == "output":
                    drivers[net] = End("taxel", index, bit, *inside[bit])
                elif net != NONE:
                    readers[net].append(End("taxel", index, bit, *inside[bit]))
        for index, (way, _, _, net) in enumerate(self.ports):
            if way == "input":
                drivers[net] = End("port", index, "", 0.0, 0)
            elif net != NONE:
                readers[net].append(End("port", index, "", self.port_load_f, 1))
        return drivers, readers

    def _inside(self, bit: str) -> tuple[float, int]:
        """Return load and number of the pins in a taxel that read a given port bit."""
        own = self.taxel_bits[bit][1]
        loads = [
            self.kinds[cell["type"]].loads[pin]
            for cell in self.taxel["cells"].values()
            for pin, bits in cell["connections"].items()
            if bits == [own] and pin in self.kinds[cell["type"]].loads
        ]
        return sum(loads), len(loads)

    def driving_cell(self, end: End) -> str:
        """Return the kind of the cell that drives a net from a given endpoint."""
        if end.what == "cell":
            return self.cells[end.number]
        own = self.taxel_bits[end.pin][1] if end.what == "taxel" else None
        for cell in self.taxel["cells"].values() if end.what == "taxel" else ():
            for pin, bits in cell["connections"].items():
                if bits == [own] and pin in self.kinds[cell["type"]].outputs:
                    return str(cell["type"])
        return self.port_buffer

    @property
    def port_buffer(self) -> str:
        """Kind of the buffer at the input ports, of medium size."""
        buffers = repeaters(self.kinds)
        return buffers[len(buffers) // 2].name


def repeaters(kinds: dict[str, Cell]) -> list[Cell]:
    """Return the buffers from smallest to largest."""
    single = [kind for kind in kinds.values() if len(kind.loads) == len(kind.outputs) == 1 and not kind.launch]
    found = [kind for kind in single if kind.ways and all(i == o for arc in kind.ways for i, o in arc.edges)]
    return sorted(found, key=lambda kind: kind.area_um2)


def build(config: ReadoutConfig, library: Library) -> Array:
    """Return an array as library cells, without repeaters."""
    return as_cells(top_block(config), config, library, [TAXEL])


def as_cells(block: Block[Any], config: ReadoutConfig, library: Library, apart: Sequence[str] = ()) -> Array:
    """Return a block as library cells, without repeaters; its taxels, if it has any, stay ``apart``."""
    design = mapped(block, library, apart)
    top = design["modules"][block.module_name]
    taxel = design["modules"].get(TAXEL, {"ports": {}, "cells": {}})
    used = {cell["type"] for module in (top, taxel) for cell in module["cells"].values()} - {TAXEL}
    used |= {cell.name for cell in library.buffers}
    groups = [port["bits"] for port in top["ports"].values()]
    groups += [bits for cell in top["cells"].values() for bits in cell["connections"].values()]
    bits = sorted({bit for group in groups for bit in group if isinstance(bit, int)})
    numbers = {bit: number for number, bit in enumerate(bits)}
    plain = {n: c for n, c in top["cells"].items() if c["type"] != TAXEL}
    places = [f"row_{row}.taxel_{column}" for row in range(config.rows) for column in range(config.columns)]
    return Array(
        config=config,
        kinds={cell.name: cell for cell in library.used(used)},
        names=list(plain),
        cells=[cell["type"] for cell in plain.values()],
        pins=[{p: numbers.get(b[0], NONE) for p, b in cell["connections"].items() if b} for cell in plain.values()],
        taxel=taxel,
        taxel_bits={
            f"{name} {i}": (port["direction"], bit)
            for name, port in taxel["ports"].items()
            for i, bit in enumerate(port["bits"])
        },
        taxels=[
            {
                f"{port} {i}": numbers.get(bit, NONE)
                for port, own in top["cells"][place]["connections"].items()
                for i, bit in enumerate(own)
            }
            for place in (places if apart else ())
        ],
        ports=[
            (port["direction"], name, i, numbers.get(bit, NONE))
            for name, port in top["ports"].items()
            for i, bit in enumerate(port["bits"])
        ],
        nets=len(numbers),
    )
