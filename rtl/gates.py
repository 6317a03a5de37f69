"""Gates and flops of the readouts, counted after synthesis, to compare what they cost in silicon."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

from model.errors import InputError
from rtl.block import Netlist
from rtl.verilog import Config, run_yosys, top_block

GENERIC = "abc -g AND,OR,XOR,MUX"
"""Without a library: two-input gates, multiplexers and inverters, each counted as one."""


@dataclass(frozen=True)
class Gates:
    """What a readout is made of.

    Attributes
    ----------
    flops, gates : int
        Flip-flops, and combinational cells, of the whole array.
    taxels : int
        Taxels of the array.
    area_um2 : float or None
        Cell area, with a liberty file; no wires, no clock tree.
    """

    flops: int
    gates: int
    taxels: int
    area_um2: float | None

    def to_dict(self) -> dict[str, float | None]:
        """Return the numbers, those per taxel too."""
        area = self.area_um2
        return {
            "flops": self.flops,
            "gates": self.gates,
            "flops_per_taxel": self.flops / self.taxels,
            "gates_per_taxel": self.gates / self.taxels,
            "area_um2": area,
            "area_um2_per_taxel": None if area is None else area / self.taxels,
        }


def count_gates(config: Config, taxels: int, liberty: Path | None = None) -> Gates:
    """Synthesise a readout with Yosys and count its cells.

    Parameters
    ----------
    config : ReadoutConfig or FrameConfig
    taxels : int
        Taxels of its array.
    liberty : Path, optional
        Cell library; without one, generic two-input gates are counted.

    Raises
    ------
    InputError
        If the library cannot be read or is no liberty file.
    """
    netlist = Netlist(config.reset == "async")
    top = top_block(config)
    netlist.add(top)
    files = {} if liberty is None else {"cells.lib": _liberty(liberty)}
    library = " -liberty cells.lib" if files else ""
    mapping = "dfflibmap -liberty cells.lib; abc -liberty cells.lib" if files else GENERIC
    script = (
        f"read_rtlil readout.il; synth -top {top.module_name}; {mapping}; opt_clean -purge; "
        f"tee -q -o stat.json stat -json{library}"
    )
    text = run_yosys(script, "\n".join(netlist.modules.values()), "stat.json", files)
    design = json.loads(text[text.index("{") :])["design"]
    cells: dict[str, int] = design["num_cells_by_type"]
    flops = sum(number for kind, number in cells.items() if re.search(r"dff|_DFF|_SDFF|dfr|dfb", kind, re.IGNORECASE))
    modules = sum(number for kind, number in cells.items() if kind.startswith("eskin_"))
    area = float(design["area"]) if liberty is not None else None
    return Gates(flops, sum(cells.values()) - flops - modules, taxels, area)


def _liberty(path: Path) -> bytes:
    """Return the content of a liberty file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the cell library {path}: {error.strerror}") from None
    if not re.search(rb"^\s*library\s*\(", content, re.MULTILINE):
        raise InputError(f"{path} is no liberty file: it has no library(...); give a .lib")
    return content
