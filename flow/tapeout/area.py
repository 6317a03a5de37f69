"""Map a whole chip to library cells, to estimate its size and to test its netlist."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

from eskin.base.errors import InputError
from eskin.flow.asic.synthesis import ties
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library
from eskin.rtl import yosys

SCRIPT = (
    "read_verilog {sources}; synth -flatten -top {top}; dfflibmap -liberty cells.lib; abc -liberty cells.lib; "
    "opt_clean -purge; read_liberty -lib -ignore_miss_func cells.lib; {ties}splitnets; "
    "rename -enumerate -pattern g% c:*; opt_clean -purge; check -assert -mapped; "
    "write_verilog -noattr -noexpr netlist.v"
)


@dataclass(frozen=True)
class Mapped:
    """A chip as library cells."""

    # netlist, cells: Verilog of netlist and library cells, without delays
    netlist: str = field(repr=False)
    cells: str = field(repr=False)
    area_um2: float  # of the cells alone: no wires, no clock tree, no filling


def mapped(sources: dict[str, str], top: str, library: Library) -> Mapped:
    """Return a chip mapped to library cells, from its Verilog by file name."""
    script = SCRIPT.format(sources=" ".join(sources), top=top, ties=ties(library))
    files = {name: text.encode() for name, text in sources.items()} | {"cells.lib": library.content}
    try:
        netlist = yosys.run(script, "", "netlist.v", files)
    except yosys.YosysError as error:
        raise InputError(f"the cell library {library.path} does not suffice for {top}: {error.reason}") from None
    kinds = Counter(re.findall(r"^  (\w+) \w+ \($", netlist, re.MULTILINE))
    if bare := sorted(kind for kind in kinds if not library.cells[kind].area_um2 > 0):
        raise InputError(f"the cell library {library.path} states no area for {bare[0]}; give --tiles in its place")
    area = sum(library.cells[kind].area_um2 * count for kind, count in kinds.items())
    return Mapped(netlist, models(library, set(kinds)), area)
