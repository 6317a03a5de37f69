"""Mutants of the RTL: every edit is another program, equivalents are proved, a campaign judges, keeps and goes on."""

from __future__ import annotations

import ast
import contextlib
import json
import subprocess
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

import rtl
from flow.formal.mutants import planted
from flow.mutants import batch
from flow.mutants.campaign import chosen, closing_line, read, summary, unfit
from flow.mutants.changes import Change, changes, text_of
from flow.mutants.elsewhere import COUNT, configs
from flow.mutants.equivalence import same
from flow.mutants.facts import Facts
from flow.mutants.judge import Finding, Judge
from flow.mutants.pieces import judge, pieces
from flow.mutants.plan import GROUNDS, NOT_ASKED
from flow.mutants.planting import first_failed
from flow.mutants.suite import Suite, made_of, modules_of, mutated
from model.config import ReadoutConfig

CONFIG = ReadoutConfig(rows=2, columns=2)
NO_LOGIC = {"block", "yosys", "verilog", "delivery", "gates", "classifier.ports"}


def the(file: str, old: str, new: str) -> Change:
    return next(change for change in changes(file) if change.new == new and old in f"{change.old} {change.name}")


def test_every_edit_is_another_program() -> None:
    for file in GROUNDS:
        text = text_of(file)
        found = changes(file)
        assert found, file
        for change in found[:: max(len(found) // 5, 1)]:  # parsing all of them would take a minute
            assert ast.dump(ast.parse(change.source())) != ast.dump(ast.parse(text)), change.name
    blocks = {ground.block for ground in GROUNDS.values()}
    drawn = chosen(blocks, 0.36, 1)
    assert len(set(drawn)) == len(drawn) >= 600
    assert drawn == chosen(blocks, 0.36, 1) != chosen(blocks, 0.36, 2)
    assert [change for change in drawn if change.file == "link"] == chosen({"link"}, 0.36, 1)


def test_every_module_with_logic_is_mutated() -> None:
    folder = Path(str(rtl.__file__)).parent
    files = {".".join(path.relative_to(folder).with_suffix("").parts) for path in folder.rglob("*.py")}
    others = {file for file in files if file.startswith(("datasheet", "text", "board")) or "__" in file} | NO_LOGIC
    assert files - others == set(GROUNDS)


def test_an_edit_that_no_longer_fits_is_refused() -> None:
    change = changes("link")[0]
    moved = Change(change.name, change.file, "elsewhere", "", (), change.kind, change.start, change.line)
    with pytest.raises(ValueError, match="'elsewhere' does not stand at"):
        moved.source()


@pytest.mark.parametrize("file", ["link", "taxel", "readout", "registers.spi", "classifier.core", "frame"])
def test_only_the_blocks_of_the_file_are_made_anew(file: str) -> None:
    config = configs(file, 1)[0]
    original, every = made_of(config), changes(file)
    different = 0
    for change in every[:: max(len(every) // 4, 1)]:
        with planted(change), contextlib.suppress(Exception):  # some can be made in no way
            whole = modules_of(config)
            assert mutated(config, change, original) == whole, change.name
            different += whole != original.modules
    assert different


def test_a_generator_that_goes_round_for_ever_is_stillborn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flow.mutants.suite.GENERATION_S", 1)
    endless = the("logic", "logic.py:13: > ->", ">=")
    assert Suite().designs(CONFIG, "eskin_arbiter", {1: endless}) == {1: "stillborn"}


def test_what_does_the_same_is_proved_and_what_does_not_is_seen() -> None:
    original = batch.within("eskin_arbiter", modules_of(CONFIG))
    # A mask of more bits than rows has bits that nothing reads; a row that waits for every bit is no row at all.
    for old, new, expected in (("arbiter.py:63: - ->", "+", True), ("arbiter.py:91: ~rest.any()", "rest.any()", False)):
        with planted(the("arbiter", old, new)):
            mutated = batch.within("eskin_arbiter", modules_of(CONFIG))
        assert mutated != original
        assert same("eskin_arbiter", original, mutated) is expected


def _size(config: Any) -> tuple[int, int, int]:
    return config.rows, config.columns, config.sample_bits


def test_nothing_is_asked_twice(tmp_path: Path) -> None:
    facts = Facts(tmp_path / "facts.jsonl")
    facts.add("test a", "passed")
    facts.add("same b", "differs")
    with facts.path.open("a") as file:
        file.write('["test c", "pas')  # as one that was stopped while it wrote
    again = Facts(facts.path)
    assert [again.get(question) for question in ("test a", "same b", "test c")] == ["passed", "differs", None]


@pytest.mark.parametrize("file", sorted(GROUNDS))
def test_an_edit_is_looked_at_where_no_test_looks(file: str) -> None:
    found = configs(file, 1)
    assert len(set(map(repr, found))) == len(found) == COUNT
    assert found == configs(file, 1) != configs(file, 2)
    if file in ("link", "window"):
        assert f"eskin_{file}" in modules_of(found[0])


def test_what_differs_only_where_no_test_looks_is_not_equivalent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = configs("link", 1)[:2]
    monkeypatch.setattr("flow.mutants.judge.configs", lambda file, seed: elsewhere)
    old = "~setup & ~request"
    found = {}
    only = f"(self.config.rows, self.config.columns, self.config.sample_bits) == {_size(elsewhere[1])}"
    for new in ("~request & ~setup", f"~setup & ~request & (0 if {only} else 1)"):
        change = Change(new, "link", old, new, start=text_of("link").index(old))
        finding = Finding(change.key, new, "link", "link", "")
        judge = Judge(Suite(), Facts(tmp_path / "facts.jsonl"), 1, lambda finding: None)
        judge._compare("link", [], {change: finding})
        found[new] = finding.verdict, finding.differs
    same_one, other = found.values()
    assert same_one == ("equivalent", ())
    assert other == ("", ("eskin_link (differs) in configuration 1 that no test has, of seed 1",))


def test_a_test_that_fails_with_the_original_is_told_and_kills_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = the("arbiter", "arbiter.py:91: ~rest.any()", "rest.any()")
    finding = Finding(change.key, change.name, "arbiter", "arbiter", "")
    suite = Suite()
    judge = Judge(suite, Facts(tmp_path / "facts.jsonl"), 1, lambda finding: None)
    odd = "cocotb_tests/test_arbiter.py::odd"
    suite.built[odd] = CONFIG, "eskin_arbiter"
    played = {0: "failed"}
    monkeypatch.setattr(Suite, "_play", lambda *_: played)
    assert judge._run(odd, {change: finding}) == {change: finding}
    assert (finding.verdict, finding.tried) == ("", 0)
    assert unfit(tmp_path) == {odd: "it fails with the original RTL: {0: 'failed'}"}
    content = summary([finding], 1, unfit(tmp_path))
    assert content["not_asked"] == unfit(tmp_path)
    assert content["result"].endswith("; tests not asked, for they fail with the original: 1")
    monkeypatch.setattr("flow.mutants.judge._version", lambda file: "before")
    judge.facts.add(f"{change.key} {odd} before", "passed")
    assert judge._run(odd, {change: finding}) == {change: finding}  # it is known, so this asks nothing
    monkeypatch.setattr("flow.mutants.judge._version", lambda file: "after")
    played |= {0: "passed", 1: "failed"}  # its file is mended, so it is asked once more
    assert judge._run(odd, {change: finding}) == {}
    assert (finding.verdict, finding.by, unfit(tmp_path)) == ("killed", odd, {})


def test_what_is_not_asked_is_a_test() -> None:
    texts = [path.read_text() for path in (Path(__file__).parents[2] / "cocotb_tests").glob("test_*.py")]
    for name in NOT_ASKED:
        assert sum(f"def {name}(" in text for text in texts) == 1


def test_tests_without_a_simulation_see_the_mutant() -> None:
    # A process that imports everything: some seconds.
    still = "tests/flow/test_still.py::test_a_block_that_is_not_awake_stands_still"
    tests = [f"{still}[{block}]" for block in ("eskin_row-lcs", "eskin_arbiter-lcs")]
    assert first_failed(tests, the("arbiter", "self.awake.eq(", "*[]")) == tests[1]


def test_a_campaign_judges_keeps_and_goes_on(tmp_path: Path) -> None:
    # A process of its own, since it runs pytest itself: some seconds.
    command = [sys.executable, "-m", "flow", "mutants", "--block", "link", "--limit", "5", "-o", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    line = (
        "mutants: 5, 0 of them proved equivalent, 0 argued; of the others 5 killed (100.0 %), "
        "by the quick check alone 100.0 %; 0 alive"
    )
    assert done.stdout.splitlines()[-1] == line
    kept = json.loads((tmp_path / "mutants.json").read_text())
    assert (kept["total"], kept["killed"], kept["survivors"]) == (5, 5, [])
    log = (tmp_path / "findings.jsonl").read_text()
    (tmp_path / "findings.jsonl").write_text(log.rstrip()[:-20])  # as one that was stopped while it wrote
    assert len(list(read(tmp_path / "findings.jsonl"))) == 4
    again = subprocess.run([*command, "--workers", "2"], capture_output=True, text=True)  # the one that is left, apart
    assert again.returncode == 0, again.stdout[-2000:] + again.stderr[-2000:]
    assert again.stdout.splitlines()[-1] == line
    assert again.stdout.count("killed ") == 2  # it, and those of the last line
    assert len(list(read(tmp_path / "findings.jsonl"))) == 5


def test_a_crew_gets_pieces_of_a_program_each() -> None:
    drawn = [Change(f"{n}", file, "", "", start=n) for n in range(50) for file in ("link", "decay")]
    found = list(pieces(drawn))
    assert [(len(piece), {change.file for change in piece}) for piece in found] == [
        (48, {"link"}),
        (2, {"link"}),
        (48, {"decay"}),
        (2, {"decay"}),
    ]
    assert sorted(change.name for piece in found for change in piece) == sorted(change.name for change in drawn)


def test_a_piece_that_fails_ends_the_campaign_with_its_words() -> None:
    missing = asdict(Change("x", "link", "no such text", "", start=0))
    with pytest.raises(RuntimeError, match="a piece of the campaign failed: Traceback"):
        judge([missing | {"file": "no_such_file"}], [], 1)


def test_the_closing_line_counts_what_lives_and_what_is_left() -> None:
    verdicts = ["killed", "killed", "killed", "alive", "equivalent", "stillborn", "argued"]
    findings = [Finding("", "", "", "", "", verdict, quick=n < 2) for n, verdict in enumerate(verdicts)]
    assert Counter(verdicts)["stillborn"] == 1
    assert closing_line(findings, 9) == (
        "mutants: 6, 1 of them proved equivalent, 1 argued; of the others 3 killed (75.0 %), by the quick check alone "
        "50.0 %; 1 alive, 2 not yet judged"
    )
