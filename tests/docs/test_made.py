"""Test that generated pages match data and commands, and that reports contain their origin."""

import datetime
import inspect
import json
import re
from pathlib import Path

import pytest

from docs import tables
from docs.tables.__main__ import PAGES, main

ROOT = Path(__file__).parents[2]
ROOMS = {path.name for path in ROOT.iterdir() if path.is_dir() and path.name.isidentifier()} - {"out", "build", "dist"}
SOURCES = {
    "docs/data/event_rates.json": "published rates beside ours, which are compared with those of the power model",
    "docs/data/asic/memories-ihp.json": "Liberty files of IHP's design kit, each named with its commit",
    "docs/data/classifier/peers.json": "published, each with its source",
    "docs/data/published_fig9.json": "published",
}
"""Files of data that no command wrote, each with where it is from."""
REPORTS = [
    path
    for folder in ("docs/data", "benchmarks/results")
    for path in sorted((ROOT / folder).rglob("*.json"))
    if str(path.relative_to(ROOT)) not in SOURCES
]


def test_generated_text_is_that_of_data_commands_and_registers() -> None:
    assert main(["--check", "--diff"]) == 0, "run make docs, or python -m docs.tables"


def test_a_number_that_differs_from_the_data_is_found(tmp_path: Path) -> None:
    page = tmp_path / "README.md"
    text, changed = re.subn(r"\d(?= mismatches)", "7", (ROOT / "README.md").read_text())
    page.write_text(text)
    assert changed
    assert main(["--check"], [str(page)]) == 5


GENERATED = re.compile(r"<!-- \[\[\[cog.*?\[\[\[end]]] -->", re.DOTALL)
COMPARED = re.compile(r"(?:more|less|as) accurate|(?:is|are|not) significant\b")


def test_accuracies_are_compared_only_where_the_data_are() -> None:
    found = {page.name: COMPARED.findall(GENERATED.sub("", page.read_text())) for page in PAGES}
    assert {name: words for name, words in found.items() if words} == {}, "generate the sentence: docs/tables/claims.py"


def test_a_comparison_is_judged_by_mcnemar_and_holm() -> None:
    assert tables.holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    labels, wrong = "0" * 40, ["1" * 9 + "0" * 31, "0" * 40]
    answers = {
        "two seeds": tables.Answers(labels, wrong, ["0" * 40, "0" * 40]),  # p is 2 * 2**-9 and 1
        "one seed": tables.Answers(labels, wrong[:1], ["0" * 40]),
        "the other way": tables.Answers(labels, ["0" * 40], wrong),
    }
    claims = tables.compared(answers)
    assert [claim.p for claim in claims.values()] == pytest.approx([(2**-8 + 1) / 2, 3 * 2**-8, 3 * 2**-8])
    assert [claim.verdict for claim in claims.values()] == ["", "more", "less"]
    assert claims["two seeds"].difference == pytest.approx(9 / 80)
    assert tables.counted(claims.values()) == {"of": 3, "more": 1, "less": 1}


def test_the_stored_predictions_are_those_of_the_first_table() -> None:
    folder = "docs/data/"
    of_seeds = {point["name"]: point for point in tables.read(f"{folder}sweeps/paper-network.json")["points"]}
    for point in tables.read(f"{folder}classifier/nlcs/seed-0.json")["points"]:
        (word,) = point["last"]["predictions"]
        right = sum(a == b for a, b in zip(word, point["labels"], strict=True)) / len(word)
        assert right == pytest.approx(of_seeds[point["name"]]["last"]["accuracy_of_seeds"][0])


def test_every_table_stands_somewhere() -> None:
    blocks = [block for page in PAGES for block in re.findall(r"\[\[\[cog (.*) ]]]", page.read_text())]
    functions = [f for f in vars(tables).values() if inspect.isfunction(f) and f.__module__.startswith("docs.")]
    made = {f.__name__ for f in functions if f.__annotations__["return"] in ("None", "Rows")}
    assert made <= set(re.findall(r"\w+", " ".join(blocks)))


def test_the_rates_are_those_that_the_power_model_reads() -> None:
    for point in tables.read("docs/data/event_rates.json")["points"]:
        stored = tables.array_hz("kylberg", "paper", point["encoding"], point["resolution"])
        assert stored == pytest.approx(point["here_hz"], rel=1e-4)


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_a_report_says_command_commit_and_date(path: Path) -> None:
    report = json.loads(path.read_text())
    made_by = [report] if {"command", "commands"} & set(report) else report.get("runs") or report.values()
    for run in made_by:
        assert run.get("command") or run["commands"]
        assert re.match("[0-9a-f]{7}", run["commit"])
        assert datetime.date.fromisoformat(run["date"])


def test_every_file_that_the_documents_name_is_there() -> None:
    named = re.compile(rf"`((?:{'|'.join(ROOMS)})/[\w./-]*)`")
    for page in [*PAGES, ROOT / "CONTRIBUTING.md"]:
        for name in named.findall(page.read_text()):
            assert (ROOT / name).exists(), f"{page.name} names {name}"


def test_the_rooms_in_the_picture_are_those_of_the_imports() -> None:
    from docs.figures.architecture import house

    graph = house()
    assert {("rtl", "model"), ("app", "snn")} <= set(graph.edges)
    assert ("model", "rtl") not in graph.edges
    assert set(graph.nodes) >= {"base", "model", "rtl", "skin", "snn", "board", "flow", "verify", "app"}
