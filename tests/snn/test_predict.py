"""Test that predictions from RTL events and model events are equal, and that differences are found."""

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.cli import printable
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.foreign.aedat4 import write_aedat4
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.record import record, record_dataset
from eskin.snn.exchange.nir_network import save_nir
from eskin.snn.exchange.weights import save_weights
from eskin.snn.experiments import evaluate
from eskin.snn.experiments.evaluate import Check
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.trained import load_trained, read_result
from tests.conftest import run_eskin
from tests.snn.helpers import some_weights

CONFIG = ReadoutConfig(rows=1, columns=4)
BINS = BinConfig(bin_s=0.01)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a short training on the embedded textures."""
    folder = tmp_path_factory.mktemp("trained")
    (folder / "readout.json").write_text(CONFIG.to_json())
    arguments = ["train", "--dataset", "embedded", "--config", str(folder / "readout.json"), "--bin", "0.01"]
    arguments += ["--set", "hidden=32", "--set", "batch=8", "--epochs", "20", "--out", str(folder)]
    done = run_eskin(*arguments)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("data: events of lcs with 6 bits from embedded textures, physical scan\n")
    return folder


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with model recordings of six textures, in the form of RTL recordings."""
    folder = tmp_path_factory.mktemp("replayed")
    for texture in embedded_dataset().limit(6):
        made = record(texture, "embedded", PhysicalScan(), CONFIG)
        metadata = made.metadata | {"source": "rtl", "ticks": made.duration_clocks // CONFIG.clocks_per_sample}
        path = folder / f"{texture.name}.npz"
        path.parent.mkdir(exist_ok=True)
        dataclasses.replace(made, metadata=metadata).save(path)
    return folder


@pytest.fixture
def predict(eskin: Any, trained: Path, tmp_path: Path) -> Any:
    """Return the fixture ``eskin`` for predict with the trained weights."""

    def predict(*words: object, weights: Path = trained / "weights.npz", code: int = 0) -> tuple[str, str]:
        return eskin("predict", weights, *words, "-o", tmp_path / "predictions.json", code=code)

    return predict


def images_in(folder: Path) -> list[dict[str, Any]]:
    return json.loads((folder / "predictions.json").read_text())["images"]


def test_foreign_events_get_the_class_of_ours(tmp_path: Path, replayed: Path, predict: Any) -> None:
    """Check that microsecond time stamps keep every event in its bin of 10 ms."""
    pytest.importorskip("dv_processing", reason="the group exchange is not installed")
    for path in replayed.rglob("*.npz"):
        target = tmp_path / "theirs" / path.relative_to(replayed).with_suffix(".aedat4")
        target.parent.mkdir(parents=True, exist_ok=True)
        write_aedat4(target, Recording.load(path))
    predict("--events", replayed)
    ours = {image["class"] + image["name"].split("/")[-1]: image for image in images_in(tmp_path)}
    predict("--events", tmp_path / "theirs")
    theirs = {image["class"] + image["name"].split("/")[-1]: image for image in images_in(tmp_path)}
    assert {name: image["predicted"] for name, image in theirs.items()} == {
        name: image["predicted"] for name, image in ours.items()
    }
    assert len(theirs) == 6


def test_a_folder_of_foreign_events_is_learned_and_its_files_are_classified(
    tmp_path: Path, eskin: Any, refuses: Callable[..., None], predict: Any
) -> None:
    rng = np.random.default_rng(6)
    for number in range(12):
        begin = 1_700_000_000_000_000 + int(rng.integers(1_000_000_000))
        times, x = np.sort(rng.integers(0, 300_000, 200)), rng.integers(0, 2, 200) + 2 * (number % 2)
        lines = ["t,x,y,p", *(f"{begin + t},{column},0,1" for t, column in zip(times.tolist(), x, strict=True))]
        file = tmp_path / "theirs" / "ab"[number % 2] / f"{number}.csv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(lines))
    train = ["train", "--events", "ours", "--folds", "3", "--bin", "0.01", "--epochs", "12", "--set", "hidden=16"]
    for arguments in (["convert", "theirs", "-o", "ours"], [*train, "--set", "batch=4", "--out", "trained"]):
        eskin(*arguments)
    Path("theirs/a/0.csv").rename("theirs/a/new.csv")
    refuses("contains 1 .npz file that this command would not overwrite (ours/a/0.npz)", "convert theirs -o ours")
    assert {Recording.load(path).config.columns for path in Path("ours").rglob("*.npz")} == {4}
    predict("--events", "ours", weights=Path("trained/weights.npz"))
    found = images_in(tmp_path)
    assert len(found) == 12
    assert [image["class"] for image in found] == [image["predicted"] for image in found]


@pytest.mark.skipif(shutil.which("g++") is None or shutil.which("perl") is None, reason="no simulator: g++ and perl")
def test_predictions_from_rtl_spikes_are_those_from_model_spikes(
    tmp_path: Path, trained: Path, eskin: Any, predict: Any
) -> None:
    eskin("replay --rows 1 --columns 4 --dataset embedded --limit 6 --workers 1 --out replay")
    output, _ = predict("--events", "replay", "--check-model", "--metrics")
    assert "6 of 6 images: same events, same tensors, same logits, same predictions (" in output
    work = json.loads((tmp_path / "predictions.json").read_text())["metrics"]["synaptic_operations"]
    assert f"synaptic operations of a recording: {work['Effective_MACs']:,.0f} MACs, " in output
    assert 0 < work["Effective_MACs"] + work["Effective_ACs"] < work["Dense"]
    of_rtl = images_in(tmp_path)
    assert {image["source"] for image in of_rtl} == {"rtl"}
    assert all(image["predicted"] == image["model_predicted"] for image in of_rtl)
    data = record_dataset(embedded_dataset().limit(6), PhysicalScan(), CONFIG, BINS)
    of_model = evaluate.logits_of(load_trained(trained / "weights.npz").weights.network, data)
    assert [image["name"] for image in of_rtl] == list(data.names)
    assert [image["logits"] for image in of_rtl] == of_model.tolist()
    assert len(np.unique(of_model, axis=0)) == 6


def test_test_images_are_told_from_training_images(tmp_path: Path, trained: Path, predict: Any) -> None:
    for texture in embedded_dataset():
        path = tmp_path / "all" / f"{texture.name}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        record(texture, "embedded", PhysicalScan(), CONFIG).save(path)
    output, _ = predict("--events", tmp_path / "all")
    result = json.loads((trained / "result.json").read_text())
    right = sum(a == b for a, b in zip(result["labels"], result["predicted"], strict=True))
    assert f"test images of the fold: accuracy {result['accuracy']:.1%} ({right} of {len(result['labels'])})" in output
    assert "training images (used in the training: not a valid result): accuracy" in output
    tested = [image for image in images_in(tmp_path) if image["part"] == "test"]
    assert [image["predicted"] for image in tested] == [result["class_names"][k] for k in result["predicted"]]
    accuracy = json.loads((tmp_path / "predictions.json").read_text())["accuracy"]
    assert {part: score["learned"] for part, score in accuracy.items()} == {"test": False, "training": True}
    assert accuracy["test"]["images"] + accuracy["training"]["images"] == 48
    assert len({image["predicted"] for image in images_in(tmp_path)}) > 1


def test_images_of_another_dataset_or_readout_are_told(tmp_path: Path, replayed: Path, predict: Any) -> None:
    made = Recording.load(replayed / "brick" / "brick-00.npz")
    config, metadata = CONFIG.replace(resolution=5), made.metadata | {"dataset": "mine"}
    dataclasses.replace(made, config=config, metadata=metadata).save(tmp_path / "a.npz")
    output, error = predict("--events", tmp_path / "a.npz")
    assert "images not used in the training: accuracy" in output
    assert images_in(tmp_path)[0]["part"] == "other"
    assert error == "warning: the readout differs from the readout of the training: resolution 5, in training 6\n"
    assert predict("--events", replayed)[1] == ""


def test_without_the_result_of_the_training_nothing_is_said_about_folds(
    tmp_path: Path, trained: Path, replayed: Path, predict: Any
) -> None:
    shutil.copy(trained / "weights.npz", tmp_path / "weights.npz")
    output, _ = predict("--events", replayed, weights=tmp_path / "weights.npz")
    assert "all images: accuracy" in output
    assert "learned some of them: result.json of the training is missing beside weights.npz" in output
    assert {image["part"] for image in images_in(tmp_path)} == {None}


def copied(trained: Path, folder: Path, experiment: dict[str, Any] | None = None, **changes: Any) -> Path:
    """Copy weights and result of the training, with changed fields; return the path of the weights."""
    result = json.loads((trained / "result.json").read_text())
    result["experiment"] |= experiment or {}
    (folder / "result.json").write_text(json.dumps(result | changes))
    return shutil.copy(trained / "weights.npz", folder / "weights.npz")


def test_other_images_than_those_of_the_training_are_noticed(tmp_path: Path, trained: Path) -> None:
    found = load_trained(copied(trained, tmp_path, labels=[0], predicted=[]))
    assert found.parts == {}
    assert found.unknown == "the images differ from the training images; give the training's textures with --dataset"
    found = load_trained(copied(trained, tmp_path, {"dataset": "gone"}))
    assert found.unknown.startswith("the images of the training are missing (dataset directory gone")


def test_a_training_on_event_files_has_its_folds_too(tmp_path: Path, replayed: Path, trained: Path) -> None:
    folds = {"folds": 2, "fold": 1, "labels": [0, 1, 2], "predicted": []}
    found = load_trained(copied(trained, tmp_path, {"events": str(replayed)}, **folds))
    assert sorted(found.parts.values()) == ["test"] * 3 + ["training"] * 3
    assert found.part_of(Recording.load(next(replayed.rglob("*.npz")))) in ("test", "training")
    assert found.readout is None


def test_a_recording_without_a_class_is_only_classified(tmp_path: Path, replayed: Path, predict: Any) -> None:
    made = Recording.load(replayed / "grass" / "grass-00.npz")
    expected = predict("--events", replayed / "grass" / "grass-00.npz")[0].splitlines()[1]
    (tmp_path / "in").mkdir()
    dataclasses.replace(made, metadata={"name": ["no", "name"]}).save(tmp_path / "in" / "mine.npz")
    output, _ = predict("--events", tmp_path / "in")
    assert "accuracy" not in output
    assert output.splitlines()[1] == expected.replace("grass/grass-00", "mine").replace(
        "class: grass", "class: not known"
    )
    assert images_in(tmp_path)[0]["class"] is None


def test_the_bins_are_those_of_the_training(tmp_path: Path, trained: Path, replayed: Path, predict: Any) -> None:
    bins = BinConfig(bin_s=0.02, start_s=0.04, stop_s=0.1, polarity=False)
    weights = copied(trained, tmp_path, {"bins": dataclasses.asdict(bins)})
    classes = load_trained(trained / "weights.npz").weights.class_names
    save_weights(weights, some_weights(classes, 0.02, inputs=4, readout="membrane"))
    output, _ = predict("--events", replayed, "--check-model", weights=weights)
    assert output.startswith("6 recordings; 3 steps of 4 channels, 0.02 s each")
    (tmp_path / "result.json").unlink()
    _, error = predict("--events", replayed, weights=weights, code=2)
    assert error.startswith("error: the network has 4 input channels, but the scans have 8 (4 taxels)")


GRAVEL = "gravel/gravel-00"


def tampered(replayed: Path, folder: Path, metadata: dict[str, Any] | None = None, **changes: Any) -> Path:
    """Copy the recordings with one changed; return the changed file."""
    shutil.copytree(replayed, folder)
    path = folder / f"{GRAVEL}.npz"
    made = Recording.load(path)
    dataclasses.replace(made, metadata=made.metadata | (metadata or {}), **changes).save(path)
    return path


@pytest.mark.command("train", "predict")
def test_an_intact_replay_passes(replayed: Path, predict: Any, tmp_path: Path) -> None:
    output, _ = predict("--events", replayed, "--events", replayed / "brick" / "brick-00.npz", "--check-model")
    events = sum(len(Recording.load(path).events) for path in replayed.rglob("*.npz"))
    last = output.splitlines()[-1]
    assert last == f"6 of 6 images: same events, same tensors, same logits, same predictions ({events} events)"
    report = json.loads((tmp_path / "predictions.json").read_text())
    assert report["check"] == {
        "compared": 6,
        "events": events,
        "different": {"events": [], "tensors": [], "logits": [], "predictions": []},
    }
    assert str(tmp_path) not in json.dumps(report)


def later(events: Any) -> Any:
    """Move an event by a clock within its bin."""
    width = round(BINS.bin_s * CONFIG.clock_hz)
    free = (np.diff(events["t"]) > 1) & ((events["t"][:-1] + 1) // width == events["t"][:-1] // width)
    events["t"][np.flatnonzero(free)[7]] += 1
    return events


def flip(events: Any) -> Any:
    events["p"][40] = ~events["p"][40]
    return events


def other_taxel(events: Any) -> Any:
    events["x"][40] = (events["x"][40] + 1) % CONFIG.columns
    return events


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (later, "differs in clock: model clock"),
        (lambda events: np.delete(events, 40), "event 40 differs in"),
        (lambda events: events[:-1], "; RTL nothing more\n"),  # behind the last whole bin
        (flip, "event 40 differs in polarity: model"),
        (other_taxel, "event 40 differs in column: model"),
        ({"config": CONFIG.replace(resolution=5)}, "RTL and model differ"),
        ({"config": CONFIG.replace(link="four_phase")}, "differs in clock: model"),
        ({"metadata": {"name": "gravel/gravel-05"}}, "gravel/gravel-05: RTL and model differ"),
        ({"metadata": {"start_row": 3.0}}, "RTL and model differ"),
        ({"metadata": {"class": "grass"}}, f"{GRAVEL} states the class 'grass', but its texture is of class 'gravel'"),
        ({"duration_clocks": -1}, f"{GRAVEL} ends at clock"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_a_recording_that_differs_from_the_model_is_found(
    tmp_path: Path, replayed: Path, predict: Any, change: Any, words: str
) -> None:
    events = Recording.load(replayed / f"{GRAVEL}.npz").events.copy()
    changes = {"events": change(events)} if callable(change) else dict(change)
    if "duration_clocks" in changes:
        changes["duration_clocks"] = int(events["t"][-1]) + 1
    path = tampered(replayed, tmp_path / "in", **changes)
    output, _ = predict("--events", path if "config" in changes else tmp_path / "in", "--check-model", code=1)
    assert words in output
    assert "reproduce: eskin predict" in output
    assert f"--events {path} --check-model\n" in output
    last = output.splitlines()[-1]
    assert f"FAILED: {1 if 'config' in changes else 6} images compared, different: 1 in events, " in last
    assert change is not later or last.endswith(", 0 in tensors, 0 in logits, 0 in predictions")
    report = json.loads((tmp_path / "predictions.json").read_text())
    assert report["check"]["different"]["events"] == [changes.get("metadata", {}).get("name", GRAVEL)]


def test_counts_and_logits_are_compared_by_themselves(
    replayed: Path, predict: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that defects in binning and in the network are found although events are equal."""
    original = evaluate.bin_recording

    def lossy(recording: Recording, bins: BinConfig) -> Any:
        counts = original(recording, bins)
        return counts - (counts > 1)

    with monkeypatch.context() as patch:
        patch.setattr(evaluate, "bin_recording", lossy)
        output, _ = predict("--events", replayed, "--check-model", code=1)
    assert "brick/brick-00: step 0, taxel (0, 0), channel 0: model" in output
    assert "images compared, different: 0 in events, 6 in tensors, " in output
    calls = 0
    forward = evaluate.logits_of

    def drifting(*arguments: Any) -> Any:
        nonlocal calls
        calls += 1
        found = forward(*arguments)
        return found if calls % 2 else np.nextafter(found, np.float32(9))

    with monkeypatch.context() as patch:
        patch.setattr(evaluate, "logits_of", drifting)
        output, _ = predict("--events", replayed, "--check-model", code=1)
    assert "brick/brick-00: logits of the model [" in output
    assert "images compared, different: 0 in events, 0 in tensors, 6 in logits, 0 in predictions" in output


def test_nothing_compared_is_a_failure(tmp_path: Path, replayed: Path, predict: Any) -> None:
    made = Recording.load(replayed / "brick" / "brick-00.npz")
    dataclasses.replace(made, metadata=made.metadata | {"source": "model"}).save(tmp_path / "a.npz")
    output, _ = predict("--events", tmp_path / "a.npz", "--check-model", code=1)
    assert output.splitlines()[-1] == ('FAILED: nothing was compared, none of 1 recordings has the source "rtl"')
    assert not Check([], 0, {}, np.zeros((1, 3), np.float32)).passed
    output, _ = predict("--events", tmp_path / "a.npz", "--events", replayed, "--check-model")
    assert "1 recordings do not come from the RTL and were not compared" in output
    assert output.splitlines()[-1].startswith("6 of 6 recordings: same events")


@pytest.mark.parametrize(
    ("metadata", "sentence"),
    [
        ({"dataset": None}, "gravel/gravel-00 has no dataset name; play it again"),
        ({"dataset": "mine"}, "is a scan of dataset mine, not of embedded; name its folder with --dataset"),
        ({"name": "x"}, "dataset embedded has no texture 'x'; give its folder with --dataset"),
        ({"start_row": "top"}, "gravel/gravel-00 has no preset and start row; play it again"),
        ({"start_row": 900.0}, "the scan of gravel/gravel-00 cannot be repeated: start row must be in"),
        ({"ticks": 50}, "gravel/gravel-00 has 50 sample ticks, but the scan of its texture has"),
    ],
    ids=str,
)
def test_a_scan_that_the_model_cannot_make_again_is_refused(
    tmp_path: Path, replayed: Path, predict: Any, metadata: dict[str, Any], sentence: str
) -> None:
    path = tampered(replayed, tmp_path / "in", metadata)
    _, error = predict("--events", path, "--check-model", "--dataset", "embedded", code=2)
    assert sentence in error


def test_damaged_results_and_missing_events_are_refused(
    tmp_path: Path, trained: Path, replayed: Path, predict: Any
) -> None:
    damaged = "is damaged or not the result of a training; remove it or train again\n"
    for experiment, changes, words in (
        ({}, {"class_names": ["a", "b", "c"]}, "has other classes or time bins than weights.npz"),
        ({}, {"fold": -1}, damaged),
        ({}, {"fold": 6}, damaged),
        ({"frames": {"frames_per_step": 20}, "network": {"kind": "rnn"}}, {}, "was trained on frames and cannot"),
    ):
        path = copied(trained, tmp_path, experiment, **changes)
        assert words in predict("--events", replayed, weights=path, code=2)[1]
    (tmp_path / "result.json").write_text("{}")
    _, error = predict("--events", replayed, weights=path, code=2)
    assert error == f"error: {tmp_path}/result.json {damaged}"
    _, error = predict("--events", tmp_path / "none.npz", code=2)
    assert error.endswith("none.npz does not exist; make one with eskin replay\n")


@pytest.mark.parametrize(
    "change",
    [
        {"class_names": "abc"},
        {"class_names": None},
        {"class_names": ["a", "b", 3]},
        {"fold": "0"},
        {"fold": True},
        {"folds": 2.5},
        {"labels": "01"},
        {"labels": [None]},
        {"experiment": 3},
        {"experiment": {}},
        {"bins": {"bin_s": True}},
        {"bins": {"bin_s": "0.002"}},
        {"frames": {"bits": "3"}},
        {"train": {"epochs": "3"}},
        {"train": {"epochs": True}},
        {"network": {"decay": [1]}},
        {"network": 7},
    ],
    ids=str,
)
def test_a_result_with_wrong_types_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    experiment = Experiment(bins=BinConfig(bin_s=0.002)).to_dict()
    good = {"experiment": experiment, "class_names": list("abc"), "fold": 0, "folds": 2, "labels": [0, 1, 2]}
    path = tmp_path / "result.json"
    path.write_text(json.dumps(good))
    assert read_result(path, path, some_weights()).class_names == tuple("abc")
    name = next(iter(change))
    path.write_text(json.dumps(good | ({"experiment": experiment | change} if name in experiment else change)))
    with pytest.raises(InputError, match="is damaged or not the result of a training; remove it or train again"):
        read_result(path, path, some_weights())


def test_a_name_is_shown_and_not_obeyed(eskin: Any, replayed: Path, folder: Path) -> None:
    assert printable("\x1b[2Jclear\x07 \u202egnp.exe \x9b1m") == "\\x1b[2Jclear\\x07 \\u202egnp.exe \\x9b1m"
    assert printable("Kylberg Gefühl, 砂 — ok") == "Kylberg Gefühl, 砂 — ok"
    evil = "sand\x1b]0;title\x07"
    weights = some_weights((evil, "b", "c"), 0.01, inputs=8, readout="membrane")
    save_weights(Path("w.npz"), weights)
    made = Recording.load(replayed / "brick" / "brick-00.npz")
    for kind, expected, words in ((evil, 0, "sand\\x1b]0;title\\x07"), (f"not {evil}", 2, "has the unknown class")):
        dataclasses.replace(made, metadata={"name": evil, "class": kind}).save(Path("a.npz"))
        shown = "".join(eskin("predict w.npz --events a.npz -o p.json", code=expected))
        assert (words in shown, "\x1b" in shown) == (True, False)
    save_nir(Path("w.nir"), weights)
    assert "\x1b" not in eskin("import w.nir -o b.npz")[0]
