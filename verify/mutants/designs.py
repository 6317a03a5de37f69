"""Write the RTLIL of configurations that use a mutated file (runs in a copy of the checkout)."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from eskin.rtl.block import RtlilModules
from eskin.rtl.verilog import top_block
from eskin.verify.mutants.configs import configs


def designs(file: str, seed: int, count: int) -> dict[str, dict[str, str]]:
    """Return the RTLIL of all modules by configuration and name; empty if the generator raises an error.

    Parameters
    ----------
    file : str
        ``rtl/registers/decay.py``.
    seed : int
        Of the configurations.
    count : int
        Number of configurations.
    """
    found: dict[str, dict[str, str]] = {}
    for config in configs(file, seed)[:count]:
        made = RtlilModules(config.reset == "async")
        try:
            made.add(top_block(config))
        except Exception:  # a mutant may raise anything
            made.modules = {}
        found[f"{type(config).__name__} {config.to_dict()}"] = made.modules
    return found


if __name__ == "__main__":
    file, seed, count, out = sys.argv[1:]
    Path(out).write_text(json.dumps(designs(file, int(seed), int(count))))
