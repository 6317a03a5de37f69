"""Fuzz campaign: random damage to every file, random values for every option.

The gate tries a few, always the same; ``python -m tests.fuzz 5000`` tries many, drawn anew, and keeps what it
counted in docs/data/verification/fuzz.json.
"""

from __future__ import annotations

import os
import shutil
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.base.files import write_json
from tests.fuzz import corpus
from tests.fuzz import run as limits
from tests.fuzz.attacks import ATTACKS
from tests.fuzz.cases import FILES, GOOD, commands, hostile_commands, hostile_files
from tests.fuzz.run import Command, Seen, complaint, run_command, tree

CASES, SEED, COUNTS = 60, None, None
if piece := os.environ.get("ESKIN_FUZZ"):
    cases, number, folder = piece.split(" ", 2)
    CASES, SEED, COUNTS = int(cases), int(number), Path(folder)
"""For a piece of a long campaign: cases, seed, and the folder for the log of all cases and for the counts."""
CHEAP = 12
"""Cases of an attack that needs no command and no parser, for each other case of a long campaign."""

campaign = settings(
    max_examples=CASES,
    deadline=None,
    derandomize=SEED is None,
    suppress_health_check=list(HealthCheck),
    database=None,
    phases=[Phase.generate],  # every case is small, and all that is wrong shall be told at once
)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the corpus in ``good``."""
    root = tmp_path_factory.mktemp("fuzz")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        corpus.make(root)
    return root


@pytest.fixture(autouse=True)
def here(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    monkeypatch.delenv("ESKIN_DATA", raising=False)


def clean(root: Path) -> None:
    """Remove all files except the corpus."""
    for path in root.iterdir():
        if path.name != "good":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def drawn(attack: Callable[[], None]) -> None:
    """Run a fuzz function, with the seed of a piece."""
    (attack if SEED is None else seed(SEED)(attack))()


def note(command: Command) -> None:
    """Write a command to the log before it runs."""
    if COUNTS:
        with (COUNTS / "log.txt").open("a") as log:
            log.write(f"{time.strftime('%H:%M:%S')} {command}"[:2000] + "\n")


class Campaign:
    """Runner that counts outcomes, and stores one case per failure."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.codes: Counter[int | None] = Counter()
        self.of: dict[str, Counter[str]] = {"reader": Counter(), "command": Counter()}
        self.distinct: set[int] = set()
        self.wrong: dict[str, str] = {}

    def run(self, command: Command, reader: str = "", content: bytes = b"") -> None:
        self.of["command"][command.arguments[0]] += 1
        if reader:
            self.of["reader"][reader] += 1
        self.distinct.add(hash((command, content)))
        before = tree(self.root)
        note(command)
        seen = run_command(command)
        self.codes[seen.code] += 1
        if wrong := complaint(command, seen, before, tree(self.root)):
            last = wrong.strip().splitlines()
            kept = f"{str(command)[:400]}\n    " + "\n    ".join(last[-3:])
            self.wrong.setdefault(f"{command.arguments[0]} {last[-1][:40]}", kept[:1500])

    def attack(self, name: str, data: st.DataObject) -> None:
        """Run a function of ``tests.fuzz.attacks``."""
        values: list[Any] = []

        def draw(strategy: Any) -> Any:
            values.append(data.draw(strategy))
            return values[-1]

        try:
            ATTACKS[name](draw, self.root)
            code = 0
        except InputError as refused:
            code = 2
            if not str(refused):
                self.wrong.setdefault(f"{name} no sentence", f"{values}"[:1500])
        except Exception:
            code = 1
            last = traceback.format_exc()
            self.wrong.setdefault(f"{name} {last.strip().splitlines()[-1][:40]}", f"{values}\n{last}"[-1500:])
        self.codes[code] += 1
        self.distinct.add(hash(repr(values)))

    def end(self, name: str) -> None:
        """Fail if a case failed, or if the campaign exercised too little."""
        if COUNTS:
            counts: dict[str, Any] = {"cases": self.codes.total(), "distinct in their piece": len(self.distinct)}
            counts |= {"refused": self.codes[2], "right or different": self.codes[0] + self.codes[1]}
            counts |= {"wrong": len(self.wrong)}
            counts |= {f"by {what}": dict(sorted(counter.items())) for what, counter in self.of.items() if counter}
            write_json(COUNTS / f"fuzz-{name}.json", counts)
        assert not self.wrong, f"{len(self.wrong)} kinds of wrong ends:\n" + "\n".join(self.wrong.values())
        assert self.codes.total() >= CASES // 2
        assert self.codes[2] > self.codes.total() // 20, self.codes


