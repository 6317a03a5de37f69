"""Test the study of networks with few bits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.weights import load_weights
from eskin.snn.experiments.evaluate import integer_classes
from eskin.snn.experiments.robustness import Subject
from eskin.snn.studies.precision import _operations_hz, parse_variants, points_of
from tests.snn.helpers import two_textures


def test_variants_are_read_as_they_are_written() -> None:
    found = parse_variants("8, 4:t6,3:t5:m12")
    weights = {name: (p.in_bits, p.rec_bits, p.out_bits) for name, p in found.items()}
    assert weights == {"8": (8, 8, 8), "4:t6": (4, 4, 4), "3:t5:m12": (3, 3, 3)}
    assert [(p.threshold_bits, p.membrane_bits) for p in found.values()] == [(8, None), (6, None), (5, 12)]


@pytest.mark.parametrize("text", ["9", "8,8", "4:m", "4:m12:t6", "", "4t6"])
def test_other_variants_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="--variants must list different BITS"):
        parse_variants(text)


def cell(seed: int, images: list[int], said: str, network: str = "a") -> dict[str, Any]:
    answers = {
        "float": {"predicted": [0] * len(images)},
        "4": {"predicted": [int(one) for one in said], "memory_bits": 800 + seed, "operations_hz": 5.0},
    }
    about = {"network": network, "fold": 0, "seed": seed, "images": images, "hidden": 8}
    return about | {"labels": [0] * len(images), "answers": answers}


def test_an_image_counts_once_with_all_its_seeds() -> None:
    cells = [cell(0, [0, 1], "00"), cell(0, [2], "1"), cell(1, [0, 1, 2], "011"), cell(0, [0], "0", "b")]
    of_float, four, *others = points_of(cells)
    assert of_float["accuracy"] == 1
    assert (four["images"], four["seeds"], four["accuracy"], four["within"]) == (3, 2, 0.5, 0.5)
    assert four["memory_bits"] == 801
    assert [(point["network"], point["images"]) for point in others] == [("b", 1), ("b", 1)]
    with pytest.raises(InputError, match="no common test image"):
        points_of([cell(0, [0], "0"), cell(1, [1], "0")])


def test_answers_are_those_of_the_integer_model_and_are_kept(call: Any, refuses: Any, folder: Path) -> None:
    two_textures(folder / "textures")
    small = "--dataset textures --folds 2 --epochs 2 --recipe paper --set hidden=8"
    assert call(f"train {small} -o nets/a/fold-0")[0] == 0
    code, _, error = call("precision nets --variants 8,2:m12 -o out")
    assert code == 0, error
    content = json.loads(Path("out/precision.json").read_text())
    assert content["command"] == "eskin precision nets --variants 8,2:m12"
    assert [point["variant"] for point in content["points"]] == ["float", "8", "2:m12"]
    assert Path("out/precision.png").stat().st_size > 10_000

    subject = Subject.load(Path("nets/a/fold-0/weights.npz"), scenes=False)
    precision = Precision(in_bits=2, rec_bits=2, out_bits=2, membrane_bits=12)
    network = quantise(load_weights(Path("nets/a/fold-0/weights.npz")), precision).network
    data = subject.experiment.data()
    point = content["points"][2]
    assert content["tests"]["a"][0]["images"] == subject.images.tolist()
    assert point["predicted"][0] == "".join(map(str, integer_classes(network, data, subject.images)))
    assert (point["memory_bits"], point["membrane_bits"]) == (network.config.memory_bits, 12)

    before = (folder / "out" / "a-fold-0-seed-0.json").stat().st_mtime_ns
    assert call("precision nets --variants 8,2:m12 -o out")[0] == 0
    assert (folder / "out" / "a-fold-0-seed-0.json").stat().st_mtime_ns == before
    other = "a-fold-0-seed-0.json belongs to other weights, variants or images; remove it"
    refuses(other, "precision nets --variants 8 -o out")


def test_additions_are_rows_of_events_and_of_spikes() -> None:
    config = ClassifierConfig(inputs=3, hidden=10, classes=2)
    made = IntegerNetwork(
        config, *(np.zeros(shape, int) for shape in ((3, 10), (10, 10), (10, 2))), np.zeros(10, int), np.zeros(2, int)
    )
    counts = np.zeros((2, 5, 3))
    counts[:, 0] = 1  # three events of each scan, in five bins of 0.1 s
    assert _operations_hz(made, counts, 0.1, 0.1) == pytest.approx((0.6 * 10 + 0.1 * 10 * 12 + 12) / 0.1)
