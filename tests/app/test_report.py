"""Test the report: correct numbers, no external resources, and no code from input files."""

import base64
import contextlib
import html.parser
import json
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.report.data import load_accuracy, load_benchmarks, load_runs
from eskin.app.report.page import BENCHMARKS, run_section, runs_in
from eskin.base.errors import InputError
from eskin.base.units import with_unit
from eskin.model.address_events import Events, make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.power.explore import explore_data
from tests.app.test_power import FIGURES, MODELS, REPORT
from tests.conftest import run_eskin

CONFIG = ReadoutConfig(rows=2, columns=3, encoding="lcs", resolution=4)
EVIL = "</script><script>alert(1)</script>"
GOOD = {"data_rate_bps": 2e4, "accuracy": 0.9}
POINTS = {
    "source": EVIL,
    "points": [
        GOOD | {"readout": "lcs", "resolution": 2, "interval": [0.8, 0.95]},
        {"readout": "frame", "label": "frame, 10 b", "data_rate_bps": 1.28e7, "accuracy": 0.97},
        *[GOOD | {"readout": EVIL, "label": EVIL, "title": r"$\frac", "detail": "$_$", "preset": "$^"}] * 2,
    ],
}
FILES = "--synthesis gates.json --accuracy points.json --benchmarks bench"
CLOCKS = 6400
UNROUNDED = re.compile(r"\d\.\d{6,}|\d[eE][+-]?\d")


def some_events(count: int = 300, seed: int = 0) -> Events:
    """Return random events for CONFIG, in order."""
    random = np.random.default_rng(seed)
    t = np.sort(random.integers(0, CLOCKS, count))
    return make_events(t, random.integers(0, 2, count), random.integers(0, 3, count), random.random(count) < 0.5)


def write_run(folder: Path, rtl: Events, model: Events, model_config: ReadoutConfig = CONFIG) -> None:
    folder.mkdir(parents=True)
    Recording(rtl, CONFIG, CLOCKS, metadata={"name": EVIL + r"$\frac"}).save(folder / "rtl.npz")
    Recording(model, model_config, CLOCKS).save(folder / "model.npz")


