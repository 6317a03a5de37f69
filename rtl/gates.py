"""Gates and flops of the readouts, counted after synthesis, to compare what they cost in silicon."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

from model.classifier.config import ClassifierConfig
from model.errors import InputError
from rtl import yosys
from rtl.verilog import Config, rtlil, top_block

GENERIC = "abc -g AND,OR,XOR,MUX"
"""Without a library: two-input gates, multiplexers and inverters, each counted as one."""

MEMORIES = "eskin_weights eskin_neuron_weights"
"""Modules of the classifier that are macros: they are left out of what is counted."""

GENERIC_FLOP = re.compile(r"\$_S?DFF\w*_")
"""Yosys' own flip-flops, as it names them without a library."""


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


@dataclass(frozen=True)
class Liberty:
    """A cell library.

    Attributes
    ----------
    path : Path
    content : bytes
        Of the file.
    cells, flops : frozenset of str
        Names of all cells, and of those with an ``ff`` or ``ff_bank`` group.
    open_groups : int
        Groups that the file does not close; 0 in a whole one.
    """

    path: Path
    content: bytes
    cells: frozenset[str]
    flops: frozenset[str]
    open_groups: int

    @classmethod
    def read(cls, path: Path) -> Liberty:
        """Return the library of a file, or raise InputError if it cannot be read or is none."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"cannot read the cell library {path}: {error.strerror}") from None
        text = re.sub(r"/\*.*?(\*/|\Z)", " ", content.decode(errors="replace"), flags=re.DOTALL)
        if not re.search(r"^\s*library\s*\(", text, re.MULTILINE):
            raise InputError(f"{path} is no liberty file: it has no library(...); give a .lib")
        cells, flops = set(), set()
        cell = ""
        for kind, name in re.findall(r"\b(cell|ff|ff_bank)\s*\(\s*\"?([^\s\",)]*)", text):
            if kind == "cell":
                cell = name
                cells.add(cell)
            elif cell:
                flops.add(cell)
        bare = re.sub(r'"[^"]*"', "", text)
        return cls(path, content, frozenset(cells), frozenset(flops), bare.count("{") - bare.count("}"))

    @property
    def defect(self) -> str:
        """What makes the library unusable, as half a sentence; empty where nothing is known."""
        if self.open_groups > 0:
            return "is truncated: it does not close all its groups"
        if not self.cells:
            return "has no cell"
        if not self.flops:
            return "has no flip-flop: no cell of it has an ff group"
        return ""


def count_gates(config: Config, taxels: int, liberty: Path | None = None) -> Gates:
    """Synthesise a readout with Yosys and count its cells.

    Parameters
    ----------
    config : ReadoutConfig, FrameConfig or ClassifierConfig
        Of a classifier the memories of weights are left out.
    taxels : int
        Taxels of its array; 1 for a classifier.
    liberty : Path, optional
        Cell library; without one, generic two-input gates are counted.

    Raises
    ------
    InputError
        If the library cannot be read, is no liberty file, or Yosys cannot map the readout to its cells.
    """
    library = None if liberty is None else Liberty.read(liberty)
    text = _statistics(config, library)
    design = json.loads(text[text.index("{") :])["design"]
    cells: dict[str, int] = design["num_cells_by_type"]
    flop = GENERIC_FLOP.fullmatch if library is None else library.flops.__contains__
    flops = sum(number for kind, number in cells.items() if flop(kind))
    modules = sum(number for kind, number in cells.items() if kind.startswith("eskin_"))
    area = float(design["area"]) if liberty is not None else None
    return Gates(flops, sum(cells.values()) - flops - modules, taxels, area)


def _statistics(config: Config, library: Liberty | None) -> str:
    """Return what Yosys says of the cells of a readout, JSON after a line or none of text."""
    files = {} if library is None else {"cells.lib": library.content}
    option = "" if library is None else " -liberty cells.lib"
    mapping = GENERIC if library is None else f"dfflibmap{option}; abc{option}"
    script = (
        f"read_rtlil readout.il; {f'blackbox {MEMORIES}; ' if isinstance(config, ClassifierConfig) else ''}"
        f"synth -top {top_block(config).module_name}; {mapping}; opt_clean -purge; "
        f"tee -q -o stat.json stat -json{option}"
    )
    try:
        return yosys.run(script, rtlil(config), "stat.json", files)
    except yosys.YosysError as error:
        if library is None:
            raise
        what = library.defect or "does not do; it needs a flip-flop, an inverter, a buffer and a NAND or NOR"
        raise InputError(f"the cell library {library.path} {what} (Yosys: {error.reason})") from None
