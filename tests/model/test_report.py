"""Promises of the report: the page holds the model's numbers, loads nothing, and works in a real browser."""

from __future__ import annotations

import dataclasses
import html
import html.parser
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from model.config import ReadoutConfig
from model.errors import InputError
from model.events.address import Events, make_events
from model.events.recording import Recording
from model.figures.style import OFF_COLOUR, ON_COLOUR, PALETTE, PART_COLOURS, READOUT_COLOURS
from model.figures.units import with_unit
from model.power.equations import CORRECTIONS, READOUTS, PowerModel
from model.power.rates import load_tables, stored_table
from model.power.study import fig6_data, fig7_data, sensitivity_data, sensitivity_models
from model.power.synthesis import SynthesisReport
from model.report import data as gathering
from model.report.data import GRID_NOISE_V, benchmark_data, fig9_data, raster_data, replay_data, report_data
from model.report.page import ACCURACY, BENCHMARKS, page

MODELS = {"paper": PowerModel(), "consistent": PowerModel(corrections=frozenset(CORRECTIONS), measured=stored_table())}
CONFIG = ReadoutConfig(rows=2, columns=3, encoding="lcs", resolution=4)
GATES = {
    "readout": "lcs",
    "rows": 8,
    "columns": 8,
    "clock_hz": 1e6,
    "area_um2": 1e5,
    "leakage_w": 1e-7,
    "clock_power_w_per_hz": 1e-12,
    "energy_per_event_j": 1e-13,
}
POINTS = {
    "source": "invented",
    "points": [
        {"readout": "lcs", "resolution": 2, "data_rate_bps": 2e4, "accuracy": 0.9, "interval": [0.8, 0.95]},
        {"readout": "frame", "label": "frame, 10 b", "data_rate_bps": 1.28e7, "accuracy": 0.97},
    ],
}
CLOCKS = 6400
UNROUNDED = re.compile(r"\d\.\d{6,}|\d[eE][+-]?\d")


def some_events(count: int = 300, seed: int = 0) -> Events:
    """Return random events of CONFIG, in order."""
    random = np.random.default_rng(seed)
    t = np.sort(random.integers(0, CLOCKS, count))
    return make_events(t, random.integers(0, 2, count), random.integers(0, 3, count), random.random(count) < 0.5)


def write_run(folder: Path, rtl: Events, model: Events, model_config: ReadoutConfig = CONFIG) -> None:
    """Write the event files of a run of ``make sim``."""
    folder.mkdir(parents=True)
    Recording(rtl, CONFIG, CLOCKS, metadata={"name": "brick/brick-00"}).save(folder / "rtl.npz")
    Recording(model, model_config, CLOCKS).save(folder / "model.npz")


def write_everything(folder: Path) -> str:
    """Write one of everything that the report can show, and return the options that name it."""
    events = some_events()
    write_run(folder / "sim" / "equal", events, events)
    write_run(folder / "sim" / "other-whose-name-is-much-longer-than-a-phone-is-wide", events, np.delete(events, 7))
    summary = {"dataset": "d", "preset": "physical", "images": 3, "clocks": 99, "events": 1234, "mismatches": 0}
    (folder / "replay" / "a").mkdir(parents=True)
    (folder / "replay" / "a" / "summary.json").write_text(json.dumps(summary | {"configuration": CONFIG.to_dict()}))
    (folder / "gates.json").write_text(json.dumps(GATES))
    (folder / "points.json").write_text(json.dumps(POINTS))
    return "--sim sim --replay replay --synthesis gates.json --accuracy points.json"


