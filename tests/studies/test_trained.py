"""Test the studies of trained networks: robustness, noise, latency, rest, timing and precision."""

import dataclasses
import itertools
import json
import shutil
from pathlib import Path
from types import ModuleType
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
from eskin.snn.experiments.evaluate import integer_classes
from eskin.snn.experiments.experiment import Experiment
from studies import merits, networks, noise_power, precision, robustness
from studies.merits import _errors, begin_of, bits_per_second, timing_points
from studies.networks import Subject, all_pairs, paired
from studies.noise_power import Noise, Rates, noisy_scans, power_of
from studies.precision import _operations_hz, points_of, precision_of
from studies.robustness import summarise
from studies.study import OUT
from tests.snn.helpers import few_textures, two_textures

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
    (clean, rates), (slow, _), (noise, more) = noisy_scans(made, images, noises)
    whole = made.data()
    assert np.array_equal(clean.values, whole.values[images])
    assert np.array_equal(slow.values, clean.values)
    assert not np.array_equal(noise.values, clean.values)
    assert clean.labels.tolist() == whole.image_labels[images].tolist()
    assert rates.population_hz == pytest.approx(clean.rate_hz)
    assert rates.population_hz**2 / 6 <= rates.square_sum_hz2 * (1 + 1e-9) <= rates.population_hz**2
    assert (more.population_hz > rates.population_hz) == (kind != "frames")


@pytest.mark.quick
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


def test_answers_are_paired_on_the_folds_that_both_have() -> None:
    def point(network: str, folds: dict[int, str]) -> dict[str, Any]:
        answers = [{"fold": f, "seed": 0, "labels": "0123", "predicted": said} for f, said in folds.items()]
        return {"network": network, "time_s": 0.1, "answers": answers}

    (found,) = paired([point("a", {0: "01..", 1: "0123"}), point("b", {0: "0.23"})], "a", "b", ["time_s"])
    assert (found["images"], found["only_first"], found["only_second"]) == (4, 1, 2)
    assert paired([point("a", {1: "0123"}), point("b", {0: "0.23"})], "a", "b", ["time_s"]) == []
    three = [point(network, {0: "0123"}) for network in "cab"]
    names = [one["first"] + one["second"] for one in all_pairs(three, ["time_s"])]
    assert names == ["ab", "ac", "bc"]


def test_variants_are_read_as_they_are_written() -> None:
    found = [precision_of(name) for name in ("8", "4:t6", "3:t5:m12")]
    assert [(p.in_bits, p.rec_bits, p.out_bits) for p in found] == [(8, 8, 8), (4, 4, 4), (3, 3, 3)]
    assert [(p.threshold_bits, p.membrane_bits) for p in found] == [(8, None), (6, None), (5, 12)]
    assert len({precision_of(name) for name in precision.VARIANTS}) == len(precision.VARIANTS)


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


def test_answers_of_folds_and_seeds_are_summed_up_by_image() -> None:
    def cell(fold: int, seed: int, predicted: list[int]) -> dict[str, Any]:
        images = [2 * i + fold for i in range(3)]
        about = {"network": "a", "disturbance": "noise", "strength": 0.01, "rate_hz": 100.0 * (fold + 1)}
        return about | {"fold": fold, "seed": seed, "images": images, "labels": [0, 1, 2], "predicted": predicted}

    (point,) = summarise([cell(0, 0, [0, 1, 2]), cell(1, 0, [0, 0, 0]), cell(0, 1, [0, 1, 0]), cell(1, 1, [0, 1, 2])])
    assert point["accuracy"] == pytest.approx((3 + 1 + 2 + 3) / 12)
    assert (point["images"], point["folds"], point["seeds"], point["rate_hz"]) == (6, [0, 1], [0, 1], 150.0)


