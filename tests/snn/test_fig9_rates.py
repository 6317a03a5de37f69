"""The figure of readouts at equal data rate."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from eskin.snn.experiments.pairs import pair
from eskin.snn.experiments.points import Cells, PointSummary, Result, Sweep, load_sweep, write_sweep
from eskin.snn.figures import fig9
from eskin.snn.figures.fig9_rates import BEST, draw_rates, rates_data

LABELS = "000111222"


def point(name: str, readout: str, rate: float, word: str, coded: dict[str, float] | None = None) -> PointSummary:
    right = sum(map(str.__eq__, word, LABELS)) / 9
    result = Result(right, None, None, None, [0, 1], [right - 0.1, right + 0.05], 9, [right], [[3] * 3] * 3, [word])
    resolution = 8 if readout == "frame" else 4
    bps = 640e3 * rate
    return PointSummary(name, readout, resolution, "paper", bps / 8, 8, bps, rate, ["a", "b", "c"],
                        Cells(6, 6, 1), result, result, LABELS, coded)  # fmt: skip


SWEEPS = [
    Sweep(
        "rates-cnn",
        "eskin sweep --recipe cnn",
        [
            point("lcs-4", "lcs", 0.22, "000111210", {"addresses": 6400.0, "events": 64000.0}),
            point("frame-diff-250-8", "frame", 0.2, "000111220", {"samples": 96000.0, "differences": 70400.0}),
            point("frame-diff-62.5-8", "frame", 0.05, "000011200"),
        ],
    ),
    Sweep("rates-paper", "eskin sweep --recipe paper", [point("lcs-4", "lcs", 0.22, "000111222")]),
]


def test_the_names_of_frames_are_words() -> None:
    def words(name: str) -> str:
        return fig9.detail({"readout": "frame", "name": name, "resolution": 8})

    assert words("frame-250-8") == "250 Hz 8 b"
    assert words("frame-diff-62.5-8") == "differences 62.5 Hz 8 b"
    assert words("frame-onoff-250-8-3") == "ON/OFF 250 Hz 8 b, levels of 3 b"
    assert words("cnn-20") == "convolutions"
    assert fig9.detail({"readout": "frame", "resolution": 10}) == "10 b"


def test_frames_and_events_of_one_rate_and_network_are_paired() -> None:
    data = rates_data(SWEEPS, "last")
    assert [(one["first"], one["second"]) for one in data["pairs"]] == [
        ("rates-cnn:lcs-4", "rates-cnn:frame-diff-250-8")
    ], "not those of other rates or networks"
    expected = dataclasses.asdict(pair(SWEEPS[0].points[0], SWEEPS[0].points[1], "last"))
    assert data["pairs"][0] == {"first": data["pairs"][0]["first"], "second": data["pairs"][0]["second"], **expected}
    assert [one["coded_rate"] for one in data["points"]] == [0.1, 0.11, None, None], "with times; the least of frames"


def test_each_network_has_a_panel_and_the_best_one_more() -> None:
    figure = draw_rates(rates_data(SWEEPS, "last"))
    marks = {
        panel.get_title(loc="left"): sorted(
            (line.get_xdata()[0], round(line.get_ydata()[0], 6)) for line in panel.lines if line.get_marker() in "sov^D"
        )
        for panel in figure.axes
    }
    assert set(marks) == {"1-D convolutions", "the paper's network", BEST}
    assert marks["1-D convolutions"] == [(0.05, round(600 / 9, 6)), (0.2, round(800 / 9, 6)), (0.22, round(700 / 9, 6))]
    assert marks[BEST] == [(0.05, round(600 / 9, 6)), (0.2, round(800 / 9, 6)), (0.22, 100.0)]
    coded = [line for line in figure.axes[0].lines if line.get_marker() == "|"]
    assert [tuple(line.get_xdata()) for line in coded] == [(0.1, 0.22), (0.11, 0.2)]


@pytest.mark.parametrize("file", fig9.kept_rates(), ids=lambda path: str(path.stem))
def test_the_kept_sweeps_have_what_a_pair_needs(file: Any, tmp_path: Any) -> None:
    sweep = load_sweep(file)
    write_sweep(tmp_path / file.name, sweep.command, sweep.points)
    written, kept = (json.loads(path.read_text()) for path in (tmp_path / file.name, file))
    assert written.keys() == kept.keys()
    assert (written["command"], written["points"]) == (kept["command"], kept["points"])
    assert file not in fig9.kept_sweeps()
    for one in sweep.points:
        assert one.labels is not None
        for reading in ("last", "selected"):
            found = one.result(reading)
            assert found.predictions is not None
            right = [sum(map(str.__eq__, word, one.labels)) / len(one.labels) for word in found.predictions]
            assert right == pytest.approx(found.accuracy_of_seeds, abs=1e-12)