def data_of(text: str) -> Any:
    """Return the data in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    return json.loads(found[1])


@pytest.fixture
def full(call, folder: Path) -> str:
    """Return the page of one of everything."""
    code, out, err = call(f"report -o report.html {write_everything(folder)}")
    assert (code, err) == (0, "")
    assert "wrote report.html" in out
    return (folder / "report.html").read_text()


@pytest.fixture
def bare(call) -> str:
    """Return the page where nothing was simulated, trained or synthesised."""
    code, out, _ = call("report --accuracy none.json")
    assert code == 2
    code, out, _ = call("report")
    assert code == 0
    assert out.startswith("wrote out/report.html")
    return Path("out/report.html").read_text()


# -- the data ----------------------------------------------------------------------------------------


def test_the_figures_hold_the_models_numbers(bare):
    data = data_of(bare)
    others = {f"{t.dataset} {t.preset} scan": t for t in load_tables() if (t.dataset, t.preset) != ("kylberg", "paper")}
    study = sensitivity_data(sensitivity_models(MODELS["consistent"], others))
    assert data["fig6"] == json.loads(json.dumps(fig6_data(MODELS)))
    assert data["fig7"] == json.loads(json.dumps(fig7_data(MODELS)))
    assert data["sensitivity"] == json.loads(json.dumps(study))


def test_the_grid_holds_the_models_numbers_at_every_stop(full):
    grid = data_of(full)["grid"]
    gates = {"lcs": SynthesisReport.from_dict(GATES)}
    models = {"paper": MODELS["paper"], "consistent": dataclasses.replace(MODELS["consistent"], gates=gates)}
    bits, noise = np.array(grid["resolution"])[:, None], np.array(grid["noise_v_rms"])[None, :]
    assert grid["resolution"] == list(range(1, 11))
    assert 1e-3 in grid["noise_v_rms"]
    for mode, entries in grid["modes"].items():
        found = {("lcs", 0.2): entries["lcs"], ("frame", 0.2): entries["frame"]}
        found |= {("nlcs", float(tau)): entry for tau, entry in entries["nlcs"].items()}
        assert len(found) == 5
        for (readout, tau), entry in found.items():
            expected = models[mode].breakdown(readout, bits, noise, tau)
            assert np.array_equal(entry["afe"], expected.afe)
            assert np.array_equal(entry["total"], expected.total)
            for name in ("converter", "io"):
                column = np.array(entry[name])[:, None]
                assert np.array_equal(np.broadcast_to(column, expected.total.shape), getattr(expected, name))
            assert entry["converter_parts"].keys() == expected.converter_parts.keys()


def test_fig7_notes_name_the_winner_where_there_is_no_crossover(bare):
    notes = data_of(bare)["fig7_notes"]
    assert notes["consistent"] == [
        "N-LCS, tau 2 s: spikes for N = 1 to 7, frames for N = 8 to 10",
        "N-LCS, tau 200 ms: spikes for N = 1 to 4, frames for N = 5 to 10",
        "N-LCS, tau 20 ms: frames for N = 1 to 10",
        "LCS: spikes for N = 1, frames for N = 2 to 10",
    ]


def test_rasters_hold_the_events_of_both_and_say_whether_they_are_equal(full):
    equal, other = data_of(full)["raster"]
    events = some_events()
    assert equal["equal"] is True
    assert equal["verdict"] == "RTL equals model: all 300 events, in clock, row, column and polarity"
    assert equal["recordings"][1] == {"label": "model", "same_as": 0}
    rtl = equal["recordings"][0]
    assert rtl["t"] == events["t"].tolist()
    assert rtl["taxel"] == (events["y"] * 3 + events["x"]).tolist()
    assert rtl["on"] == events["p"].astype(int).tolist()
    assert other["equal"] is False
    assert other["verdict"].startswith("RTL DIFFERS from model: ")
    assert [recording["unmatched"] for recording in other["recordings"]] == [[7], []]
    assert "RTL DIFFERS" in full


def test_a_long_recording_is_cut_in_time_and_compared_whole(tmp_path, monkeypatch):
    events = some_events()
    write_run(tmp_path / "sim" / "a", events, events[:-1])
    monkeypatch.setattr(gathering, "MOST_EVENTS", 100)
    (run,), _ = raster_data(tmp_path / "sim")
    assert run["shown_clocks"] == events["t"][100]
    assert [recording["events"] for recording in run["recordings"]] == [300, 299]
    assert all(max(recording["t"]) < run["shown_clocks"] for recording in run["recordings"])
    assert run["equal"] is False
    assert run["recordings"][0]["unmatched"] == []  # it lies behind the cut


def test_runs_without_events_and_unipolar_ones_have_a_raster(tmp_path):
    write_run(tmp_path / "a", some_events(0), some_events(0))
    (run,), _ = raster_data(tmp_path)
    assert run["equal"] is True
    assert run["recordings"][0]["t"] == []


def test_without_a_simulation_the_model_stands_alone_and_says_so(bare):
    data = data_of(bare)
    assert [run["encoding"] for run in data["raster"]] == ["lcs", "nlcs"]
    for run in data["raster"]:
        assert run["equal"] is None
        assert [recording["label"] for recording in run["recordings"]] == ["model"]
        assert run["recordings"][0]["events"] > 1000
        assert run["verdict"].startswith("model alone")
    assert "on" not in data["raster"][1]["recordings"][0]
    assert "the model is shown alone and nothing is compared" in bare


def test_every_missing_piece_is_named_with_the_way_to_make_it(bare):
    missing = data_of(bare)["missing"]
    wanted = {"raster": "make sim", "replay": "make replay", "synthesis": "--synthesis"}
    if not ACCURACY.is_file():
        wanted["fig9"] = "python -m snn sweep"
    for section, remedy in wanted.items():
        assert any(remedy in sentence for sentence in missing[section])
        assert all(sentence in bare for sentence in missing[section])


def test_nothing_is_missing_where_everything_is_there(full):
    assert set(data_of(full)["missing"]) <= {"benchmarks"}  # a result without ratios is named


def test_a_run_that_was_interrupted_is_named(tmp_path):
    write_run(tmp_path / "a", some_events(), some_events())
    write_run(tmp_path / "b", some_events(), some_events())
    (tmp_path / "b" / "model.npz").unlink()
    runs, missing = raster_data(tmp_path)
    assert [run["name"] for run in runs] == ["a"]
    assert missing == ["b has no model.npz, so it is not shown; run make sim to the end."]


@pytest.mark.parametrize("inner", ["", "sim"])
def test_the_runs_of_another_out_are_found(call, folder, inner):
    events = some_events()
    write_run(folder / "mine" / inner / "a", events, events)
    assert not (folder / "out").exists()
    code, out, _ = call("report -o mine")
    assert code == 0
    assert "wrote mine/report.html" in out
    data = data_of((folder / "mine" / "report.html").read_text())
    assert [run["name"] for run in data["raster"]] == ["a"]
    code, _, err = call("report -o nowhere")
    assert code == 2
    assert err.startswith("error: the report is a page; its name ends in .html, nowhere does not; rename the output")


def test_benchmark_ratios_are_those_of_the_files():
    charts, _ = benchmark_data(BENCHMARKS)
    cosim = next(chart for chart in charts if chart["name"] == "cosim")
    written = json.loads((BENCHMARKS / "cosim.json").read_text())["results"]
    assert cosim["ratio"] == "of_bare_loop"
    assert cosim["bars"] == [{"name": result["name"]} | result["of_bare_loop"] for result in written]


def test_benchmarks_of_candidates_give_a_chart_for_each_result(tmp_path):
    result = {"steps": 200, "candidates": {"a": {"times_the_limit": 2.5, "equal": True}, "b": {"times_the_limit": 9}}}
    (tmp_path / "network.json").write_text(json.dumps({"results": [result, result | {"steps": 400}]}))
    charts, missing = benchmark_data(tmp_path)
    assert [chart["name"] for chart in charts] == ["network 1", "network 2"]
    assert charts[1]["settings"] == {"steps": 400}
    assert charts[0]["bars"] == [{"name": "a", "median": 2.5}, {"name": "b", "median": 9}]
    assert missing == []


def test_accuracy_takes_what_fig9_writes_and_names_points(tmp_path):
    file = tmp_path / "fig9.json"
    file.write_text(json.dumps(POINTS))
    points = fig9_data(file)["points"]
    assert [point["label"] for point in points] == ["LCS 2 b", "frame, 10 b"]
    assert [point["data_rate_bps"] for point in points] == [2e4, 1.28e7]
    assert points[0]["interval"] == [0.8, 0.95]


# -- the page ----------------------------------------------------------------------------------------


class Structure(html.parser.HTMLParser):
    """Checks that elements are closed, and keeps ids, headings, links and all attributes that could load."""

    VOID = frozenset({"meta", "link", "input", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.headings: list[int] = []
        self.loads: list[str] = []
        self.anchors: list[str] = []
        self.unlabelled: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if values.get("id"):
            self.ids.append(str(values["id"]))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag == "a":
            self.anchors.append(str(values["href"]))
        self.loads += [
            str(v) for k, v in attrs if k in ("src", "srcset", "data", "poster") or (k, tag) == ("href", "link")
        ]
        if tag in ("input", "select") and "label" not in self.open:
            self.unlabelled.append(values)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_accessible(full):
    structure = Structure()
    structure.feed(full)
    structure.close()
    assert structure.open == []
    assert len(structure.ids) == len(set(structure.ids))
    assert structure.headings[0] == 1
    assert structure.headings.count(1) == 1
    assert all(b - a <= 1 for a, b in zip(structure.headings, structure.headings[1:], strict=False))
    assert structure.unlabelled == []
    assert {anchor[1:] for anchor in structure.anchors} <= set(structure.ids)
    assert full.count("<table>") == full.count("<caption>") == 8
    assert "prefers-color-scheme: dark" in full
    assert "@media print" in full


def test_the_page_loads_nothing(full):
    structure = Structure()
    structure.feed(full)
    assert structure.loads == ["data:,"]
    assert set(re.findall(r"https?://[^\s\"'<]*", full)) == {"http://www.w3.org/2000/svg"}  # a name, not an address
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|import\(", full)
    assert "default-src 'none'" in full


def test_the_page_has_no_machine_paths_and_is_the_same_every_time(full, folder, call):
    assert str(folder) not in full
    assert str(Path(__file__).parents[2]) not in full
    call("report -o again.html --sim sim --replay replay --synthesis gates.json --accuracy points.json")
    assert (folder / "again.html").read_text() == full


def test_numbers_are_rounded_for_people_and_kept_whole_in_the_data(full):
    seen = re.sub(r"<(script|style)\b.*?</\1>", "", full, flags=re.DOTALL)
    assert UNROUNDED.findall(seen) == []
    for cell in (
        "26.9 mW",
        "150 uV",
        "20 kbit/s",
        "80.0\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}95.0",
        "100,000 um^2",
        "100 fJ",
    ):
        assert f"<td>{cell}</td>" in seen
    assert UNROUNDED.search(json.dumps(data_of(full)["fig6"]))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0 V"),
        (0.0009236708571873865, "924 uV"),
        (0.9996, "1 V"),
        (0.9994, "999 mV"),
        (-1234.5, "-1.23 kV"),
        (1e-20, "0.01 aV"),
        (2.5e16, "25,000 TV"),
        (float("inf"), "inf V"),
        (float("nan"), "nan V"),
    ],
)
def test_units(value, text):
    assert with_unit(value, "V") == text


def test_text_from_files_cannot_leave_its_place(folder):
    (folder / "bench").mkdir()
    evil = "</script><script>alert(1)</script>"
    values = {"results": [{"name": evil, "times_the_copy": {"median": 2.0}}]}
    (folder / "bench" / "a.json").write_text(json.dumps(values))
    data = report_data(folder / "sim", folder / "replay", folder / "bench", folder / "none.json", [])
    text = page(data)
    assert evil not in text
    assert data_of(text)["benchmarks"][0]["bars"][0]["name"] == evil


# -- bad input ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--synthesis none.json", "cannot read the synthesis report none.json: No such file or directory"),
        ("--synthesis broken.json", "the synthesis report broken.json is not JSON"),
        ("--accuracy broken.json", "the accuracy results broken.json is not JSON"),
        ("--accuracy none.json", "cannot read the accuracy results none.json: there is no such file"),
        ("--benchmarks broken", "the benchmark result broken/a.json is not JSON"),
        ("--benchmarks none", "none is not a folder; give one, or leave the option out"),
        ("--sim other-array", "a: rtl.npz is of a 2 x 3 array, model.npz of 3 x 3; run make sim again for this array"),
        ("--sim other-bits", "a: rtl.npz has resolution 4, model.npz 5; run make sim again for one of them"),
        ("--sim damaged", "damaged/a/rtl.npz is damaged or not an event file"),
        ("--replay damaged", "damaged/a/summary.json is not a summary of make replay"),
        ("-o report.pdf", "the report is a page; its name ends in .html, report.pdf does not; rename the output"),
        ("-o folder.html", "cannot write folder.html: it is a folder; give the name of a file"),
        (
            "-o broken.json/report.html",
            "cannot write broken.json/report.html: the folder broken.json does not exist; create it first",
        ),
    ],
)
def test_bad_input_gets_one_sentence_and_leaves_nothing(call, folder, options, sentence):
    write_run(folder / "other-array" / "a", some_events(), some_events(), CONFIG.replace(rows=3))
    write_run(folder / "other-bits" / "a", some_events(), some_events(), CONFIG.replace(resolution=5))
    write_run(folder / "damaged" / "a", some_events(), some_events())
    (folder / "damaged" / "a" / "rtl.npz").write_bytes(b"PK\x03\x04 cut off")
    (folder / "damaged" / "a" / "summary.json").write_text("{}")
    (folder / "broken.json").write_text('{"points": [')
    (folder / "broken").mkdir()
    (folder / "broken" / "a.json").write_text("{")
    (folder / "folder.html").mkdir()
    (folder / "report.html").write_text("the old one")
    code, out, err = call(("" if options.startswith("-o") else "-o report.html ").join(("report ", options)))
    assert code == 2
    assert out == ""
    assert err.startswith(f"error: {sentence}")
    assert err.count("\n") == 1
    assert (folder / "report.html").read_text() == "the old one"
    assert not list(folder.glob("**/*.part"))
    assert not list((folder / "folder.html").iterdir())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"accuracy": 91}, r"point 0 needs accuracy, a number in 0\.\.1, not 91"),
        ({"accuracy": True}, r"point 0 needs accuracy, a number in 0\.\.1, not True"),
        ({"data_rate_bps": 0}, "point 0 needs data_rate_bps, a positive number of bit/s, not 0"),
        ({"data_rate_bps": "fast"}, "point 0 needs data_rate_bps, a positive number of bit/s, not 'fast'"),
        ({"interval": [0.1]}, r"point 0 has an interval that is not \[low, high\]"),
    ],
)
def test_bad_points_are_refused(tmp_path, change, sentence):
    (tmp_path / "a.json").write_text(json.dumps({"points": [{"data_rate_bps": 1.0, "accuracy": 0.5} | change]}))
    with pytest.raises(InputError, match=sentence):
        fig9_data(tmp_path / "a.json")


@pytest.mark.parametrize("values", [{}, [], {"points": []}, 3, {"points": [1]}])
def test_accuracy_without_points_is_refused(tmp_path, values):
    (tmp_path / "a.json").write_text(json.dumps(values))
    with pytest.raises(InputError, match=r"list of points|is not an object|must be a JSON object"):
        fig9_data(tmp_path / "a.json")


def test_other_jsons_are_refused(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "summary.json").write_text("[]")
    with pytest.raises(InputError, match="is not a summary of make replay"):
        replay_data(tmp_path)


@pytest.mark.parametrize("text", ["[]", "3", "{}", '{"results": [1, {"times_the_copy": {"median": 0}}]}'])
def test_files_without_ratios_are_named(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    charts, missing = benchmark_data(tmp_path)
    assert charts == []
    assert missing == [
        "a.json has no ratios, so it is not drawn.",
        "There are no benchmark results with ratios here; make bench writes them.",
    ]


# -- in a browser ------------------------------------------------------------------------------------

STOP_N, STOP_NOISE, TAU = 8, 10, "2.0"

WATCH = """<script>
window.wrong = [];
addEventListener("error", (event) => wrong.push(event.message));
addEventListener("securitypolicyviolation", (event) => wrong.push(event.violatedDirective));
</script>"""

DRIVER = """<script>
const found = { wrong, marks: {} };
const by = (id) => document.getElementById(id);
const move = (target, x, y) => target.dispatchEvent(
  new PointerEvent("pointermove", { bubbles: true, clientX: x, clientY: y }));
