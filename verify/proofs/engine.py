"""Run the solvers in Yosys: property-directed reachability for proofs, bounded search for counterexamples.

ABC, a part of the pinned Yosys, does both; it looks at the design as gates, an output for every property.
"""

import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from eskin.rtl import yosys
from eskin.verify.proofs.bench import TOP, cutting, design, exposing
from eskin.verify.proofs.checker import Checker

MAP = (
    "memory -nomap; memory_map; async2sync; formalff -clk2ff -ff2anyinit; setundef -undriven -anyseq; opt -full; "
    "techmap; opt -fast; simplemap; dffunmap; aigmap; opt_clean; "
)
WRITE = "write_aiger -I -zinit -no-startoffset "
TO_GATES = (
    "read_rtlil readout.il; {cut}{expose}delete t:$meminit_v2; hierarchy -check -top {top}; proc; flatten; opt_clean; "
    f"{MAP}{WRITE}search.aig; delete -port o:seen_*; opt_clean; {WRITE}proof.aig; design -reset; "
)
ASSERTED = re.compile(r"Output\s+(\d+) was asserted in frame\s+(\d+) \(solved")
"""Message of bounded search with output and clock; the number in a message of the proof is not a clock."""
CONVERGED = re.compile(r"Proved output\s+(\d+) in frame")
EACH, TOGETHER = "scorr -C 10000; dc2; pdr -a -T {}", "orpos; scorr; pdr -T {}"
"""Scripts that prove the properties of a block one by one, or as one property.

No retiming: ABC's gave registers wrong initial values."""


@dataclass(frozen=True)
class Verdict:
    """Results of the solvers for a block."""

    proved: frozenset[str]  # properties that hold in every clock of every run
    failed: dict[str, int]  # properties that fail, and the clock of the failure; the first clock is 0
    reached: dict[str, int]  # properties whose case can happen, and the first clock in which it does
    depth: int  # clocks of the bounded search
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON."""
        return asdict(self) | {"proved": sorted(self.proved)}

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Return the verdict for its JSON."""
        return cls(**dict(fields) | {"proved": frozenset(fields["proved"])})

    @classmethod
    def of(cls, found: Mapping[tuple[str, str], int], depth: int, started: float, proved: Iterable[str] = ()) -> Self:
        """Return the results for the first clocks by kind, ``bad`` or ``seen``, and property."""
        failed, reached = (
            {name: clock for (kind, name), clock in found.items() if kind == wanted} for wanted in ("bad", "seen")
        )
        return cls(frozenset(proved), failed, reached, depth, time.monotonic() - started)


def solve(checker: Checker[Any], depth: int, limit_s: int = 120, rtlil: str = "", cases: bool = True) -> Verdict:
    """Search for counterexamples and covered cases, then prove the properties.

    The search has ``depth`` clocks, and takes most of its time for covered ``cases``. The proof of properties that did
    not fail takes ``limit_s`` seconds at most; 0 leaves it out. ``rtlil`` takes the place of the block's own.
    """
    started = time.monotonic()
    text, bench = design(checker, rtlil)
    names = [("bad", name) for name in bench.bad] + [("seen", name) for name in bench.seen]
    shrink, ways = (["scorr"], TOGETHER) if checker.together else ([], EACH)
    searched = "search.aig" if cases or not bench.clocked else "proof.aig"  # the search needs a register
    # -x: without stored counterexamples bmc3 reads through a pointer to nothing
    prove = ["read_aiger proof.aig", "strash", ways.format(limit_s)] if limit_s else []
    to_gates = TO_GATES.format(top=TOP, cut=cutting(checker), expose=exposing(checker))
    for way in (shrink, []):
        said = yosys.run_abc(
            to_gates, text, [f"read_aiger {searched}", "strash", *way, f"bmc3 -a -x -F {depth}", *prove]
        )
        if "Does not work for combinational networks" not in said:  # scorr can leave no register
            break
    if "Error:" in said:
        raise AssertionError(f"the solvers did not search {checker.block.module_name}: {said}")
    found = {names[int(n)]: int(clock) for n, clock in ASSERTED.findall(said)}
    if checker.together and "Property proved" in said:
        return Verdict.of(found, depth, started, bench.bad)
    certain = [names[int(n)] for n in CONVERGED.findall(said)]
    return Verdict.of(found, depth, started, (name for kind, name in certain if kind == "bad"))
