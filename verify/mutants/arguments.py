"""Read written arguments that a mutant cannot be noticed; they are counted separately from proofs."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

PATH = Path(__file__).with_suffix(".toml")


@cache
def arguments() -> dict[str, str]:
    """Return the arguments by the names of the mutants (``Mutant.name``); the tests check that all of these exist."""
    listed = tomllib.loads(PATH.read_text())
    return {f"{file} {construct}": why for file, own in listed.items() for construct, why in own.items()}