const press = (target, key) => target.dispatchEvent(new KeyboardEvent("keydown", { bubbles: true, key }));
const set = (id, value, name) => { by(id).value = value; by(id).dispatchEvent(new Event(name || "input")); };
const bars = () => [...document.querySelectorAll("#chart-explore rect.mark")].map((bar) => ({
  mode: bar.closest("svg").dataset.mode, ...bar.dataset, y: Number(bar.getAttribute("y")),
  height: Number(bar.getAttribute("height")) }));
const window_ = () => [by("raster").dataset.marks, by("raster").dataset.start, by("raster").dataset.span].map(Number);

for (const chart of document.querySelectorAll(".chart")) found.marks[chart.id] = chart.querySelectorAll(".mark").length;
found.bars = [bars()];
set("explore-n", %d); set("explore-noise", %d); set("explore-tau", "%s");
found.bars.push(bars());
found.stops = [by("explore-n-value").textContent, by("explore-noise-value").textContent];
found.words = by("explore-words").textContent;

const bar = document.querySelector("#chart-fig6 rect.mark");
move(bar, 200, 200);
found.hover = by("tip").hidden ? null : by("tip").textContent;
move(document.body, 1, 1);
found.hidden = by("tip").hidden;
const drawing = document.querySelector("#chart-fig7 svg");
drawing.focus();
press(drawing, "ArrowRight"); press(drawing, "ArrowRight");
found.keys = by("tip").textContent;
set("sensitivity-noise", 0, "change");
found.first_case = document.querySelector("#chart-sensitivity .mark").dataset.tip;

