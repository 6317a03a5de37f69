"""Sentences that give results say what the data say, and no page gives a result that no data give."""

from __future__ import annotations

import datetime
import json
import re
import tomllib
from pathlib import Path

import pytest

from docs.tables import claims
from docs.tables.__main__ import PAGES, ROOT
from docs.tables.claims import CLAIMS, mended, place, plain, unbound, words_of

FREE = tomllib.loads((Path(__file__).parent / "free.toml").read_text())
ANYWHERE = set(FREE.pop("anywhere"))
MADE = {
    "docs/reference/commands.md": "from --help",
    "docs/reference/registers.md": "from the description of the registers",
    "docs/tutorial.md": "by running it",
}
"""Pages that are made as a whole, each with what of; other tests hold them to it."""

BOUND = sorted({str(path.relative_to(ROOT)) for path in PAGES} - set(MADE))

SOURCES = {
    "docs/data/architecture.json": "made from the code, and held to it",
    "docs/data/event_rates.json": "published rates beside ours, which are held to model/power/event_rates.json",
    "docs/data/asic/low_power.json": "the netlist from before, with its source in the specification",
    "snn/figures/published_fig9.json": "published",
}
"""Files of data that no command wrote, each with where it is from."""
REPORTS = [
    path
    for folder in ("docs/data", "snn/figures", "benchmarks/results")
    for path in sorted((ROOT / folder).rglob("*.json"))
    if str(path.relative_to(ROOT)) not in SOURCES
]


def free(page: str) -> set[str]:
    """Return the words of a page with numbers that are no results."""
    return {words for kind in FREE.get(page, {}).values() for words in kind}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_stands_in_its_page_as_the_data_have_it(name: str) -> None:
    page, build = CLAIMS[name]
    text = plain((ROOT / page).read_text())
    missing = [words for words in words_of(build) if not place(words).search(text)]
    assert not missing, f"{page} does not say what the data say; run python -m docs.tables, or write: {missing}"


@pytest.mark.parametrize("page", BOUND)
def test_every_number_of_a_page_is_bound_to_data_or_no_result(page: str) -> None:
    left = unbound(page, free(page), ANYWHERE)
    assert not left, f"{page}: bind {left} by a claim of docs/tables/claims, or name them in tests/docs/free.toml"


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_a_report_says_command_commit_and_date(path: Path) -> None:
    kept = json.loads(path.read_text())
    for said in kept.get("runs", [kept]) if "command" not in kept else [kept]:
        assert said.get("command") or said["commands"]
        assert re.match("[0-9a-f]{7}", said["commit"])
        assert datetime.date.fromisoformat(said["date"])


def test_every_page_with_words_that_are_free_is_there() -> None:
    assert {ROOT / page for page in (*FREE, *MADE)} <= set(PAGES)


def test_a_number_that_nobody_accounts_for_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = "It takes -3.5 nW, in `2` cells, of 12 b.\n\n    make 7\n\n    | 8 |\n\nSee [5](6.md) of 9 x 9."
    (tmp_path / "README.md").write_text(text)
    monkeypatch.setattr(claims, "ROOT", tmp_path)
    monkeypatch.setattr(claims, "CLAIMS", {})
    assert unbound("README.md", {"12 b"}, {r"\d+ x \d+"}) == ["-3.5", "8", "5"]
    with pytest.raises(ValueError, match="does not say '13 b'"):
        unbound("README.md", {"13 b"})


@pytest.mark.parametrize(
    ("text", "there"), [("it takes 3.5 nW", True), ("it takes 13.5 nW", False), ("2 3.5 nW.", True)]
)
def test_a_number_is_not_found_within_a_longer_one(text: str, there: bool) -> None:
    assert bool(place("3.5 nW").search(text)) is there
    assert not place("takes 3").search(text)


def test_a_claim_whose_numbers_have_changed_is_mended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "CLAIMS", {"a": ("README.md", lambda: iter(["takes 3.5 nW, of 2,000 cells"]))})
    assert mended("README.md", "It takes 4 nW,\nof\n999 cells; 7.") == "It takes 3.5 nW,\nof\n2,000 cells; 7."
    twice = "takes 1 nW, of 2 cells; takes 3 nW, of 4 cells"
    assert mended("README.md", twice) == twice
