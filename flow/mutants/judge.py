"""What becomes of the mutants of a file: killed by the quick check, by another test, by a proof; the same; or alive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from flow.formal.bench import netlist
from flow.formal.engine import solve
from flow.formal.mutants import planted
from flow.formal.plan import Proof, proofs
from flow.mutants.changes import Change
from flow.mutants.equivalence import same
from flow.mutants.plan import GROUNDS, LONG
from flow.mutants.suite import Suite

LARGEST, LARGEST_LONG = 192, 15
"""Taxels of the arrays in the tests of blocks, and in those of whole readouts."""


@dataclass
class Finding:
    """What is kept of a mutant.

    Attributes
    ----------
    key : str
        Digest of the file with the edit.
    name, block, file, kind : str
    verdict : str
        ``killed``, ``equivalent``, ``alive`` or ``stillborn``; empty while it is open.
    quick : bool
        Whether the quick check kills it.
    by : str
        The test or property that does.
    tried : int
        Tests in which its Verilog was another and that passed.
    proved : int
        Configurations in which it is proved to do the same as the original, where its RTLIL is another.
    differs : tuple of str
        Modules, each with a configuration, that are not proved to do the same.
    """

    key: str
    name: str
    block: str
    file: str
    kind: str
    verdict: str = ""
    quick: bool = False
    by: str = ""
    tried: int = 0
    proved: int = 0
    differs: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON content."""
        return asdict(self)


class Judge:
    """Brings the mutants of a file before the tests, all that are left of them at a time.

    Parameters
    ----------
    suite : Suite
    on_finding : callable
        Called with every mutant whose fate is decided.
    """

    def __init__(self, suite: Suite, on_finding: Callable[[Finding], None]) -> None:
        self.suite, self.on_finding = suite, on_finding
        self._same: dict[tuple[str, str], bool] = {}

    def judge(self, file: str, changes: list[Change]) -> None:
        """Find out what becomes of some mutants of a file."""
        block = GROUNDS[file].block
        left = {c: Finding(c.key, c.name, block, file, c.kind) for c in changes}
        tests = [test for test in GROUNDS[file].tests if test == file or test not in LONG]
        quick, own = self._tests(tests, LARGEST, True), self._tests(tests, LARGEST, False)
        later = [test for test in GROUNDS[file].tests if test not in tests]
        quick += self._tests(later, LARGEST_LONG, True)
        for name in quick:
            left = self._run(name, left, quick=True)
        for name in own:
            left = self._run(name, left)
        long = self._tests(later, LARGEST_LONG, False) if left else []
        left = self._compare([*quick, *own, *long], left)
        left = self._prove(file, left)
        for name in long:
            left = self._run(name, left)
        for finding in left.values():
            self._decide(finding, "alive")

    def _decide(self, finding: Finding, verdict: str, by: str = "") -> None:
        finding.verdict, finding.by = verdict, by
        self.on_finding(finding)

    def _tests(self, tests: list[str], largest: int, quick: bool) -> list[str]:
        """Return the cases of test files that are in the quick check, or not in it: those of small arrays first."""
        found = []
        for test in tests:
            sized = []
            for name, item in self.suite.items.items():
                if not name.startswith(f"cocotb_tests/test_{test}.py"):
                    continue
                if bool(item.get_closest_marker("quick")) == quick and (built := self.suite.learn(name)):
                    size = getattr(built[0], "taxels", 1)
                    sized += [(size, name)] if size <= largest else []
            found += [name for _, name in sorted(sized)]
        return found

    def _run(self, name: str, left: dict[Change, Finding], quick: bool = False) -> dict[Change, Finding]:
        """Run a test with all that are left; return those that are still."""
        alive = {}
        outcomes = self.suite.run(name, list(left)) if left else []
        for (change, finding), outcome in zip(left.items(), outcomes, strict=True):
            if outcome in ("failed", "endless"):
                finding.quick = quick
                self._decide(finding, "killed", name if outcome == "failed" else f"{name} (never ends)")
            elif outcome == "stillborn":
                self._decide(finding, outcome)
            else:
                finding.tried += outcome == "passed"
                alive[change] = finding
        return alive

    def _compare(self, names: list[str], left: dict[Change, Finding]) -> dict[Change, Finding]:
        """Compare with the original in the configuration of every test; return those that are not proved to be it."""
        alive = {}
        for change, finding in left.items():
            for name in names:
                different = self._different(name, change, finding)
                if different:
                    finding.differs = different
                    alive[change] = finding
                    break
            else:
                self._decide(finding, "equivalent")
        return alive

    def _different(self, name: str, change: Change, finding: Finding) -> tuple[str, ...]:
        """Return the modules that are not proved to do the same in what a test simulates."""
        built = self.suite.learn(name)
        assert built is not None
        made = self.suite.designs(name, {1: change})[1]
        if isinstance(made, str):
            return ()
        original = self.suite.original(built[0])
        unlike = [module for module in made if made[module] != original[module]]
        different = [module for module in unlike if not self._same_module(module, original, made)]
        finding.proved += not different
        return tuple(f"{module} in {name.partition('[')[2].rstrip(']') or name}" for module in different)

    def _same_module(self, module: str, original: Mapping[str, str], mutated: Mapping[str, str]) -> bool:
        pair = original[module], mutated[module]
        if pair not in self._same:
            try:
                self._same[pair] = same(module, original, mutated) is True
            except Exception:  # what Yosys refuses is not proved
                self._same[pair] = False
        return self._same[pair]

    def _prove(self, file: str, left: dict[Change, Finding]) -> dict[Change, Finding]:
        """Look for properties of ``make formal`` that fail; return those for which none does."""
        alive = {}
        grounds = [proof for proof in proofs() if proof.block in GROUNDS[file].proofs]
        before = {proof: netlist(proof.checker(proof.config)) for proof in grounds} if left else {}
        for change, finding in left.items():
            for proof in grounds:
                if failed := _failed(proof, before[proof], change):
                    self._decide(finding, "killed", f"property {proof.block}: {failed}")
                    break
            else:
                alive[change] = finding
        return alive


def _failed(proof: Proof, before: str, change: Change) -> str:
    """Return a property that fails by a mutant, or an empty text."""
    with planted(change):
        try:
            checker = proof.checker(proof.config)
            if netlist(checker) == before:
                return ""
            return min(solve(checker, proof.depth, 0).failed, default="")
        except Exception:
            return ""