set("raster-run", 0, "change");
found.windows = [window_()];
set("raster-window", 600);
found.windows.push(window_());
set("raster-from", 1000);
found.windows.push(window_());
by("raster-reset").click();
found.windows.push(window_());
const canvas = by("raster"), box = canvas.getBoundingClientRect();
const turn = { deltaY: -100, clientX: box.left + 300, cancelable: true };
const wheel = () => canvas.dispatchEvent(new WheelEvent("wheel", turn));
wheel();
found.windows.push(window_());
canvas.focus(); wheel();
found.windows.push(window_());
press(canvas, "0"); press(canvas, "+"); press(canvas, "ArrowRight");
found.windows.push(window_());
press(canvas, "0");
canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + 2, clientY: box.top + 2 }));
search: for (let y = 0; y < box.height; y += 2) for (let x = 0; x < box.width; x += 4) {
  move(canvas, box.left + x, box.top + y);
  if (!by("tip").hidden) { found.event = by("tip").textContent; break search; }
}
const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
const colours = new Set();
for (let k = 0; k < pixels.length; k += 4) if (pixels[k + 3] === 255) colours.add(pixels.slice(k, k + 3).join());
found.colours = [...colours];
set("raster-run", by("raster-run").options.length - 1, "change");
found.verdict = by("raster-verdict").textContent;
URL.createObjectURL = (blob) => { found.bytes = blob.size; return "blob:none"; };
URL.revokeObjectURL = () => {};
HTMLAnchorElement.prototype.click = function () { found.file = this.download; };
[...by("downloads").children].find((button) => button.textContent === "fig6.json").click();
found.wide = document.documentElement.scrollWidth <= innerWidth;
found.width = innerWidth;
found.tips = [...document.querySelectorAll(".mark")].map((mark) => mark.dataset.tip);
const texts = [...document.querySelectorAll(".chart figure > svg text")];
found.letters = Math.min(...texts.map((text) => {
  const svg = text.ownerSVGElement;
  return parseFloat(getComputedStyle(text).fontSize) * svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
}));
const boxes = texts.map((text) => [text, text.getBoundingClientRect()]);
found.outside = boxes.filter(([, box]) => box.left < 0 || box.right > innerWidth).map(([text]) => text.textContent);
found.crossed = boxes.flatMap(([text, a], k) => boxes.slice(0, k).filter(([other, b]) => (
  text.ownerSVGElement === other.ownerSVGElement && Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
  Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4)).map(([other]) => (
    `${text.textContent} | ${other.textContent}`)));