def test_every_command_and_every_reader_has_a_place_in_the_campaign() -> None:
    assert set(GOOD) == set(commands())


@pytest.mark.parametrize("name", sorted(FILES))
def test_the_corpus_is_good(root: Path, name: str) -> None:
    for arguments in FILES[name]:
        clean(root)
        seen = run_command(Command(tuple(f"good/{name}" if a == "{}" else a for a in arguments)))
        assert seen.code == 0, f"{arguments}: {seen.err}{seen.crash}"


@pytest.mark.filterwarnings("error::numpy.exceptions.ComplexWarning")  # half of a number is dropped
def test_damaged_files(root: Path) -> None:
    ends = Campaign(root)

    @campaign
    @given(case=hostile_files(root))
    def attack(case: tuple[Command, str, bytes]) -> None:
        command, place, content = case
        clean(root)
        (root / place).parent.mkdir()
        (root / place).write_bytes(content)
        ends.run(command, Path(place).name, content)

    drawn(attack)
    ends.end("files")


def test_hostile_options(root: Path) -> None:
    ends = Campaign(root)

    @campaign
    @given(command=hostile_commands())
    def attack(command: Command) -> None:
        clean(root)
        ends.run(command)
        assert not (root / "planted").exists()

    drawn(attack)
    ends.end("options")


@pytest.mark.parametrize("name", sorted(ATTACKS))
def test_attacks_below_the_commands(name: str, tmp_path: Path) -> None:
    ends = Campaign(tmp_path)

    @settings(campaign, max_examples=CASES * (CHEAP if name != "liberty" and COUNTS else 1))
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        ends.attack(name, data)

    drawn(attack)
    ends.end(name)


@pytest.mark.parametrize("swallowed", [False, True])
def test_a_loop_without_end_is_ended(monkeypatch: pytest.MonkeyPatch, swallowed: bool) -> None:
    monkeypatch.setattr(limits, "LONGEST_CPU_S", 0.2)
    app = typer.Typer()

    @app.command()
    def endless() -> None:
        while True:
            try:
                while True:
                    pass
            except AssertionError:
                if not swallowed:
                    raise
                break  # as a broad except would; the next signal ends it
        while swallowed:
            pass

    app.command("other")(endless)
    monkeypatch.setattr(limits, "app", app)
    assert "still running after" in run_command(Command(("endless",))).crash


def test_a_defect_would_be_found(root: Path) -> None:
    """Check that the judge of outcomes reports each kind of defect."""
    command = Command(("decode", "x"))
    for seen, after in (
        (Seen(None, "", "", "Traceback ..."), {}),
        (Seen(1, "", "", ""), {}),
        (Seen(2, "", "", ""), {}),
        (Seen(2, "", "error: a\nerror: b\n", ""), {}),
        (Seen(2, "", "error: a\n", ""), {"half": 3}),
        (Seen(0, "\x1b[31m", "", ""), {}),
        (Seen(2, "", "error: not enough memory: 9 GB\n", ""), {}),
    ):
        assert complaint(command, seen, {}, after), seen
    assert not complaint(command, Seen(2, "", "error: a\n", ""), {}, {})
