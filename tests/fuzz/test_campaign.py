"""Fuzz campaign: random damage to every file, random values for every option.

The gate tries a few, always the same; ``python -m tests.fuzz 5000`` tries many, drawn anew, and keeps what it
counted in docs/data/verification/fuzz.json.
"""

import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from eskin.app.catalogue import COMMANDS
from eskin.base.errors import InputError
from eskin.base.files import write_json
from tests.fuzz import corpus
from tests.fuzz import run as limits
from tests.fuzz.attacks import ATTACKS, clean
from tests.fuzz.cases import FILES, GOOD
from tests.fuzz.run import CASES, COUNTS, SEED, Seen, complaint, run_command

CHEAP = 12
"""Cases of an attack that needs no command and no parser, for each other case of a long campaign."""
SLOW = ("files", "options", "liberty")

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


class Campaign:
    """Runner of an attack that counts outcomes, and keeps one case of every kind of failure."""

    def __init__(self, name: str, root: Path) -> None:
        self.name, self.root = name, root
        self.codes: Counter[int | None] = Counter()
        self.of: dict[str, Counter[str]] = {"reader": Counter(), "command": Counter()}
        self.distinct: set[int] = set()
        self.wrong: dict[str, str] = {}

    def run(self, data: st.DataObject) -> None:
        values: list[Any] = []

        def draw(strategy: Any) -> Any:
            values.append(data.draw(strategy))
            return values[-1]

        try:
            code = ATTACKS[self.name](draw, self.root) or 0
        except InputError as refused:
            code = 2
            if not str(refused):
                self.wrong.setdefault("no sentence", f"{values}"[:1500])
        except Exception:
            code = 1
            last = traceback.format_exc()
            self.wrong.setdefault(last.strip().splitlines()[-1][:60], f"{values}\n{last}"[-1500:])
        self.codes[code] += 1
        self.distinct.add(hash(repr(values)))
        if self.name == "files":
            self.of["reader"][Path(values[0]).name] += 1
        if self.name in ("files", "options"):
            command = values[1] if self.name == "files" else values[0]
            self.of["command"][command[0]] += 1

    def end(self) -> None:
        """Fail if a case failed, or if the campaign exercised too little."""
        if COUNTS:
            counts: dict[str, Any] = {"cases": self.codes.total(), "distinct in their piece": len(self.distinct)}
            counts |= {"refused": self.codes[2], "right or different": self.codes[0] + self.codes[1]}
            counts |= {"wrong": len(self.wrong)}
            counts |= {f"by {what}": dict(sorted(counter.items())) for what, counter in self.of.items() if counter}
            write_json(COUNTS / f"fuzz-{self.name}.json", counts)
        assert not self.wrong, f"{len(self.wrong)} kinds of wrong ends:\n" + "\n".join(self.wrong.values())
        assert self.codes.total() >= CASES // 2
        assert self.codes[2] > self.codes.total() // 20, self.codes


def test_only_commands_that_always_take_long_are_left_out() -> None:
    left_out = {found.heading for name, found in COMMANDS.items() if name not in GOOD}
    assert left_out == {"Hardware", "Checks of the project"}


@pytest.mark.parametrize("name", sorted(FILES))
def test_the_corpus_is_good(root: Path, name: str) -> None:
    for arguments in FILES[name]:
        clean(root)
        seen = run_command(tuple(f"good/{name}" if word == "{}" else word for word in arguments))
        assert seen.code == 0, f"{arguments}: {seen.err}{seen.crash}"


@pytest.mark.filterwarnings("error::numpy.exceptions.ComplexWarning")  # half of a number is dropped
@pytest.mark.parametrize("name", ATTACKS)
def test_attacks(name: str, root: Path, tmp_path: Path) -> None:
    found = Campaign(name, root if name in ("files", "options") else tmp_path)

    @settings(campaign, max_examples=CASES * (CHEAP if name not in SLOW and COUNTS else 1))
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        found.run(data)

    (attack if SEED is None else seed(SEED)(attack))()
    found.end()


@pytest.mark.parametrize("swallowed", [False, True])
def test_a_loop_without_end_is_ended(monkeypatch: pytest.MonkeyPatch, swallowed: bool) -> None:
    monkeypatch.setattr(limits, "LONGEST_CPU_S", 0.2)
    monkeypatch.setattr(limits, "AGAIN_S", 0.1)
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
    assert "still running after" in run_command(("endless",)).crash


def test_a_defect_would_be_found(root: Path) -> None:
    """Check that the judge of outcomes reports each kind of defect."""
    command = ("decode", "x")
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