const nine = [...document.querySelectorAll("#chart-fig9 svg")].filter((svg) => svg.querySelector(".mark"));
found.hidden_marks = nine.flatMap((svg) => {
  const marks = [...svg.querySelectorAll(".mark")].map((mark) => mark.getBoundingClientRect());
  const labels = [...svg.querySelectorAll(".label")].map((text) => text.getBoundingClientRect());
  const hit = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
  return [...marks.flatMap((a, k) => marks.slice(0, k).filter((b) => hit(a, b))),
    ...marks.flatMap((a) => labels.filter((b) => hit(a, b)))];
}).length;
found.labels = nine.map((svg) => svg.querySelectorAll(".label").length);
found.legend = [...document.querySelectorAll("#chart-fig9 .legend span")].map((item) => item.textContent);
const result = document.createElement("script");
result.type = "application/json"; result.id = "result";
result.textContent = JSON.stringify(found).replace(/</g, "\\\\u003c");
(parent === window ? document : parent.document).body.append(result);
</script>"""


def chromium() -> str:
    """Return the browser, or skip; a gate must have it."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    reason = "Chromium is not installed (apt-get install chromium)"
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


def dump(text: str, folder: Path, *options: str) -> str:
    """Return a page as the browser has it after its scripts ran."""
    file = folder / "driven.html"
    file.write_text(text)
    command = [chromium(), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    command += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    command += ["--disable-dev-shm-usage", f"--user-data-dir={folder / 'profile'}", *options]
    done = subprocess.run([*command, "--dump-dom", file.as_uri()], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def drive(text: str, folder: Path, width: int = 1200) -> Any:
    """Return what the driver finds when it uses a page of a width; a narrow one in a frame: windows are wider."""
    driver = DRIVER % (STOP_N, STOP_NOISE, TAU)
    driven = text.replace("<head>", "<head>" + WATCH, 1).replace("</body>", driver + "</body>")
    if width < 500:
        driven = f'<iframe style="border: 0; width: {width}px; height: 900px" srcdoc="{html.escape(driven)}"></iframe>'
    found = re.search(r'id="result">(.*?)</script>', dump(driven, folder, f"--window-size={width},900"), re.DOTALL)
    assert found, "the driver did not come to its end"
    return json.loads(found[1])


def test_the_page_works_in_a_browser(full, folder):
    found = drive(full, folder)
    data = data_of(full)
    assert found["wrong"] == []
    assert found["wide"]
    cases = data["sensitivity"]["rows"]
    lines = [
        line
        for mode in data["fig7"]["modes"].values()
        for line in (*mode["crossover"]["nlcs"].values(), mode["crossover"]["lcs"])
    ]
    points = [value for line in lines for value in line if value is not None]
    assert found["marks"] == {
        "chart-explore": 2 * 3 * 3,
        "chart-fig6": 2 * 3 * 3 * 3,
        "chart-fig7": len(points) + 4 * 10,
        "chart-sensitivity": 2 * len(cases),
        "chart-fig9": 2,
        "chart-benchmarks": sum(len(chart["bars"]) for chart in data["benchmarks"]),
        "chart-synthesis": 1,
    }
    assert found["file"] == "fig6.json"
    assert found["bytes"] > 2000
    # The sliders put the bars to the model's values.
    before, after = found["bars"]
    assert [bar["watts"] for bar in before] != [bar["watts"] for bar in after]
    assert [bar["y"] for bar in before] != [bar["y"] for bar in after]
    gates = {"lcs": SynthesisReport.from_dict(GATES)}
    models = {"paper": MODELS["paper"], "consistent": dataclasses.replace(MODELS["consistent"], gates=gates)}
    expected = []
    for mode, model in models.items():
        for readout, name in zip(READOUTS, ("N-LCS, 2 s", "LCS", "frame"), strict=True):
            power = model.breakdown(readout, STOP_N + 1, GRID_NOISE_V[STOP_NOISE], float(TAU))
            expected += [(mode, name, part, float(getattr(power, part))) for part in ("afe", "converter", "io")]
    assert [(bar["mode"], bar["bar"], bar["part"], float(bar["watts"])) for bar in after] == expected
    assert found["stops"] == ["9 bit", "100 µV"]
    assert found["words"].startswith("paper mode: ")
    # Values by pointer and by keyboard.
    watts = data["fig6"]["modes"]["paper"][0]["nlcs"]
    numbers = f"AFE {watts['afe'] * 1e3:.2f} mW\nsum {watts['total'] * 1e3:.2f} mW"
    assert found["hover"] == f"N-LCS, paper mode, 0.1 mV rms\n{numbers}"
    assert found["hidden"]
    crossover = data["fig7"]["modes"]["paper"]["crossover"]["nlcs"]["2.0"][1]
    assert found["keys"] == f"N-LCS, 2 s, N = 2, paper mode, AFE noise\n{crossover * 1e6:.1f} µV"
    assert f"\n{cases[0]['ratio']['nlcs'][0]:.4g} times frames\n" in found["first_case"]
    # The raster: slider, reset, wheel (only once it has the focus), keys.
    whole, narrow, moved, reset, unfocused, zoomed, keyed = found["windows"]
    assert whole == reset == unfocused == [600, 0, CLOCKS]
    assert narrow[2] < CLOCKS
    assert 0 < narrow[0] < 600
    assert moved[1] == CLOCKS - moved[2]
    assert zoomed[2] == round(CLOCKS / 1.2)
    assert keyed[1] > 0
    assert keyed[2] < CLOCKS
    assert re.fullmatch(r"RTL, event \d+\nclock \d+ \([\d.]+ ms\)\nrow [01], column [012], (ON|OFF)", found["event"])
    drawn = {",".join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5)) for colour in (ON_COLOUR, OFF_COLOUR)}
    assert drawn <= set(found["colours"])
    assert found["verdict"].startswith("RTL DIFFERS from model")


