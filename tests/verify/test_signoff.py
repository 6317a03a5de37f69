"""Test the sign-off: its commands exist, it continues, names what fails, and writes one table."""

import json
from pathlib import Path
from typing import Any

import pytest

from eskin.model.encoders.registry import NAMES
from eskin.verify import signoff
from eskin.verify.signoff import Plan, StepFailed, rows, steps
from tests.docs.test_commands import problem_of


@pytest.mark.parametrize("small", [True, False])
def test_every_step_is_a_command_that_the_program_takes(
    small: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[list[str]] = []
    monkeypatch.setattr(signoff, "_run", lambda plan, _, words: given.append([*words, *plan.engine]))
    monkeypatch.setattr(signoff, "_faults", lambda _: None)
    made = steps(Plan(tmp_path, small, 1.0, None, 2, None))
    assert {"formal", "coverage", "soak", "faults", *(f"replay {name}" for name in NAMES)} <= made.keys()
    for step in made.values():
        step()
    assert len(given) == len(made) - 1
    assert [problem_of(words, whole=True) for words in given] == [""] * len(given)
    assert all(words[-2:] == ["--workers", "2"] for words in given)


@pytest.mark.command("signoff")
@pytest.mark.quick
def test_a_sign_off_continues_and_names_what_failed(call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    broken = ["coverage"]

    def run(plan: Plan, name: str, _: list[str]) -> str:
        ran.append(name)
        if name in broken:
            raise StepFailed("1 problem; see the log")
        report = {"result": f"{name}: good", "command": "make it", "commit": "1234", "date": "2026-01-02"}
        if not name.startswith("replay"):
            (plan.out / f"{name}.json").write_text(json.dumps(report))
        return f"{name}: good"

    monkeypatch.setattr(signoff, "_run", run)
    stated = {"result": "faults: 250 upsets, 0 beyond what is stated", "problems": []}
    monkeypatch.setattr(signoff, "campaign", lambda parts, *_: ran.append("faults") or stated)
    code, out, _ = call("dev signoff --small --workers 1 --out so")
    assert code == 1
    assert "coverage" in out
    assert "1 problem; see the log" in out
    assert out.splitlines()[-1].startswith(f"sign-off: {len(ran) - 1} of {len(ran)} steps passed, ")
    first = list(ran)
    ran.clear()
    broken.clear()
    code, out, _ = call("dev signoff --small --workers 1 --out so")
    assert (code, ran) == (0, ["coverage"]), "the others are finished"
    assert {*first} > {*ran}
    table = json.loads(Path("so/signoff.json").read_text())["rows"]
    assert [row["kind"] for row in table] == ["proved", "covered", "random runs", "faults"]
    assert table[3]["result"] == stated["result"]
    stated["result"] = "faults: 250 upsets, 10 beyond what is stated"
    monkeypatch.setattr(signoff, "version", lambda _: "other sources")
    ran.clear()
    code, out, _ = call("dev signoff --small --workers 1 --out so")
    assert (code, ran) == (1, first), "other sources are checked again"
    assert "10 beyond what is stated; see so/faults.json" in out


def test_replays_of_all_encoders_are_one_row(tmp_path: Path) -> None:
    run = {"images": 3, "events": 1000, "commit": "a", "date": "2026-01-01"}
    (tmp_path / "replay.json").write_text(json.dumps({"runs": [run, run | {"commit": "b", "date": "2026-01-02"}]}))
    (row,) = rows(tmp_path)
    assert row["result"] == "replay: 6 scans with 2 encoders, 2,000 events, 0 mismatches"
    assert (row["commit"], row["date"]) == ("a, b", "2026-01-01, 2026-01-02")
