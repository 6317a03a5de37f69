"""Stopping the clock of a block that says it is not awake loses nothing: none of its registers would change.

Asked of every state and all inputs, reachable or not, so one clock is all there is to look at.
"""

from __future__ import annotations

import json
import re
from typing import Any

from eskin.rtl import yosys
from eskin.rtl.block import Block, Netlist

LISTENS = ("link", "host")
"""Names of the parts that are left out: their clock never stops, since they listen to ACK and to SPI."""

TO_FLOPS = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc; flatten; opt_clean; dffunmap; "
    "setattr -unset init w:*; write_json flops.json"
)
TO_ANSWER = (
    "read_json still.json; hierarchy -top {top}; tee -q -o said.txt sat -set rst 0 -set awake {awake} -prove next state"
)
UNSOLVED = re.compile(r"SAT proof finished - (no )?model found")


def stands_still(block: Block[Any], awake: int = 0, mutant: str = "") -> bool:
    """Return whether no register of a block can change in a clock in which it is not awake, resets apart.

    Parameters
    ----------
    block : Block
        One with a signal ``awake``.
    awake : int
        The value of that signal; for 1 the answer tells whether anything can change at all.
    mutant : str
        RTLIL that takes the place of the block's own.
    """
    made = Netlist(async_reset=False)
    made.add(block)
    top = block.module_name
    design = json.loads(yosys.run(TO_FLOPS.format(top=top), mutant or made.text, "flops.json"))
    module = design["modules"][top]
    state, after = [], []
    for name, cell in list(module["cells"].items()):
        if cell["type"] == "$dff":
            del module["cells"][name]
            if not any(f"\\{part}." in name for part in LISTENS):
                state += cell["connections"]["Q"]
                after += cell["connections"]["D"]
        elif "dff" in cell["type"] or cell["type"].startswith("$mem"):
            raise AssertionError(f"{name} of {top} is a {cell['type']}, which is not looked at")
    for name, direction, bits in (("state", "input", state), ("next", "output", after)):
        module["ports"][name] = {"direction": direction, "bits": bits}
        module["netnames"][name] = {"hide_name": 0, "bits": bits, "attributes": {}}
    files = {"still.json": json.dumps({"modules": {top: module}}).encode()}
    found = UNSOLVED.search(yosys.run(TO_ANSWER.format(top=top, awake=awake), "", "said.txt", files))
    if not found or not state:
        raise AssertionError(f"the solver says nothing of {top}, which has {len(state)} registers")
    return bool(found[1])
