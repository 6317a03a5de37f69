"""Test the selection of taxels, and the frontier study."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.base.files import plain
from eskin.base.workers.engine import Local
from eskin.base.workers.store import Store
from eskin.skin.textures.choice import choose
from eskin.snn.batched_training import train_together
from eskin.snn.data.folds import stratified_folds
from eskin.snn.data.scans import Split
from eskin.snn.experiments import intervals
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.points import load_sweep
from eskin.snn.network_config import NetworkConfig
from eskin.snn.train import logits_of, train
from studies import fig9, frontier
from studies.frontier import (
    SWEEPS,
    TITLES,
    Frontier,
    Point,
    cells_of,
    draw_frontier,
    frame_candidates,
    frontier_data,
    inner_cells,
    points_of,
)

SMALL = {"leaky": {"recipe": "tuned", "hidden": 8}, "convolutions": {"recipe": "cnn", "hidden": 8}}


@pytest.mark.parametrize(
    ("text", "taxels"),
    [
        ("across:3", (0, 8, 12)),
        ("along:2", (8, 11)),
        ("corners", (0, 3, 12, 15)),
        ("checkerboard", (0, 2, 5, 7, 8, 10, 13, 15)),
        ("3+1", (1, 3)),
    ],
)
def test_taxels_are_chosen_by_name(text: str, taxels: tuple[int, ...]) -> None:
    assert choose(text, 4, 4) == taxels
    assert len(choose("random:5:1", 4, 4)) == 5
    assert choose("random:5:1", 4, 4) != choose("random:5:2", 4, 4)


@pytest.mark.parametrize(
    "text", ["across", "across:5", "along:0", "corners:1", "16", "-1", "1+", "random:99:0", "lines"]
)
def test_a_choice_that_the_array_does_not_have_is_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match=r"^choose taxels of 4 x 4 by across:K\|.*, with numbers in 0\.\.15, not "):
        choose(text, 4, 4)


def test_points_are_read_as_they_are_written() -> None:
    point = Point.parse("physical/leaky/lcs:2/12x16:across:4")
    experiment = point.experiment()
    config = experiment.scan_and_config()[1]
    assert experiment.taxels == (0, 64, 112, 176)
    assert (config.taxels, config.event_bits, config.resolution) == (4, 3, 2)
    assert Experiment.from_dict(json.loads(json.dumps(plain(experiment.to_dict())))) == experiment
    for text in ("physical/leaky/lcs:2", "physical/none/lcs:2/all", "physical/leaky/lcs/all", "paper/leaky/lcs:2/x"):
        with pytest.raises(InputError):
            Point.parse(text)


def test_a_run_goes_on_and_inner_validation_sees_no_test_image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frontier, "NETWORKS", {"physical": SMALL})
    monkeypatch.setattr(frontier, "SCANS", {"physical": {"start_rows": 2, "epochs": 1}})
    point, steps = Point("physical", "leaky", "lcs:3", "across:2"), []

    def run(seeds: int) -> dict[str, Any]:
        made = Frontier(Store(tmp_path / "frontier.json", ""), Local(1), "embedded")
        made.train(cells_of(point, seeds), lambda: steps.append(0))
        return made.point(point, seeds)

    first = run(1)
    assert len(steps) == 6
    monkeypatch.setattr(frontier, "train_cells", None)
    assert run(1) == first
    assert len(steps) == 12
    assert first["taxels"] == [0, 56]
    assert first["bits_per_s"] == 2 * first["rate_hz"]
    assert "latency" not in first, "its threshold needs inner validation"
    assert first["accuracy"] == np.mean([a == b for a, b in zip(first["predictions"][0], first["labels"], strict=True)])
    with pytest.raises(TypeError):
        run(2)
    monkeypatch.undo()

    def spy(data: Any, _: Experiment, trainings: Any, inner: bool, device: str) -> list[dict[str, Any]]:
        assert inner
        assert {seed for _, seed in trainings} == {0}
        return [{"labels": [fold], "predicted": [fold or 9], "of_scans": 0.3, "learned": fold} for fold, _ in trainings]

    monkeypatch.setattr(frontier, "train_cells", spy)
    monkeypatch.setattr(frontier, "SCANS", {"physical": {"start_rows": 1, "epochs": 1}})
    made = Frontier(Store(None, ""), Local(1), "embedded")
    made.train(inner_cells(point), lambda: None)
    found = made.inner(point, 2)
    assert [found[name] for name in ("accuracy", "of_scans", "learned")] == [0.5, 0.3, 0.5]


def test_inner_validation_is_of_training_images(monkeypatch: pytest.MonkeyPatch) -> None:
    labels, seen = np.repeat(np.arange(3), 12), []

    class Stop(Exception):
        pass

    def train(split: Any, *_: Any, device: str) -> None:
        seen.append(split)
        raise Stop

    monkeypatch.setattr("eskin.snn.train.train", train)
    experiment = Point("physical", "leaky", "lcs:3", "across:2").experiment()
    monkeypatch.setattr(Experiment, "network_config", lambda *_: None)
    data = type("Data", (), {"image_labels": labels})()
    for inner in (False, True):
        with pytest.raises(Stop):
            frontier.train_cells(data, experiment, [(2, 0)], inner, "cpu")  # type: ignore[arg-type]
    test = set(stratified_folds(labels, 6, 0)[2].tolist())
    assert set(seen[0].learned) == set(range(36)) - test
    assert set(seen[1].learned) < set(seen[0].learned)


def test_networks_trained_together_are_those_trained_alone() -> None:
    point = Point("physical", "convolutions", "lcs:3", "across:2")
    experiment = dataclasses.replace(point.experiment("embedded"), start_rows=1)
    data = experiment.data()
    config = NetworkConfig.from_dict(experiment.network_config(data).to_dict() | {"hidden": 8, "dropout": 0.0})
    short = dataclasses.replace(experiment.train, epochs=2)
    learned = [np.arange(0, 30), np.arange(10, 40)]
    found = train_together(data, learned, [0, 1], config, short, "cpu")
    for images, seed, network in zip(learned, (0, 1), found, strict=True):
        alone = train(Split(data, images), config, short, seed).network
        assert np.allclose(logits_of(network, data), logits_of(alone, data), atol=1e-4)
    assert not np.allclose(logits_of(found[0], data), logits_of(found[1], data), atol=0.1)
    with pytest.raises(NotImplementedError):
        train_together(data, learned, [0, 1], config, dataclasses.replace(short, balanced=True), "cpu")


def test_frames_are_tried_at_most_at_the_data_rate_of_events() -> None:
    assert frame_candidates("physical", "convolutions", 90.0) == []
    for network in ("convolutions", "leaky"):
        for rate in (170.0, 2e3, 10e3, 45e3):
            points = frame_candidates("physical", network, rate)
            assert len(points) == len(set(points)) > 0
            for point in points:
                kind, frames_hz, bits, *_ = point.readout.split(":")
                assert kind == ("frame-diff" if network == "convolutions" else "frame-onoff")
                taxels = len(point.experiment().taxels) or 64
                assert 0.75 * rate <= float(frames_hz) * int(bits) * taxels <= rate


def measured(inner: Callable[[Point, int], dict[str, Any]]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the points of all budgets without a training, for given results of inner validation, and these."""

    class Run:
        chosen = Frontier.chosen

        def train(self, *_: Any) -> None:
            pass

        def inner(self, point: Point, folds: int) -> dict[str, Any]:
            return inner(point, folds)

        def point(self, point: Point, seeds: int) -> dict[str, Any]:
            return {"name": point.name, "seeds": seeds}

    return frontier.measured(Run(), lambda: None)  # type: ignore[arg-type]


