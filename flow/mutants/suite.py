"""The project's own co-simulations, collected once by pytest and run with many mutants at a time in the RTL."""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from cocotb_tests.session import simulator
from cocotb_tests.session.store import ROOT
from flow.formal.mutants import planted
from flow.mutants import batch
from flow.mutants.changes import Change
from flow.mutants.inside import JOB, VERDICTS
from model.files import kept_lines
from rtl import yosys
from rtl.block import Netlist
from rtl.verilog import Config, top_block

CPU_S, CPU_S_EACH = 60, 10
"""Seconds of the processor that a simulation may take, and more for every mutant: one that hangs is ended by it."""

EVERYWHERE = ("logic", "classifier.numbers")
"""Files whose functions blocks of other files use."""

GENERATION_S = 5
"""Seconds of the processor in which a design with a mutant must be made."""

LOOK_EVERY_S = 1.0
AT_ONCE = 48
"""Mutants in one program."""


class Told(Exception):
    """Ends a test that was only to say what it builds."""


class Unfit(Exception):
    """A test cannot be asked about mutants: it fails with the original RTL too."""


class Hangs(Exception):
    """The simulation went on and on."""


def modules_of(config: Config) -> dict[str, str]:
    """Return the RTLIL of all modules of a configuration, by their names."""
    return made_of(config).modules


def made_of(config: Config) -> Netlist:
    """Return all modules of a configuration, with the blocks that they are made of."""
    made = Netlist(config.reset == "async")
    made.add(top_block(config))
    return made


def mutated(config: Config, change: Change, original: Netlist) -> dict[str, str]:
    """Return the RTLIL of all modules with a mutant planted: only the blocks of its file are made anew.

    What all blocks use, or a block with other ports than before, makes everything anew.
    """
    if change.file in EVERYWHERE:
        return modules_of(config)
    home = f"rtl.{change.file}"
    blocks = {name: block for name, block in original.blocks.items() if type(block).__module__ == home}
    made = Netlist(config.reset == "async")
    made.modules = {name: text for name, text in original.modules.items() if name not in blocks}
    for block in blocks.values():
        made.add(getattr(sys.modules[home], type(block).__name__)(block.config))
    if any(batch.ports_of(made.modules[name]) != batch.ports_of(original.modules[name]) for name in blocks):
        return modules_of(config)
    return made.modules


