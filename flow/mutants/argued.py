"""Mutants that no test can notice, for a reason that a person wrote: counted apart from those that are proved."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from cocotb_tests.session.store import ROOT
from flow.mutants.judge import Finding
from model.errors import InputError

PATH = Path(__file__).parent / "argued.toml"


@cache
def arguments() -> dict[tuple[str, str, str], str]:
    """Return why a mutant does what the original does, by file, line without its blanks, and edit.

    Raises
    ------
    InputError
        If a line stands in its file no more: who changed it must look at the argument again.
    """
    found = {}
    for entry in tomllib.loads(PATH.read_text()).get("argued", []):
        path = ROOT / entry["file"]
        if not any(line.strip() == entry["line"] for line in path.read_text().splitlines()):
            raise InputError(
                f"{entry['line']!r} of {PATH.name} is not in {entry['file']}; take the entry out, or mend it"
            )
        found[entry["file"], entry["line"], entry["edit"]] = entry["why"]
    return found


def argue(findings: Iterable[Finding]) -> None:
    """Give those that are alive the argument that stands for them, if one does."""
    for finding in findings:
        place, _, edit = finding.name.partition(": ")
        file, _, number = place.rpartition(":")
        if not file.startswith(("model/", "snn/")):
            file = f"rtl/{file}"
        if finding.verdict == "alive":
            line = (ROOT / file).read_text().splitlines()[int(number) - 1].strip()
            if why := arguments().get((file, line, edit)):
                finding.verdict, finding.why = "argued", why