def test_the_best_in_inner_validation_is_measured_and_frames_have_its_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frontier, "COMPARED", {"physical": ("convolutions",)})
    monkeypatch.setattr(frontier, "BUDGETS_HZ", (1_000,))
    monkeypatch.setattr(frontier, "CANDIDATES", {"physical": {"lcs": ("2x5 3x2 4x1",), "nlcs": ("5x5 6x2",)}})
    monkeypatch.setattr(frontier, "ALSO", {"physical/convolutions/nlcs:6/12x16:across:2": 1})
    monkeypatch.setattr(frontier, "MORE_HEIGHTS", ())
    accuracies = {"lcs:2": 0.8, "lcs:3": 0.9, "lcs:4": 0.9, "nlcs:5": 0.5, "nlcs:6": 0.6}

    def validated(point: Point, _: int) -> dict[str, Any]:
        taxels = len(point.experiment().taxels)
        rate = {"lcs:4": 1_000.0}.get(point.readout, 1_000.0 * taxels)
        return {"name": point.name, "bits_per_s": rate, "accuracy": accuracies.get(point.readout, 0.1)}

    points, inner = measured(validated)
    frames = frame_candidates("physical", "convolutions", 1_000.0)
    assert points == [
        {"name": "physical/convolutions/nlcs:6/12x16:across:2", "seeds": 3},
        {"name": "physical/convolutions/lcs:4/12x16:across:1", "seeds": 3},
        {"name": min(frames, key=lambda one: len(one.experiment().taxels)).name, "seeds": 3},
    ]
    assert len(inner) == 5 + len(frames)
    assert {one["budget_hz"] for one in inner} == {1_000}
    monkeypatch.setattr(frontier, "frame_candidates", lambda *_: [])
    points, inner = measured(validated)
    assert (len(points), len(inner)) == (2, 5), "events so rare that no frames are slow enough"


