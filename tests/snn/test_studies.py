"""Test the studies of noise, latency, rest, timing and precision."""

import dataclasses
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.config import ReadoutConfig
from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.parameters import PowerParameters
from eskin.skin.textures.dataset import Dataset, open_dataset
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.weights import Weights
from eskin.snn.experiments.evaluate import integer_classes
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.pairs import paired
from eskin.snn.experiments.robustness import Subject
from eskin.snn.network import build
from eskin.snn.studies import merits
from eskin.snn.studies.early import begin_of
from eskin.snn.studies.merits import _errors, bits_per_second, timing_points
from eskin.snn.studies.noise import Noise, Rates, noisy_scans, power_of
from eskin.snn.studies.precision import _operations_hz, agreement, parse_variants, points_of, random_events
from tests.snn.helpers import few_textures, small_network, two_textures

SMALL = ReadoutConfig(rows=2, columns=3, resolution=4)


@pytest.fixture(scope="module")
def textures() -> Dataset:
    return open_dataset("embedded").limit(2)


@pytest.mark.parametrize("kind", ["lcs", "nlcs", "frames"])
def test_scans_with_next_to_no_noise_are_those_of_the_training(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    few_textures(monkeypatch)
    frames = FrameSteps.parse("frame-onoff:250:8", 0.004) if kind == "frames" else None
    readout = SMALL.replace(encoding="lcs" if kind == "frames" else kind)
    made = Experiment(dataset="embedded", preset="paper", readout=readout, frames=frames)
    images = [0, 5]
    noises: list[Noise] = [("paper", 1e-9), ("consistent", 1e-9), ("paper", 0.05)]
    (clean, rates), (slow, _), (noise, more) = noisy_scans(made, images, noises, lambda: None)
    whole = made.data()
    assert np.array_equal(clean.values, whole.values[images])
    assert np.array_equal(slow.values, clean.values)
    assert not np.array_equal(noise.values, clean.values)
    assert clean.labels.tolist() == whole.image_labels[images].tolist()
    assert rates.population_hz == pytest.approx(clean.rate_hz)
    assert rates.population_hz**2 / 6 <= rates.square_sum_hz2 * (1 + 1e-9) <= rates.population_hz**2
    assert (more.population_hz > rates.population_hz) == (kind != "frames")


def test_power_is_that_of_the_model_at_these_rates() -> None:
    lcs = Experiment(preset="paper", readout=ReadoutConfig(resolution=6))
    fitted = PowerModel().breakdown("lcs", 6, 1e-3)
    rate_hz = 2429.0 * 2**4
    found = power_of(lcs, "paper", 1e-3, Rates(rate_hz, rate_hz**2 / 64))
    assert found["total"] == pytest.approx(float(fitted.total))
    assert power_of(lcs, "paper", 1e-3, Rates(2 * rate_hz, rate_hz**2))["io"] == pytest.approx(2 * found["io"])
    frames = Experiment(preset="paper", frames=FrameSteps.parse("frame-diff:250:8", 0.004))
    any_rates = Rates(16_000.0, 4e6)
    assert power_of(frames, "paper", 1e-3, any_rates)["total"] == pytest.approx(
        float(PowerModel().breakdown("frame", 8, 1e-3).total)
    )
    at_250_hz = PowerModel(
        parameters=PowerParameters(signal_bandwidth_hz=125.0), corrections=frozenset(CORRECTIONS), measured=any_rates
    ).breakdown("frame", 8, 1e-3)
    found = power_of(frames, "consistent", 1e-3, any_rates)
    assert found["io"] == pytest.approx(16_000 * 8 * 0.5 * 5e-12 * 1.8**2)
    assert found["total"] == pytest.approx(float(at_250_hz.total))


def test_a_touch_that_rests_sends_no_events_and_all_frames(textures: Dataset) -> None:
    readouts: dict[str, Any] = {"lcs": SMALL, "frames": FrameSteps(rate_hz=500.0, bits=6, frames_per_step=2)}
    rows = bits_per_second(textures, readouts, (0.0, 0.01), lambda: None)
    sent = {(row["readout"], row["noise_v"], row["phase"]): row["sent_bps"] for row in rows}
    assert sent["lcs", 0.0, "resting"] == 0 < sent["lcs", 0.01, "resting"] < sent["lcs", 0.01, "moving"]
    assert {sent["frames", noise, phase] for noise in (0.0, 0.01) for phase in ("moving", "resting")} == {500 * 64 * 6}
    coded = {(row["readout"], row["noise_v"], row["phase"]): row["coded_bps"] for row in rows}
    assert coded["frames", 0.0, "resting"] < 0.1 * coded["frames", 0.0, "moving"] < 0.1 * 500 * 64 * 6


def test_errors_are_to_the_nearest_crossing_of_the_same_level() -> None:
    true = {(0, 1, True): np.array([0.1, 0.2, 0.3]), (0, 1, False): np.array([0.15]), (1, 1, True): np.array([0.3])}
    found = {
        (0, 1, True): np.array([0.101, 0.24, 0.298, 0.4]),
        (0, 1, False): np.array([0.149, 0.1501]),
        (2, 1, True): np.ones(1),
    }
    assert sorted(_errors(true, found).tolist()) == pytest.approx([-0.002, 0.0001, 0.001])


def test_events_know_times_to_a_sample_and_frames_to_a_period(textures: Dataset) -> None:
    rates = [FrameSteps(rate_hz=rate, bits=8, frames_per_step=1) for rate in (250.0, 1000.0)]
    points = timing_points(textures, SMALL.replace(resolution=3), rates, lambda: None)
    found = {(point["known_from"], point["rate_hz"]): point for point in points}
    assert found["events", 20_000.0]["found"] > 0.97
    assert found["events", 20_000.0]["p95_s"] < 1e-4
    for rate in (250.0, 1000.0):
        late = found["frames", rate]
        assert late["mean_s"] == pytest.approx(0.5 / rate, rel=0.2)
        assert found["interpolated", rate]["median_s"] < 0.6 * late["median_s"]
        assert late["found"] < found["events", 20_000.0]["found"]
    assert found["frames", 250.0]["sent_bps"] == 250 * 6 * 8


def test_steps_of_events_begin_where_they_count() -> None:
    paper = Experiment(dataset="embedded", preset="paper", readout=SMALL)
    assert begin_of(paper) == pytest.approx(0.01, rel=0.06)
    assert begin_of(dataclasses.replace(paper, frames=FrameSteps())) == 0
    assert begin_of(dataclasses.replace(paper, preset="physical")) == 0


def test_float_and_integer_networks_read_the_same_scans() -> None:
    weights = Weights(build(small_network(decay=0.75, output_decay=0.875), seed=1).eval(), ("a", "b", "c"), 0.004)
    found = agreement(weights, random_events(scans=9, bins=40, inputs=8, most=1.0, seed=2), [8])
    assert (found["scans"], sum(found["classes"])) == (9, 9)
    assert found["points"][0]["same"] >= 8
    assert found["points"][0]["spikes_per_bin"] == pytest.approx(found["spikes_per_bin"], rel=0.05)


def test_answers_are_paired_on_the_folds_that_both_have() -> None:
    def point(network: str, folds: dict[int, str]) -> dict[str, Any]:
        answers = [{"fold": f, "seed": 0, "labels": "0123", "predicted": said} for f, said in folds.items()]
        return {"network": network, "time_s": 0.1, "answers": answers}

    (found,) = paired([point("a", {0: "01..", 1: "0123"}), point("b", {0: "0.23"})], "a", "b", ["time_s"])
    assert (found["images"], found["only_first"], found["only_second"]) == (4, 1, 2)
    assert paired([point("a", {1: "0123"}), point("b", {0: "0.23"})], "a", "b", ["time_s"]) == []


def test_the_commands_write_what_they_print_and_keep_their_answers(
    eskin: Any, refuses: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(merits, "NOISES_V", (0.0,))
    monkeypatch.setattr(merits, "FRAMES_HZ", (250.0,))
    two_textures(folder / "textures")
    small = "--dataset textures --folds 2 --epochs 1 --set hidden=8"
    for name, options in (("a", ""), ("b", "--frames frame-onoff:250:8")):
        eskin(f"train {small} {options} -o nets/{name}/fold-0")
    eskin("noise-power nets --noises 1,50 --pair a,b -o out")
    content = json.loads((folder / "out" / "noise_power.json").read_text())
    assert content["command"] == "eskin noise-power nets --noises 1,50 --pair a,b"
    points = content["points"]
    assert [one["images"] for one in content["pairs"]] == [4] * 4
    assert [(p["network"], p["mode"], p["noise_v"]) for p in points[:3]] == [
        ("a", "paper", 0.001),
        ("a", "paper", 0.05),
        ("a", "consistent", 0.001),
    ]
    assert {(p["network"], p["readout"]) for p in points} == {("a", "lcs"), ("b", "frame")}
    assert points[1]["rate_hz"] > points[3]["rate_hz"] > points[2]["rate_hz"]  # slow noise makes fewer events
    answer = points[0]["answers"][0]
    assert points[0]["accuracy"] == np.mean(
        [a == b for a, b in zip(answer["predicted"], answer["labels"], strict=True)]
    )
    before = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*-fold-*.json")}
    eskin("noise-power nets --noises 1,50 -o out")
    assert len(before) == 2
    assert {path: path.stat().st_mtime_ns for path in before} == before

    line = "merits nets --pair a,b --dataset textures --limit 1 --noise out/noise_power.json -o merits"
    eskin(line)
    result = json.loads((folder / "merits" / "merits.json").read_text())
    last = [point for point in result["latency"] if point["network"] == "a"][-1]
    said = json.loads((folder / "nets" / "a" / "fold-0" / "result.json").read_text())["predicted"]
    assert last["answers"][0]["predicted"] == "".join(map(str, said))  # the whole scan lasts less than that
    assert len(result["latency_pairs"]) == 14
    assert len(result["noise"]) == 8
    assert {(one["readout"], one["phase"]) for one in result["rest"]} == set(
        itertools.product(merits.READOUTS, ("moving", "resting"))
    )
    assert (folder / "merits" / "merits.png").stat().st_size > 10_000
    for line, message in (
        ("noise-power nets --noises 1,50,60 -o out", "out/a-fold-0-seed-0.json belongs to other weights, noises or "),
        (
            "noise-power nets --noises 0",
            "--noises must be positive numbers of mV below 1000, separated by commas, not '0'\n",
        ),
        ("merits --pair a,b", "--pair compares trained networks; name their folders"),
        ("merits nets --pair a,c", "--pair must be two of a, b, separated by a comma, not 'a,c'"),
    ):
        refuses(f"error: {message}", line)

    eskin("precision nets/a --variants 8,2:m12 -o few")
    content = json.loads(Path("few/precision.json").read_text())
    assert content["command"] == "eskin precision nets/a --variants 8,2:m12"
    assert [point["variant"] for point in content["points"]] == ["float", "8", "2:m12"]
    assert Path("few/precision.png").stat().st_size > 10_000
    subject = Subject.load(Path("nets/a/fold-0/weights.npz"), scenes=False)
    precision = Precision(in_bits=2, rec_bits=2, out_bits=2, membrane_bits=12)
    network = quantise(subject.weights, precision).network
    point = content["points"][2]
    assert content["tests"]["a"][0]["images"] == subject.images.tolist()
    classes = integer_classes(network, subject.experiment.data(), subject.images)
    assert point["predicted"][0] == "".join(map(str, classes))
    assert (point["memory_bits"], point["membrane_bits"]) == (network.config.memory_bits, 12)
    other = "a-fold-0-seed-0.json belongs to other weights, variants or images; remove it"
    refuses(other, "precision nets/a --variants 8 -o few")


def test_variants_are_read_as_they_are_written() -> None:
    found = parse_variants("8, 4:t6,3:t5:m12")
    weights = {name: (p.in_bits, p.rec_bits, p.out_bits) for name, p in found.items()}
    assert weights == {"8": (8, 8, 8), "4:t6": (4, 4, 4), "3:t5:m12": (3, 3, 3)}
    assert [(p.threshold_bits, p.membrane_bits) for p in found.values()] == [(8, None), (6, None), (5, 12)]
    for text in ("9", "8,8", "4:m", "4:m12:t6", "", "4t6"):
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


def test_additions_are_rows_of_events_and_of_spikes() -> None:
    config = ClassifierConfig(inputs=3, hidden=10, classes=2)
    made = IntegerNetwork(
        config, *(np.zeros(shape, int) for shape in ((3, 10), (10, 10), (10, 2))), np.zeros(10, int), np.zeros(2, int)
    )
    counts = np.zeros((2, 5, 3))
    counts[:, 0] = 1  # three events of each scan, in five bins of 0.1 s
    assert _operations_hz(made, counts, 0.1, 0.1) == pytest.approx((0.6 * 10 + 0.1 * 10 * 12 + 12) / 0.1)