class Suite:
    """Tests that look at the RTL, to be asked about mutants.

    Attributes
    ----------
    items : dict of str to pytest.Item
        The tests by their names.
    built : dict of str to (Config, str)
        What each test builds: the configuration, and the module that is simulated.
    unfit : dict of str to str
        Why a test cannot be asked, by its name.
    """

    def __init__(self) -> None:
        self.items: dict[str, pytest.Item] = {}
        self.built: dict[str, tuple[Config, str] | None] = {}
        self.unfit: dict[str, str] = {}
        self._originals: dict[str, Netlist] = {}

    def collect(self, files: list[str], ask: Callable[[Suite], None]) -> None:
        """Collect the tests of some files, and call ``ask`` while they can be run."""
        wrong: list[Exception] = []

        class Plugin:
            """Takes the place of pytest's own loop over the tests."""

            @pytest.hookimpl(tryfirst=True)
            def pytest_runtestloop(_, session: pytest.Session) -> bool:
                self.items = {item.nodeid: item for item in session.items if "verilator" not in item.nodeid}
                try:
                    ask(self)
                except Exception as error:  # pytest would only print it
                    wrong.append(error)
                return True

        words = ["-q", "-q", "-s", "-p", "no:cacheprovider", "-p", "no:xdist", "--rootdir", str(ROOT), "-o", "addopts="]
        words += ["-o", "tmp_path_retention_policy=none", "--no-header", *(str(ROOT / file) for file in files)]
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:  # others' runs of pytest clear the common one
            pytest.main([*words, f"--basetemp={folder}/tests"], plugins=[Plugin()])
        if wrong:
            raise wrong[0]

    def learn(self, name: str) -> tuple[Config, str] | None:
        """Return what a test builds; None if it builds nothing. No mutant may be there."""
        if name not in self.built:
            asked: list[Any] = []

            def note(recipe: Any) -> str:
                asked.append(recipe[2])
                raise Told

            def take(config: Config) -> str:
                asked.append(config)
                return ""

            with _changed(verilog_text=take, digest=note):
                reports = runtestprotocol(self.items[name], log=False, nextitem=None)
            if not asked and (said := _said(reports)):
                self.unfit[name] = f"it fails before it builds: {said}"
            config, top = asked[:2] if len(asked) >= 2 else (None, "")
            if config is not None and top == "harness":
                top = top_block(config).module_name
            self.built[name] = None if config is None else (config, top)
        return self.built[name]

    def original(self, config: Config) -> dict[str, str]:
        """Return the RTLIL of a configuration's modules, made at the first call: no mutant may be there then."""
        return self._made(config).modules

    def _made(self, config: Config) -> Netlist:
        key = f"{type(config).__name__} {config.to_dict()}"
        if key not in self._originals:
            self._originals[key] = made_of(config)
        return self._originals[key]

    def designs(self, config: Config, module: str, changes: Mapping[int, Change]) -> dict[int, dict[str, str] | str]:
        """Return the RTLIL of a module and those within with each mutant; ``same`` or ``stillborn`` in its place."""
        before = batch.within(module, self.original(config))
        found: dict[int, dict[str, str] | str] = {}
        for number, change in changes.items():
            try:
                with planted(change), _ending(GENERATION_S):
                    made = batch.within(module, mutated(config, change, self._made(config)))
            except Exception:
                found[number] = "stillborn"
                continue
            other = batch.ports_of(made[module]) != batch.ports_of(before[module])
            found[number] = "same" if made == before else "stillborn" if other else made
        return found

    def run(self, name: str, changes: list[Change]) -> list[str]:
        """Run a test with one mutant after the other in the RTL.

        Returns
        -------
        list of str
            For each ``failed``, ``endless``, ``passed``, ``same`` (its Verilog is that of the original in this test),
            ``stillborn`` (there is no Verilog, or one that is refused) or ``unfit`` (the test fails with the original
            too, so it says nothing).
        """
        self.unfit.pop(name, None)
        try:
            return self._run(name, changes)
        except Unfit as error:
            self.unfit[name] = str(error)
            return ["unfit"] * len(changes)

    def _run(self, name: str, changes: list[Change]) -> list[str]:
        found: dict[int, str] = {}
        numbers = dict(enumerate(changes, 1))
        for start in range(1, len(changes) + 1, AT_ONCE):
            some = {number: numbers[number] for number in range(start, min(start + AT_ONCE, len(changes) + 1))}
            built = self.learn(name)
            assert built is not None
            designs = self.designs(*built, some)
            found |= {number: design for number, design in designs.items() if isinstance(design, str)}
            found |= self._simulate(name, {n: design for n, design in designs.items() if not isinstance(design, str)})
        return [found[number] for number in numbers]

    def _simulate(self, name: str, designs: dict[int, dict[str, str]]) -> dict[int, str]:
        if not designs:
            return {}
        built = self.learn(name)
        assert built is not None
        config, module = built
        try:
            text, refused = batch.verilog(module, {0: batch.within(module, self.original(config)), **designs})
        except yosys.YosysError:  # one of them: which?
            if len(designs) == 1:
                return dict.fromkeys(designs, "stillborn")
            halves = list(designs)[: len(designs) // 2], list(designs)[len(designs) // 2 :]
            first, second = ({number: designs[number] for number in half} for half in halves)
            return self._simulate(name, first) | self._simulate(name, second)
        found = dict.fromkeys(refused, "stillborn")
        todo = [number for number in designs if number not in refused]
        while todo:
            verdicts = self._play(name, text, todo)
            if verdicts.get(0) != "passed":
                raise Unfit(f"it fails with the original RTL: {verdicts}")
            found |= {number: verdict for number, verdict in verdicts.items() if number}
            todo = [number for number in todo if number not in found]
        return found

    def _play(self, name: str, text: str, numbers: list[int]) -> dict[int, str]:
        """Run a test with the original and some mutants; one during which the simulation broke off is endless."""
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            verdicts = Path(folder) / VERDICTS
            test = simulator.Build.test

            def mutated(
                program: simulator.Build, module: str, place: Path, case: str | None = None, env: Any = None
            ) -> None:
                job = {"module": module, "test": case, "mutants": numbers}
                try:
                    test(program, "flow.mutants.inside", place, "all_mutants", (env or {}) | {JOB: json.dumps(job)})
                finally:
                    if (place / VERDICTS).exists():
                        verdicts.write_bytes((place / VERDICTS).read_bytes())

            simulator.Build.test = mutated  # type: ignore[assignment,method-assign]
            try:
                limit = CPU_S + CPU_S_EACH * len(numbers)
                with _changed(verilog_text=lambda config: text, BUILD=Path(folder)), watched(limit):
                    reports = runtestprotocol(self.items[name], log=False, nextitem=None)
            finally:
                simulator.Build.test = test  # type: ignore[method-assign]
            if not verdicts.exists():
                raise Unfit(f"its simulation did not begin: {_said(reports)}")
            lines = list(kept_lines(verdicts))
        found = {line["mutant"]: line["verdict"] for line in lines if "mutant" in line}
        return {line["begins"]: found.get(line["begins"], "endless") for line in lines if "begins" in line}


def _said(reports: list[pytest.TestReport]) -> str:
    """Return the last line of what a test that failed says."""
    said = [line for report in reports if report.failed for line in str(report.longrepr).splitlines() if line.strip()]
    return said[-1].strip() if said else ""


@contextmanager
def _changed(**values: Any) -> Iterator[None]:
    """Give names of the simulator's module other values for a while."""
    before = {name: getattr(simulator, name) for name in values}
    try:
        for name, value in values.items():
            setattr(simulator, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(simulator, name, value)


def _children(of: int) -> Iterator[int]:
    """Yield the processes that a process has started, and theirs."""
    for thread in Path(f"/proc/{of}/task").glob("*/children"):
        try:
            found = thread.read_text().split()
        except OSError:
            continue
        for child in found:
            yield int(child)
            yield from _children(int(child))


def _cpu_s(process: int) -> float:
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _ending(limit_s: float) -> Iterator[None]:
    """End what computes for too long: a mutant may make the generator go round for ever."""

    def end(signum: int, frame: Any) -> None:
        raise Hangs

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


@contextmanager
def watched(limit_s: float) -> Iterator[None]:
    """End what this process has started if it takes too much time of the processor, so a busy machine is no reason."""

    def look(signum: int, frame: Any) -> None:
        children = list(_children(os.getpid()))
        if any(_cpu_s(child) > limit_s for child in children):
            for child in children:
                os.kill(child, signal.SIGKILL)
            raise Hangs

    before = signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, LOOK_EVERY_S, LOOK_EVERY_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
