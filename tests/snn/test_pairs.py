"""Test the paired comparison of two sweep points."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from eskin.app.cli import app
from eskin.base.errors import InputError
from eskin.base.workers.pool import Local
from eskin.snn.experiments.crossval import read_cell
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.pairs import find_point, pair
from eskin.snn.experiments.points import Point, as_word, load_sweep
from eskin.snn.experiments.sweep import SweepPoint, sweep
from eskin.snn.training import TrainConfig
from tests.snn.helpers import easy_data


def point(name: str, *predictions: str, labels: str = "00112") -> Point:
    result = {"predictions": predictions}
    return {"name": name, "class_names": ["a", "b", "c"], "labels": labels, "last": result, "selected": result}


def test_two_points_are_compared_image_by_image() -> None:
    found = pair(point("a", "00110", "00000"), point("b", "10112", "00112", "00112"), "last")
    assert (found.only_first, found.only_second) == ([1, 0], [1, 3]), "seeds that one alone has do not count"
    assert found.p == [1.0, pytest.approx(0.25)]
    assert (found.accuracy_first, found.accuracy_second) == ([0.8, 0.4], [0.8, 1.0])
    assert found.difference == pytest.approx(0.3)
    assert found.interval[0] < 0.3 < found.interval[1]
    seeds = pair(point("a", "00112", "11221"), point("b", "00112", "00112"), "last")
    assert seeds.interval == (0.0, 1.0), "every image gains the same, so that the interval is all of the seeds"
    same = pair(point("a", "00110"), point("b", "00110"), "selected")
    assert (same.difference, same.interval, same.p) == (0.0, (0.0, 0.0), [1.0])
    with pytest.raises(InputError, match="a and b have different images or classes and cannot be compared"):
        pair(point("a", "00110"), point("b", "00110", labels="00111"), "last")


def test_a_sweep_keeps_every_prediction_and_pairs_are_made_from_its_file(tmp_path: Path) -> None:
    made = [
        SweepPoint(f"hidden-{hidden}", Experiment(network={"hidden": hidden}, train=TrainConfig(epochs=1)), easy_data())
        for hidden in (8, 16)
    ]
    sweep(made, tmp_path, pool=Local(1), folds=2, seeds=2)
    data = easy_data()
    (first, _) = load_sweep(tmp_path).points
    assert first["labels"] == as_word(data.image_labels)
    for reading in ("last", "selected"):
        words = first[reading]["predictions"]
        for fold, seed in ((0, 0), (1, 0), (0, 1), (1, 1)):
            _, cell = read_cell(tmp_path / "hidden-8" / f"fold-{fold}-seed-{seed}.json")
            assert [int(words[seed][image]) for image in cell["test_images"]] == cell[reading]
    out = tmp_path / "pair.json"
    arguments = ["pair", f"{tmp_path}:hidden-8", f"{tmp_path}:hidden-16", "--out", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    expected = pair(find_point(arguments[1], tmp_path), find_point(arguments[2], tmp_path), "last")
    written = json.loads(out.read_text())
    assert written["only_first"] == expected.only_first
    assert written["difference"] == expected.difference
    assert (written["first"], written["second"]) == tuple(arguments[1:3])
    assert f"only B right {expected.only_second[1]}" in result.output


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["lcs-4", "x:y"], "a point must be SWEEP:POINT, such as rates-cnn:lcs-4, not 'lcs-4'"),
        (["tuned:lcs-5", "x:y"], "sweep tuned has no point 'lcs-5'; it has lcs-2, lcs-3"),
        (["tuned:lcs-4", "x:y"], "tuned:lcs-4 has no predictions for images; run its sweep again"),
        (["nowhere:lcs-4", "x:y"], "cannot read the sweep nowhere: "),
        (["a:b", "x:y", "--reading", "best"], "reading must be one of last, selected, not 'best'"),
    ],
)
def test_bad_names_get_one_sentence(names: list[str], message: str, refuses: Any) -> None:
    refuses(f"error: {message}", "pair", *names)
