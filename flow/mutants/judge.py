"""What becomes of the mutants of a file: killed by the quick check, by another test, by a proof; the same; or alive."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

from cocotb_tests.session.store import ROOT
from flow.formal.bench import netlist
from flow.formal.engine import solve
from flow.formal.mutants import planted
from flow.formal.plan import Proof, proofs
from flow.mutants.batch import within
from flow.mutants.changes import Change
from flow.mutants.elsewhere import configs
from flow.mutants.equivalence import same
from flow.mutants.facts import Facts
from flow.mutants.plan import GROUNDS, LONG, NOT_ASKED
from flow.mutants.planting import first_failed
from flow.mutants.suite import Suite, watched
from rtl.verilog import Config, top_block

MOST = 16
"""Cases of blocks that are asked first, and of each test of whole readouts; configurations in which one is compared."""

LARGEST, LARGEST_LONG = 64, 15
"""Taxels of the arrays in the tests of blocks, and in those of whole readouts."""

COMPARE_S = 60
"""Seconds of the processor for the comparison of a module with the original."""

UNFIT = "unfit "
"""Begins the fact that a test could not be asked."""


@dataclass
class Finding:
    """What is kept of a mutant.

    Attributes
    ----------
    key : str
        Digest of the file with the edit.
    name, block, file, kind : str
    verdict : str
        ``killed``, ``equivalent``, ``alive``, ``argued`` or ``stillborn``; empty while it is open.
    quick : bool
        Whether the quick check kills it.
    by : str
        The test or property that does.
    tried : int
        Tests in which its Verilog was another and that passed.
    proved : int
        Configurations in which it is proved to do the same as the original, where its RTLIL is another.
    differs : tuple of str
        Modules, each with a configuration, that are not proved to do the same, or were seen to differ there.
    why : str
        Why no test can notice it, where that is argued.
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
    why: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON content."""
        return asdict(self)


class Judge:
    """Brings the mutants of a file before the tests, all that are left of them at a time.

    Parameters
    ----------
    suite : Suite
    facts : Facts
        What is known of earlier runs: tests that a mutant passed, modules that were compared.
    seed : int
        Of the configurations that no test has.
    on_finding : callable
        Called with every mutant whose fate is decided.
    """

    def __init__(self, suite: Suite, facts: Facts, seed: int, on_finding: Callable[[Finding], None]) -> None:
        self.suite, self.facts, self.seed, self.on_finding = suite, facts, seed, on_finding

    def test(self, file: str, changes: list[Change]) -> dict[Change, Finding]:
        """Bring some mutants of a file before the quick check and the tests of blocks; return those left."""
        block = GROUNDS[file].block
        left = {c: Finding(c.key, c.name, block, file, c.kind) for c in changes}
        quick, own, _ = self._all_tests(file)
        for name in quick:
            left = self._run(name, left, quick=True)
        for name in _spread(own):
            left = self._run(name, left)
        return left

    def conclude(self, file: str, left: dict[Change, Finding]) -> None:
        """Decide what those are that are left: equivalent, killed by a property or a whole readout, or alive."""
        quick, own, later = self._all_tests(file)
        left = self._compare(file, [*quick, *_spread(own)], left)
        left = self._prove(file, self._ask_others(file, left))
        asked = _spread(own)
        for name in (name for name in own if name not in asked):
            left = self._run(name, left)
        long = [name for test in later for name in _spread(self._tests([test], LARGEST_LONG, False))] if left else []
        for name in long:
            left = self._run(name, left)
        for finding in left.values():
            self._decide(finding, "alive")

    def _all_tests(self, file: str) -> tuple[list[str], list[str], list[str]]:
        """Return the cases of the quick check, other cases of blocks, and the names of the tests of whole readouts."""
        every = GROUNDS[file].tests
        tests = [test for test in every if test == file.partition(".")[0] or test not in LONG] or list(every)
        later = [test for test in every if test not in tests]
        quick = self._tests(tests, LARGEST, True) + self._tests(later, LARGEST, True)
        return quick, self._tests(tests, LARGEST, False), later

    def _decide(self, finding: Finding, verdict: str, by: str = "") -> None:
        finding.verdict, finding.by = verdict, by
        self.on_finding(finding)

    def _tests(self, tests: list[str], largest: int, quick: bool) -> list[str]:
        """Return the cases of test files that are in the quick check, or not in it: those of small arrays first."""
        found = []
        for test in tests:
            sized = []
            for name, item in self.suite.items.items():
                if not name.startswith(f"cocotb_tests/test_{test}.py") or any(f"::{odd}" in name for odd in NOT_ASKED):
                    continue
                if bool(item.get_closest_marker("quick")) == quick and (built := self.suite.learn(name)):
                    size = getattr(built[0], "taxels", 1)
                    sized += [(size, name)] if size <= largest else []
                if name in self.suite.unfit:
                    self._note_unfit(name)
            found += [name for _, name in sorted(sized)]
        return found

    def _run(self, name: str, left: dict[Change, Finding], quick: bool = False) -> dict[Change, Finding]:
        """Run a test with all that are left and have not passed it; return those that are still."""
        asked = [change for change in left if self.facts.get(_question(change, name)) is None]
        outcomes = dict(zip(asked, self.suite.run(name, asked) if asked else [], strict=True))
        if asked:
            self._note_unfit(name)
        alive = {}
        for change, finding in left.items():
            outcome = outcomes.get(change) or str(self.facts.get(_question(change, name)))
            if outcome in ("failed", "endless"):
                finding.quick = quick
                self._decide(finding, "killed", name if outcome == "failed" else f"{name} (never ends)")
            elif outcome == "stillborn":
                self._decide(finding, outcome)
            else:
                if change in outcomes and outcome != "unfit":
                    self.facts.add(_question(change, name), outcome)
                finding.tried += outcome == "passed"
                alive[change] = finding
        return alive

    def _note_unfit(self, name: str) -> None:
        """Keep that a test cannot be asked, or that it can now."""
        why = self.suite.unfit.get(name, "")
        if why or self.facts.get(UNFIT + name):
            self.facts.add(UNFIT + name, why)

    def _compare(self, file: str, names: list[str], left: dict[Change, Finding]) -> dict[Change, Finding]:
        """Compare with the original where tests look, and elsewhere; return those not proved to be it."""
        places: dict[str, tuple[str, Config, str]] = {}
        for name in names:
            config, module = self.suite.learn(name) or (None, "")
            if config is not None:
                places.setdefault(f"{module} {config.to_dict()}", (name.partition("[")[2].rstrip("]"), config, module))
        places = {place: places[place] for place in _spread(list(places))}
        for number, config in enumerate(configs(file, self.seed)):
            place = f"configuration {number} that no test has, of seed {self.seed}"
            places[place] = (place, config, top_block(config).module_name)
        alive = {}
        for change, finding in left.items():
            for place, config, module in places.values():
                if different := self._different(config, module, change, finding):
                    finding.differs = tuple(f"{name} in {place}" for name in different)
                    alive[change] = finding
                    break
            else:
                self._decide(finding, "equivalent")
        return alive

    def _different(self, config: Config, module: str, change: Change, finding: Finding) -> tuple[str, ...]:
        """Return the modules that are not proved to do the same in a configuration."""
        made = self.suite.designs(config, module, {1: change})[1]
        if isinstance(made, str):
            return () if made == "same" else (module,)
        original = self.suite.original(config)
        unlike = [name for name in made if made[name] != original[name]]
        answers = {name: self._same_module(name, original, made) for name in unlike}
        different = tuple(f"{name} ({answer})" for name, answer in answers.items() if answer != "same")
        finding.proved += not different
        return different

    def _same_module(self, module: str, original: Mapping[str, str], mutated: Mapping[str, str]) -> str:
        """Return ``same``, ``differs`` or ``not proved``."""
        pair = [text for side in (original, mutated) for text in within(module, side).values()]
        key = "same " + hashlib.sha256("\0".join(pair).encode()).hexdigest()[:16]
        if (known := self.facts.get(key)) is not None:
            return str(known)
        try:
            with watched(COMPARE_S):
                proved = same(module, within(module, original), within(module, mutated))
            answer = {True: "same", False: "differs", None: "not proved"}[proved]
        except Exception:  # what Yosys refuses, or takes too long for, is not proved
            answer = "not proved"
        self.facts.add(key, answer)
        return answer

    def _ask_others(self, file: str, left: dict[Change, Finding]) -> dict[Change, Finding]:
        """Ask the tests without a simulation; return those that pass them."""
        tests = GROUNDS[file].others
        if not tests or not left:
            return left
        together = " ".join(tests)
        if failed := first_failed(tests, None):
            self.suite.unfit[together] = f"{failed} fails with the original RTL"
        self._note_unfit(together)
        if failed:
            return left
        alive = {}
        for change, finding in left.items():
            question = _question(change, *tests)
            failed = "" if self.facts.get(question) else first_failed(tests, change)
            if failed:
                self._decide(finding, "killed", failed)
            else:
                self.facts.add(question, "passed")
                finding.tried += 1
                alive[change] = finding
        return alive

    def _prove(self, file: str, left: dict[Change, Finding]) -> dict[Change, Finding]:
        """Look for properties of ``make formal`` that fail; return those for which none does."""
        alive = {}
        grounds = [proof for proof in proofs() if proof.block in GROUNDS[file].proofs]
        before = {proof: netlist(proof.checker(proof.config)) for proof in grounds} if left else {}
        for change, finding in left.items():
            for proof in grounds:
                question = f"{change.key} property {proof.block} {proof.size}"
                failed = "" if self.facts.get(question) else _failed(proof, before[proof], change)
                if failed:
                    self._decide(finding, "killed", f"property {proof.block}: {failed}")
                    break
                self.facts.add(question, "holds")
            else:
                alive[change] = finding
        return alive


def _question(change: Change, *tests: str) -> str:
    """Return tests with a mutant as a question, which is another one when a file of them changes."""
    return " ".join([change.key, *(f"{name} {_version(name.partition('::')[0])}" for name in tests)])


@cache
def _version(file: str) -> str:
    return hashlib.sha256((ROOT / file).read_bytes()).hexdigest()[:16]


def _spread(names: list[str]) -> list[str]:
    """Return at most ``MOST`` of some names, from all over the list."""
    return names[:: max(-(-len(names) // MOST), 1)]


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