def test_the_page_of_the_model_alone_works_in_a_browser(bare, folder):
    found = drive(bare, folder)
    assert found["wrong"] == []
    assert found["wide"]
    assert found["marks"]["chart-fig6"] == 54
    assert found["marks"]["chart-synthesis"] == 0
    assert found["event"].startswith("model, event ")
    assert found["verdict"].startswith("model alone")


@pytest.mark.parametrize("width", [400, 1200])
def test_charts_use_the_width_that_they_have(call, folder, width):
    """With the points of the project in Fig. 9: nothing is wider than the page, smaller than 11 px or on another."""
    options = write_everything(folder).replace("--accuracy points.json", "")
    assert call(f"report -o report.html {options}")[0] == 0
    found = drive((folder / "report.html").read_text(), folder, width)
    assert found["wrong"] == []
    assert found["width"] == width
    assert found["wide"]
    assert found["letters"] >= 10.99  # pixels of the smallest letter of a chart
    assert found["outside"] == []
    assert found["crossed"] == []
    assert found["hidden_marks"] == 0
    assert min(found["labels"]) >= 4
    assert len(found["tips"]) > 200
    assert [tip for tip in found["tips"] if UNROUNDED.search(tip)] == []
    points = json.loads(ACCURACY.read_text())["points"]
    assert set(found["legend"]) == {"LCS", "N-LCS", "frame"} | {point["title"] for point in points}


def test_the_page_has_the_palette_of_the_figures(full):
    for name, colour in {**READOUT_COLOURS, **PART_COLOURS, "on": ON_COLOUR, "off": OFF_COLOUR}.items():
        if colour != PALETTE["black"]:
            assert f"--{name}: {colour};" in full
    drawn = re.search(r"<style>(.*?)</style>", full, re.DOTALL)[1]
    grounds = set(re.findall(r"--(?:page|text|soft|line|panel|link|warn): (#\w+)", drawn))
    assert set(re.findall(r"#[0-9a-f]{6}", drawn)) - grounds <= set(PALETTE.values())
    assert not re.search(r"#[0-9a-f]{6}", full[full.rindex("<script>") :])
