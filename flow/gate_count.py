"""Count gates and flops of the readouts after synthesis."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

from eskin.base.errors import InputError
from eskin.flow.liberty.library import read
from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl import yosys
from eskin.rtl.verilog import Config, rtlil, top_block

GENERIC = "abc -g AND,OR,XOR,MUX"
"""Cells of a count without a library: two-input gates, multiplexers and inverters, each counted as one."""

MEMORIES = "eskin_input_weights eskin_recurrent_weights eskin_neuron_weights"
PARAMETERS = "eskin_neuron_parameters"
"""Modules of the classifier that are memory macros, and that the count leaves out."""

GENERIC_FLOP = re.compile(r"\$_S?DFF\w*_")
"""Names of flip-flops that Yosys uses without a library."""


@dataclass(frozen=True)
class Gates:
    """Cell counts of a readout."""

    # flops, gates: flip-flops, and combinational cells, of the whole array
    flops: int
    gates: int
    taxels: int
    area_um2: float | None  # cell area, with a liberty file; no wires, no clock tree

    def to_dict(self) -> dict[str, float | None]:
        """Return the counts, in total and per taxel, as a dictionary."""
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
    """Return the cell counts of a readout synthesised with Yosys, without the weight memories of a classifier.

    Without a cell library, generic two-input gates are counted. A classifier has 1 taxel.
    """
    library = None if liberty is None else read(liberty)
    files = {} if library is None else {"cells.lib": library.content}
    option = "" if library is None else " -liberty cells.lib"
    mapping = GENERIC if library is None else f"dfflibmap{option}; abc{option}"
    outside = ""
    if isinstance(config, ClassifierConfig):
        outside = f"blackbox {MEMORIES}{f' {PARAMETERS}' if config.own_parameters else ''}; "
    script = (
        f"read_rtlil readout.il; {outside}"
        f"synth -top {top_block(config).module_name}; {mapping}; opt_clean -purge; "
        f"tee -q -o stat.json stat -json{option}"
    )
    try:
        text = yosys.run(script, rtlil(config), "stat.json", files)
    except yosys.YosysError as error:
        if library is None:
            raise
        library.check()
        raise InputError(
            f"the cell library {library.path} lacks cells: the readout needs a flip-flop, an inverter, a buffer, and a "
            f"NAND or NOR (Yosys: {error.reason})"
        ) from None
    design = json.loads(text[text.index("{") :])["design"]
    cells: dict[str, int] = design["num_cells_by_type"]
    flop = GENERIC_FLOP.fullmatch if library is None else library.flops.__contains__
    flops = sum(number for kind, number in cells.items() if flop(kind))
    modules = sum(number for kind, number in cells.items() if kind.startswith("eskin_"))
    area = float(design["area"]) if liberty is not None else None
    return Gates(flops, sum(cells.values()) - flops - modules, taxels, area)