def data_of(text: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    return json.loads(found[1])


def report(folder: Path, options: str, out: str = "report.html") -> str:
    """Return the page that the command writes in a folder."""
    with contextlib.chdir(folder):
        assert run_eskin("report", "-o", out, *options.split()).returncode == 0
    return (folder / "report.html").read_text()


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one example of everything that the report can show."""
    folder, events = tmp_path_factory.mktemp("full"), some_events()
    write_run(folder / "sim" / "a&b", events, events)
    write_run(folder / "sim" / "other-whose-name-is-much-longer-than-a-phone-is-wide", events, np.delete(events, 7))
    summary = {"dataset": "d", "preset": "physical", "images": 3, "clocks": 99, "events": 1234, "mismatches": 0}
    (folder / "replay" / "a").mkdir(parents=True)
    (folder / "replay" / "a" / "summary.json").write_text(json.dumps(summary | {"configuration": CONFIG.to_dict()}))
    (folder / "gates.json").write_text(json.dumps(REPORT))
    (folder / "points.json").write_text(json.dumps(POINTS))
    (folder / "bench").mkdir()
    ratio = {"name": EVIL, "times_the_copy": {"median": 2.0}}
    (folder / "bench" / "a.json").write_text(json.dumps({"results": [ratio]}))
    return folder


@pytest.fixture(scope="module")
def full(place: Path) -> str:
    return report(place, f"--sim sim --replay replay {FILES}")


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the page of an empty project."""
    return report(tmp_path_factory.mktemp("bare"), "")


# -- the data ----------------------------------------------------------------------------------------


def test_the_figures_hold_the_models_numbers(bare):
    data = data_of(bare)
    for name, figure in FIGURES.items():
        assert data[name] == json.loads(json.dumps(figure()))
    assert data["explore"] == json.loads(json.dumps(explore_data(MODELS["consistent"], 1e-3, 0.2)))


def test_runs_say_whether_rtl_and_model_are_equal(full):
    equal, other = data_of(full)["raster"]
    assert equal["equal"] is True
    assert equal["verdict"] == "RTL equals model: all 300 events, in clock, row, column and polarity"
    assert (equal["events_rtl"], equal["events_model"]) == (300, 300)
    assert other["equal"] is False
    assert other["verdict"].startswith("RTL DIFFERS from model: ")
    assert (other["events_rtl"], other["events_model"]) == (300, 299)
    assert full.count("RTL DIFFERS") == 3  # above the raster, in the table, in the data


def test_runs_without_events_have_a_raster_and_interrupted_runs_are_named(tmp_path):
    for name in ("a", "b"):
        write_run(tmp_path / name, some_events(0), some_events(0))
    (tmp_path / "b" / "model.npz").unlink()
    (found,), missing = load_runs(tmp_path)
    assert (found.name, found.equal) == ("a", True)
    assert 'alt="Raster of a"' in run_section(found)
    assert missing == ["b has no model.npz, so it is not shown; run make sim to the end."]


def test_without_inputs_the_model_is_shown_and_every_missing_piece_is_named(bare, full):
    runs, missing = data_of(bare)["raster"], data_of(bare)["missing"]
    assert [run["name"] for run in runs] == ["8x8-lcs-6b", "8x8-nlcs-6b"]
    for found in runs:
        assert (found["equal"], found["events_rtl"]) == (None, None)
        assert found["events_model"] > 1000
        assert found["verdict"].startswith("model alone")
    for section, remedy in {"raster": "make sim", "replay": "make replay", "synthesis": "--synthesis"}.items():
        assert any(remedy in sentence for sentence in missing[section])
        assert all(sentence in bare for sentence in missing[section])
    assert set(data_of(full)["missing"]) <= {"benchmarks"}  # a result without ratios is named


@pytest.mark.parametrize("inner", ["", "sim"])
def test_the_runs_of_another_out_are_found(tmp_path, inner):
    (tmp_path / inner).mkdir(exist_ok=True)
    assert runs_in(tmp_path) == (tmp_path / inner, tmp_path)


def test_benchmark_ratios_are_those_of_the_files():
    ratios, _ = load_benchmarks(BENCHMARKS)
    written = json.loads((BENCHMARKS / "cosim.json").read_text())["results"]
    assert written
    for result in written:
        row = {"name": f"cosim: {result['name']}", "ratio": "of bare loop"} | result["of_bare_loop"]
        assert {key: row[key] for key in ("name", "ratio", "median", "least", "most")} in ratios


def test_every_candidate_of_a_benchmark_has_its_ratio(tmp_path):
    result = {"steps": 200, "candidates": {"a": {"times_the_limit": 2.5, "equal": True}, "b": {"times_the_limit": 9}}}
    (tmp_path / "network.json").write_text(json.dumps({"results": [result, result]}))
    ratios, missing = load_benchmarks(tmp_path)
    wanted = [("network 1: a", 2.5), ("network 1: b", 9), ("network 2: a", 2.5), ("network 2: b", 9)]
    assert ratios == [{"name": name, "ratio": "times the limit", "median": value} for name, value in wanted]
    assert missing == []


# -- the page ----------------------------------------------------------------------------------------


class Tags(html.parser.HTMLParser):
    """HTML parser that checks nesting, and collects tags with their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in ("meta", "link", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_accessible(full):
    tags = Tags(full).found
    ids = [values["id"] for _, values in tags if values.get("id")]
    assert len(ids) == len(set(ids))
    assert {str(values["href"])[1:] for tag, values in tags if tag == "a"} <= set(ids)
    headings = [int(tag[1]) for tag, _ in tags if re.fullmatch("h[1-6]", tag)]
    assert (headings[0], headings.count(1)) == (1, 1)
    assert all(b - a <= 1 for a, b in pairwise(headings))
    assert full.count("<table>") == full.count("<caption>") == 5
    assert full.count("<img ") == full.count("<img alt=") == 7


def test_pictures_are_embedded_and_the_page_loads_and_runs_nothing(full):
    loads = [
        str(value)
        for tag, values in Tags(full).found
        for name, value in values.items()
        if name in ("src", "srcset", "data", "poster") or (name, tag) == ("href", "link")
    ]
    pictures = [text.partition(",")[::2] for text in loads if text != "data:,"]
    assert Counter(kind for kind, _ in pictures) == {"data:image/png;base64": 2, "data:image/svg+xml;base64": 5}
    for kind, text in pictures:
        content = base64.b64decode(text, validate=True)
        assert content.startswith(b"\x89PNG" if "png" in kind else b"<?xml")
        assert b"<script" not in content
    assert not re.findall(r"https?://|@import|url\(", full)
    assert "default-src 'none'; style-src 'unsafe-inline'; img-src data:" in full
    assert re.findall("<script[^>]*>", full) == ['<script type="application/json" id="data">']


def test_the_page_has_no_machine_paths_and_is_the_same_every_time_also_for_a_folder_of_runs(full, place):
    assert str(place) not in full
    assert str(Path(__file__).parents[2]) not in full
    (place / "report.html").unlink()
    assert report(place, FILES, ".") == full


def test_numbers_are_rounded_for_people_and_kept_whole_in_the_data(full):
    seen = re.sub(r"<(script|style)\b.*?</\1>|base64,[^\"]*", "", full, flags=re.DOTALL)
    assert UNROUNDED.findall(seen) == []
    for cell in ("20 kbit/s", "80.0\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}95.0", "100,000 um^2", "100 fJ"):
        assert f"<td>{cell}</td>" in seen
    assert UNROUNDED.search(json.dumps(data_of(full)["fig6"]))


def test_units():
    values = (0, 0.0009236708571873865, 0.9996, 0.9994, -1234.5, 1e-20, 2.5e16, float("inf"), float("nan"))
    texts = ("0 V", "924 uV", "1 V", "999 mV", "-1.23 kV", "0.01 aV", "25,000 TV", "inf V", "nan V")
    assert tuple(with_unit(value, "V") for value in values) == texts


def test_text_from_files_cannot_leave_its_place(full):
    assert EVIL not in full
    assert data_of(full)["benchmarks"][0]["name"] == f"a: {EVIL}"
    assert data_of(full)["raster"][0]["texture"].startswith(EVIL)
    assert "a&amp;b" in full


# -- bad input ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--synthesis none.json", "cannot read the synthesis report none.json: No such file or directory"),
        ("--synthesis broken.json", "the synthesis report broken.json is not JSON"),
        ("--accuracy broken.json", "the accuracy results broken.json is not JSON"),
        ("--accuracy none.json", "cannot read the accuracy results none.json: there is no such file"),
        ("--benchmarks broken", "the benchmark result broken/a.json is not JSON"),
        ("--benchmarks none", "none is not a folder; give a folder, or leave the option out"),
        ("-o nowhere", "the report is an HTML page and ends in .html, but nowhere does not; rename the output"),
        ("--sim other-array", "a: rtl.npz is of a 2 x 3 array, model.npz of 3 x 3; run make sim again for this array"),
        ("--sim other-bits", "a: rtl.npz has resolution 4, model.npz 5; run make sim again for one of them"),
        ("--sim damaged", "damaged/a/rtl.npz is damaged or not an event file"),
        ("--replay damaged", "the summary of make replay damaged/a/summary.json is damaged: dataset is missing"),
        ("--replay other-bits", "summary of make replay other-bits/a/summary.json is damaged: it is no object; delete"),
    ],
)
def test_bad_input_gets_one_sentence_and_leaves_nothing(refuses, folder, options, sentence):
    write_run(folder / "other-array" / "a", some_events(), some_events(), CONFIG.replace(rows=3))
    write_run(folder / "other-bits" / "a", some_events(), some_events(), CONFIG.replace(resolution=5))
    write_run(folder / "damaged" / "a", some_events(), some_events())
    (folder / "damaged" / "a" / "rtl.npz").write_bytes(b"PK\x03\x04 cut off")
    (folder / "damaged" / "a" / "summary.json").write_text("{}")
    (folder / "other-bits" / "a" / "summary.json").write_text("[]")
    (folder / "broken.json").write_text('{"points": [')
    (folder / "broken").mkdir()
    (folder / "broken" / "a.json").write_text("{")
    (folder / "report.html").write_text("the old one")
    refuses(sentence, "report -o report.html", options)
    assert (folder / "report.html").read_text() == "the old one"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"points": [GOOD | {"accuracy": 91}]}, r"point 0 needs accuracy, a number in 0\.\.1, not 91"),
        ({"points": [GOOD | {"accuracy": True}]}, r"point 0 needs accuracy, a number in 0\.\.1, not True"),
        ({"points": [GOOD | {"data_rate_bps": 0}]}, "point 0 needs data_rate_bps, a positive number of bit/s, not 0"),
        ({"points": [GOOD | {"data_rate_bps": "x"}]}, "needs data_rate_bps, a positive number of bit/s, not 'x'"),
        ({"points": [GOOD | {"interval": [0.1]}]}, r"point 0 has an interval that is not \[low, high\]"),
        ({"points": [1]}, "point 0 is not an object"),
        ({"points": []}, "need a list of points"),
        ({}, "need a list of points"),
        ([], "must be a JSON object"),
    ],
)
def test_bad_points_are_refused(tmp_path, values, sentence):
    (tmp_path / "a.json").write_text(json.dumps(values))
    with pytest.raises(InputError, match=sentence):
        load_accuracy(tmp_path / "a.json")


@pytest.mark.parametrize("text", ["[]", "3", "{}", '{"results": [1, {"times_the_copy": {"median": 0}}]}'])
def test_files_without_ratios_are_named(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    ratios, missing = load_benchmarks(tmp_path)
    assert ratios == []
    assert missing == [
        "a.json has no ratios, so it is not shown.",
        "There are no benchmark results with ratios here; make bench writes them.",
    ]