def test_early_answers_wait_for_the_margin_that_inner_validation_needs() -> None:
    times = np.arange(1.0, 4.0)

    def cell(*images: tuple[int, list[list[float]]]) -> dict[str, Any]:
        """Return a training for the label and the logits over time of each image."""
        logits = np.array([course for _, course in images]).transpose(1, 0, 2)
        return {"labels": [label for label, _ in images], **frontier.answers_over_time(times, logits)}

    sure, late = (1, [[0, 2], [0, 3], [0, 4]]), (0, [[0, 1], [1, 0], [3, 0]])
    found = frontier.latency_of([cell(sure, late)], [cell(sure, late)])
    assert found["times_s"] == [1.0, 2.0, 3.0]
    assert found["accuracy"] == [0.5, 1.0, 1.0]
    assert found["early"] == {"threshold": 2.0, "mean_s": 2.0, "accuracy": 1.0}, "the wrong margin of 1 is too small"
    wrong = (1, [[3, 0], [3, 0], [3, 0]])
    assert frontier.latency_of([cell(wrong)], [cell(sure, late)])["early"] == {
        "threshold": 2.0,
        "mean_s": 1.0,
        "accuracy": 0.0,
    }, "test images choose no threshold"
    assert frontier.latency_of([cell(sure)], [cell(wrong)])["early"] is None


def made(name: str, rate: float, *words: str) -> dict[str, Any]:
    preset, network, readout, choice = name.split("/")
    result = frontier._result("000111222", list(words))
    return {
        "name": name,
        "preset": preset,
        "network": network,
        "readout": readout,
        "choice": choice,
        "taxels": [0, 1],
        "rate_hz": rate / 4,
        "bits_per_s": rate,
        "coded_bits_per_s": rate / 2,
        "power_w": 1e-6 if "nlcs-bipolar" not in readout else None,
    } | result


POINTS = [
    made("physical/leaky/lcs:2/across:2", 1000.0, "000111220", "000111220"),
    made("physical/leaky/frame-onoff:125:6/across:2", 1500.0, "000111222"),
    made("physical/leaky/frame-onoff:250:6/across:2", 3000.0, "000111222"),
    made("paper/convolutions/nlcs-bipolar:4/all", 900.0, "000111111"),
]


def test_each_scan_and_network_has_a_column_with_rates_and_power() -> None:
    figure = draw_frontier(frontier_data(POINTS))
    assert len(figure.axes) == 6
    marks = [
        sorted((x, round(y, 3)) for one in panel.containers for x, y in zip(*one[0].get_data(), strict=True))
        for panel in figure.axes
    ]
    rows = [marks[0:2], marks[2:4], marks[4:6]]
    assert [panel.get_title(loc="left") for panel in figure.axes[:2]] == [
        f"physical scan,\n{TITLES['leaky']}",
        f"paper scan,\n{TITLES['convolutions']}",
    ]
    assert rows[0] == [[(250.0, 88.889)], [(225.0, 66.667)]], "frames have no event rate"
    assert rows[1] == [[(1000.0, 88.889), (1500.0, 100.0), (3000.0, 100.0)], [(900.0, 66.667)]]
    assert rows[2] == [[(1e-6, 88.889), (1e-6, 100.0), (1e-6, 100.0)], []], "bipolar N-LCS has no equations"


@pytest.fixture(scope="module")
def swept() -> dict[str, list[dict[str, Any]]]:
    """Return the points of the frontier by the sweep of the project to which they belong, with rough intervals."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intervals, "BOOTSTRAPS", 50)
        return {name: points_of(load_sweep(fig9.KEPT / f"{name}.json"), network) for name, network in SWEEPS.items()}


def test_the_documented_readouts_are_those_that_the_study_chooses(swept: dict[str, list[dict[str, Any]]]) -> None:
    data = json.loads((Path(__file__).parents[2] / "docs" / "data" / "frontier.json").read_text())
    known = {one["name"]: one for one in data["inner"]}

    def validated(point: Point, folds: int) -> dict[str, Any]:
        assert known[point.name]["folds"] == folds
        return {name: value for name, value in known[point.name].items() if name not in ("budget_hz", "chosen")}

    points, inner = measured(validated)
    assert inner == data["inner"]
    names = {point["name"] for points in swept.values() for point in points}
    documented = {one["name"]: one["seeds"] for one in data["points"] if one["name"] not in names}
    assert {one["name"]: one["seeds"] for one in points} == documented


@pytest.mark.parametrize("name", SWEEPS)
def test_the_kept_sweeps_are_points_of_the_frontier(name: str, swept: dict[str, list[dict[str, Any]]]) -> None:
    file = fig9.KEPT / f"{name}.json"
    assert file not in fig9.kept_sweeps()
    for one, point in zip(load_sweep(file).points, swept[name], strict=True):
        assert point["accuracy_of_seeds"] == pytest.approx(one["last"]["accuracy_of_seeds"], abs=1e-12)
        assert point["bits_per_s"] == pytest.approx(one["data_rate_bps"])
        assert Point.parse(point["name"]).name == point["name"]
