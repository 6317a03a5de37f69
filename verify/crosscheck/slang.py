"""Check the delivered Verilog with slang, a strict SystemVerilog front end."""

from __future__ import annotations

import re
from collections.abc import Mapping

from eskin.rtl.text.slang import compilation, top_of

WAIVED = {
    "sign-conversion": "registers are signed where numbers are; vectors that are only handed on are not",
    "arith-op-mismatch": "likewise: widths are equal, which lint of another kind holds",
    "width-expand": "a narrower operand is extended as Verilog defines it",
    "bitwise-op-mismatch": "likewise",
    "sign-compare": "an unsigned bit pattern that stands for a signed constant of the same width",
    "case-overlap": "each condition of a case compares one state: at most one of them holds",
    "case-too-complex": "a case that slang does not look through to the end",
    "unused-port": "a checker shows all ports of what it watches",
}
"""Waived warnings, each with the reason why the code is intended."""

SAID = re.compile(r"^(\S+:\d+:\d+: (?:error|warning): .*?)(?: \[-W([\w-]+)\])?$", re.MULTILINE)


def problems(texts: Mapping[str, str], top: str) -> list[str]:
    """Return slang's messages about a design, without waived ones."""
    design, sources = compilation(texts, top)
    from pyslang import DiagnosticEngine

    said = DiagnosticEngine.reportAll(sources, design.getAllDiagnostics())
    found = [what for what, flag in SAID.findall(said) if flag not in WAIVED]
    if top_of(design, top) is None:
        found.append(f"no module {top}")
    return found
