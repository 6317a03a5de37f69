"""Read the written arguments that certain mutants are equivalent."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

PATH = Path(__file__).with_suffix(".toml")


@cache
def arguments() -> dict[str, str]:
    """Return the written arguments by the name of the mutant."""
    listed = tomllib.loads(PATH.read_text())
    return {f"{file} {construct}": why for file, own in listed.items() for construct, why in own.items()}
