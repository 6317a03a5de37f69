"""Check a readout with a third simulator (CXXRTL) and a second SystemVerilog front end (slang)."""

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.stimuli import scenarios, settled
from eskin.cocotb_tests.bench.textures import scan
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import first_difference
from eskin.model.frame_config import FrameConfig
from eskin.model.readout import simulate
from eskin.rtl.text.slang import compilation, top_of
from eskin.rtl.verilog import top_block, verilog
from eskin.skin.textures.dataset import embedded_dataset
from eskin.verify.crosscheck import cxxrtl
from eskin.verify.proofs.bind import properties

WAIVED = {
    "sign-conversion": "a register of a number is signed; a vector that only passes bits on is unsigned",
    "arith-op-mismatch": "likewise; another lint checks that the widths are equal",
    "width-expand": "a narrower operand is extended as Verilog defines it",
    "bitwise-op-mismatch": "likewise",
    "sign-compare": "an unsigned bit pattern that stands for a signed constant of the same width",
    "case-overlap": "each condition of a case compares one state: at most one of them holds",
    "case-too-complex": "a case that slang does not look through to the end",
    "unused-port": "a checker has a port for every port of its block",
}
"""Waived warnings, each with the reason why the code is intended."""

SAID = re.compile(r"^(\S+:\d+:\d+: (?:error|warning): .*?)(?: \[-W([\w-]+)\])?$", re.MULTILINE)


class Mismatch(AssertionError):
    """Raised if CXXRTL and model differ, with the first difference."""


def play(config: ReadoutConfig, texture: int = 0, ticks: int | None = None, text: str = "") -> dict[str, int]:
    """Simulate scenarios and a texture scan in CXXRTL, and compare every event with the golden model.

    Return the numbers of runs, clocks and events, and the events of the texture. The configuration has the digital
    front end and the stream link; ``text`` is Verilog to play instead of its own. Mismatch is raised at the first event
    that differs, and where the texture gives none.
    """
    if texture >= (most := len(embedded_dataset())):
        raise InputError(f"--texture must be in 0..{most - 1}, not {texture}")
    samples = scan(config.rows, config.columns, config.sample_bits, texture)[:ticks]
    runs = {f"scan of texture {texture}": settled(config, samples)}
    runs |= {scenario.name: scenario.stimulus for scenario in scenarios(config, seed=0)}
    counts = []
    with tempfile.TemporaryDirectory() as folder:
        program = cxxrtl.build(config, text or verilog(config), Path(folder))
        for name, stimulus in runs.items():
            found = cxxrtl.play(config, program, stimulus)
            if (difference := first_difference(simulate(config, stimulus), found)) is not None:
                raise Mismatch(f"{name}: {difference.describe(('model', 'CXXRTL'))}")
            counts.append(len(found))
    if not counts[0]:
        raise Mismatch("the scan gives no event at all, so nothing was compared")
    clocks = sum(stimulus.clocks for stimulus in runs.values())
    return {"runs": len(runs), "clocks": clocks, "events": sum(counts), "of_texture": counts[0]}


def texts(config: ReadoutConfig | FrameConfig) -> dict[str, list[str]]:
    """Return the problems that slang finds in the Verilog, alone and with the bound properties."""
    top = top_block(config).module_name
    text = verilog(config)
    both = {f"{top}.v": text, f"{top}_properties.sv": properties(config)}
    return {"verilog": problems({f"{top}.v": text}, top), "properties": problems(both, top)}


def problems(texts: Mapping[str, str], top: str) -> list[str]:
    """Return slang's messages about a design, without waived ones."""
    design, sources = compilation(texts, top)
    from pyslang import DiagnosticEngine

    said = DiagnosticEngine.reportAll(sources, design.getAllDiagnostics())
    found = [what for what, flag in SAID.findall(said) if flag not in WAIVED]
    if top_of(design, top) is None:
        found.append(f"no module {top}")
    return found