def counted(module: ModuleType, name: str, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return a list that grows with every call of a function of a module."""
    calls: list[Any] = []
    original = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *arguments: calls.append(arguments) or original(*arguments))
    return calls


@pytest.fixture
def trained(eskin: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Train the networks ``a`` and ``b``, and ``frames`` on frames; return the folder of the trainings."""
    two_textures(folder / "textures")
    monkeypatch.setenv("ESKIN_DATA", str(folder / "textures"))
    small = "--dataset textures --folds 2 --epochs 1 --set hidden=8"
    for name, options in (("a", ""), ("b", "--disturbed 1"), ("frames", "--frames frame-onoff:250:8")):
        eskin(f"train {small} {options} -o out/train/{name}/fold-0")
    return folder / "out" / "train"


def test_robustness_keeps_resumes_and_pairs_its_cells(
    trained: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = [("clean", 0.0), ("dead", 0.2), *(("lost", strength) for strength in (0.1, 0.3, 0.5))]
    monkeypatch.setattr(robustness, "CASES", cases)
    calls = counted(robustness, "answers", monkeypatch)
    data, figure = robustness.RESULT.make("robustness", OUT)
    assert "fold-0/weights.npz was not trained on events of physical scans" in capsys.readouterr().err
    content = json.loads(data.read_text())
    assert content["command"] == "python -m studies.robustness"
    points = content["points"]
    assert [(p["disturbance"], p["strength"]) for p in points[::2]] == cases
    assert [point["network"] for point in points[:2]] == ["a", "b"]
    assert points[0]["answers"][0]["labels"] == points[1]["answers"][0]["labels"]
    assert points[0]["accuracy"] == np.mean(
        np.equal(points[0]["answers"][0]["predicted"], points[0]["answers"][0]["labels"])
    )
    assert points[8]["rate_hz"] == pytest.approx(0.5 * points[0]["rate_hz"], rel=0.05)
    assert figure.stat().st_size > 10_000
    assert len(calls) == len(cases), "networks with the same scans are tested together"
    assert robustness.RESULT.make("robustness", OUT) == [figure], "finished data are only drawn"
    (work,) = (OUT / "work").glob(".robustness.json.store")
    first, *others = filter(None, work.read_text().splitlines())
    for found, again in (([first, *others], 0), (others, 1), ([first.replace("labels", "labours"), *others], 1)):
        calls.clear()
        data.unlink()
        work.write_text("\n".join([*found, ""]))
        robustness.RESULT.make("robustness", OUT)
        assert len(calls) == again, "missing and damaged cells alone are computed"
        assert json.loads(data.read_text()) == content
    shutil.copytree(trained / "a" / "fold-0", trained / "a" / "again")
    with pytest.raises(InputError, match=r"^network 'a' has two trainings with fold 0 and seed 0; rename a folder$"):
        networks.trained_networks()


def test_noise_latency_and_precision_of_trained_networks(trained: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (trained / "b").rename(trained.parent / "b")
    (trained / "frames").rename(trained / "b")
    monkeypatch.setattr(noise_power, "NOISES_V", (1e-3, 0.05))
    for name, value in (("NOISES_V", (0.0,)), ("FRAMES_HZ", (250.0,)), ("TEXTURES", 1)):
        monkeypatch.setattr(merits, name, value)
    calls = counted(noise_power, "_cell", monkeypatch)
    data, figure = noise_power.RESULT.make("noise_power", OUT)
    assert figure.stat().st_size > 10_000
    content = json.loads(data.read_text())
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
    right = [a == b for a, b in zip(answer["predicted"], answer["labels"], strict=True)]
    assert points[0]["accuracy"] == np.mean(right)
    data.rename("noise_power.json")
    noise_power.RESULT.make("noise_power", OUT)
    assert len(calls) == 2, "once for each network"
    data.unlink()
    monkeypatch.setattr(noise_power, "NOISES_V", (1e-3,))
    noise_power.RESULT.make("noise_power", OUT)
    assert len(calls) == 4, "other noises need other tests"
    Path("noise_power.json").rename(data)

    data, figure = merits.RESULT.make("merits", OUT)
    result = json.loads(data.read_text())
    last = [point for point in result["latency"] if point["network"] == "a"][-1]
    said = json.loads((trained / "a" / "fold-0" / "result.json").read_text())["predicted"]
    assert last["answers"][0]["predicted"] == "".join(map(str, said))  # the whole scan lasts less than that
    assert len(result["latency_pairs"]) == 14
    assert result["noise"] == points
    assert {(one["readout"], one["phase"]) for one in result["rest"]} == set(
        itertools.product(merits.READOUTS, ("moving", "resting"))
    )
    assert figure.stat().st_size > 10_000

    (trained / "b").rename(trained.parent / "c")
    monkeypatch.setattr(precision, "VARIANTS", ("8", "2:m12"))
    data, figure = precision.RESULT.make("precision", OUT)
    content = json.loads(data.read_text())
    assert [point["variant"] for point in content["points"]] == ["float", "8", "2:m12"]
    assert figure.stat().st_size > 10_000
    subject = Subject.load(trained / "a" / "fold-0" / "weights.npz", scenes=False)
    few = Precision(in_bits=2, rec_bits=2, out_bits=2, membrane_bits=12)
    network = quantise(subject.weights, few).network
    point = content["points"][2]
    assert content["tests"]["a"][0]["images"] == subject.images.tolist()
    classes = integer_classes(network, subject.experiment.data(), subject.images)
    assert point["predicted"][0] == "".join(map(str, classes))
    assert (point["memory_bits"], point["membrane_bits"]) == (network.config.memory_bits, 12)
    data.unlink()
    weights = trained / "a" / "fold-0" / "weights.npz"
    weights.write_bytes((trained.parent / "b" / "fold-0" / "weights.npz").read_bytes())
    monkeypatch.setattr(precision, "VARIANTS", ("8",))
    calls = counted(precision, "_cell", monkeypatch)
    precision.RESULT.make("precision", OUT)
    assert len(calls) == 1, "other weights need other tests"


def test_studies_of_trained_networks_need_one(folder: Path) -> None:
    with pytest.raises(InputError, match=r"^no trained network in out/train; make one with eskin train --preset physi"):
        networks.trained_networks(scenes=True)
