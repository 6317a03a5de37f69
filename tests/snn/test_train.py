"""Test training with exact restart after a kill, cross-validation, and invalid input."""

import dataclasses
import functools
import inspect
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from eskin.app.commands.learn import train as commands
from eskin.app.commands.learn.options import build_experiment
from eskin.app.options import LEAKY
from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.base.workers.engine import Local
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.adam import Adam
from eskin.snn.checkpoint import Checkpoint, read_checkpoint
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import stratified_folds
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import frame_dataset
from eskin.snn.data.record import record_dataset
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.crossval import run_cell, summarise
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import bootstrap, wilson
from eskin.snn.experiments.recipes import RECIPES
from eskin.snn.experiments.settings import experiment_of, parse_settings
from eskin.snn.experiments.single import Fold
from eskin.snn.experiments.sweep import cross_validate
from eskin.snn.network import build
from eskin.snn.network_config import FIELDS, KINDS, NetworkConfig
from eskin.snn.train import logits_of, predicted_classes, train
from eskin.snn.training import DivergedError, Epoch, TrainConfig
from tests.snn.helpers import CLASSES, easy_data, small_network

ROOT = Path(__file__).parents[2]
UNSET: dict[str, Any] = dict.fromkeys(inspect.signature(commands.crossval).parameters)


def test_a_network_learns_an_easy_task() -> None:
    data = easy_data()
    made = train(Split(data, range(21)), small_network(), TrainConfig(epochs=25, batch=8), seed=0)
    assert made.history[-1].loss < 0.5 * made.history[0].loss
    assert (predicted_classes(made.network, data, range(21, 30)) == data.labels[21:]).mean() >= 8 / 9
    one, other = (predicted_classes(made.network, data, images).tolist() for images in ([25, 3], [3, 25]))
    assert one == other[::-1]


def test_a_resumed_training_ends_in_the_same_bits(tmp_path: Path) -> None:
    data, network = easy_data(), small_network(dropout=0.3)
    config = TrainConfig.from_dict(
        {"epochs": 6, "batch": 8, "shift_steps": 2, "drop_taxels": 0.2, "cosine": True, "weight_decay": 0.01}
    )
    whole = train(Split(data, range(21), held_out=range(21, 30), test=range(21, 30)), network, config, 1)

    class Stopped(Exception):
        pass

    def stop(epoch: Epoch) -> None:
        if epoch.number == 5:
            raise Stopped

    split = Split(data, range(21), range(21, 30), range(21, 30))
    checkpoint = Checkpoint(tmp_path / "c.pt", every=2)
    with pytest.raises(Stopped):
        train(split, network, config, 1, checkpoint=checkpoint, progress=stop)
    torch.manual_seed(77)
    seen: list[int] = []
    again = train(split, network, config, 1, checkpoint=checkpoint, progress=lambda epoch: seen.append(epoch.number))
    assert seen == [5, 6]
    assert again.history == whole.history
    assert again.best == whole.best
    for a, b in zip(again.network.parameters(), whole.network.parameters(), strict=True):
        assert torch.equal(a, b)


def test_the_selected_epoch_is_that_of_the_held_out_images_not_of_the_test() -> None:
    data = easy_data()
    made = train(
        Split(data, range(15), held_out=range(15, 21), test=range(21, 30)),
        small_network(),
        TrainConfig(epochs=8, batch=8),
        0,
    )
    accuracies = [epoch.held_out for epoch in made.history]
    best = max(a for a in accuracies if a is not None)
    assert made.best["epoch"] == max(e.number for e in made.history if e.held_out == best)
    assert len(made.best["predictions"]) == 9


def test_a_killed_command_goes_on_and_ends_in_the_same_bits(eskin: Any, folder: Path) -> None:
    (folder / "small.json").write_text(json.dumps({"rows": 2, "columns": 2, "resolution": 4}))
    command = f"train --dataset embedded --bin 0.02 --set hidden=32 --config {folder / 'small.json'} --epochs 100"
    command += f" --out {folder}/"
    words = [sys.executable, "-m", "eskin", *f"{command}killed --checkpoint-every 1".split()]
    killed = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    checkpoints = [folder / name / "checkpoint.pt" for name in ("killed", "whole")]
    while not checkpoints[0].exists() and killed.poll() is None:
        time.sleep(0.01)
    killed.kill()
    killed.wait()
    found = len(read_checkpoint(checkpoints[0])["history"])
    assert 1 <= found < 100
    for name, continues in (("killed", True), ("whole", False)):
        _, error = eskin(f"{command}{name}")
        assert (f"continuing after epoch {found} of 100\n" in error) == continues, error
    assert (folder / "killed/result.json").read_text() == (folder / "whole/result.json").read_text()
    states = [read_checkpoint(path)["network"] for path in checkpoints]
    assert all(torch.equal(tensor, states[1][name]) for name, tensor in states[0].items())


def test_signs_of_divergence_are_named() -> None:
    assert Epoch(2, 1.0, 0.5, None, 0.05, 1.0).warnings(True, 6) == []
    assert "three times that of guessing" in Epoch(2, 9.0, 0.5, None, 0.05, 1.0).warnings(True, 6)[0]
    assert "norm of 1e+06" in Epoch(2, 1.0, 0.5, None, 0.05, 1e6).warnings(True, 6)[0]
    assert "hardly fire" in Epoch(2, 1.0, 0.5, None, 0.0, 1.0).warnings(True, 6)[0]
    assert "in most steps" in Epoch(2, 1.0, 0.5, None, 0.9, 1.0).warnings(True, 6)[0]
    assert Epoch(2, 1.0, 0.5, None, 0.0, 1.0).warnings(False, 6) == []
    assert "never fire (2 of 6)" in Epoch(2, 1.0, 0.5, None, 0.05, 1.0, 2).warnings(True, 6)[0]


def test_output_neurons_that_never_fire_are_counted() -> None:
    made = train(
        Split(easy_data(), range(21)), small_network(readout="spikes", hidden=2), TrainConfig(epochs=1), seed=0
    )
    logits = made.network(easy_data().batch(range(21))).logits
    assert made.history[0].silent_outputs == int((logits == 0).all(0).sum()) > 0


def test_a_loss_or_weight_that_is_no_number_stops_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DivergedError, match="diverged in epoch 1: the loss is "):
        train(Split(easy_data(), range(21)), small_network(output_scale=1e38), TrainConfig(epochs=3), 0)
    original = Adam.step

    def broken(self: Adam) -> None:
        original(self)
        with torch.no_grad():
            self.parameters[0].view(-1)[0] = math.nan

    monkeypatch.setattr(Adam, "step", broken)
    with pytest.raises(DivergedError, match="a weight is not a number; lower the learning rate"):
        train(Split(easy_data(), range(21)), small_network(), TrainConfig(epochs=1, batch=64), 0)


def test_a_checkpoint_of_another_configuration_or_a_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.pt"

    def train_on(images: int = 21, seed: int = 0, epochs: int = 1, **fields: Any) -> None:
        split, config = Split(easy_data(), range(images)), TrainConfig(epochs=epochs)
        train(split, small_network(**fields), config, seed, checkpoint=Checkpoint(path))

    train_on()
    remedy = "remove it or choose another folder with --out"
    with pytest.raises(InputError) as error:
        train_on(seed=1)
    assert str(error.value) == f"checkpoint {path} belongs to another configuration (seed: 0 there, 1 now); {remedy}"
    with pytest.raises(InputError, match=r"\(hidden: 16 there, 17 now\)"):
        train_on(hidden=17)
    with pytest.raises(InputError, match=r"\(other images; epochs: 1 there, 100 now\)"):
        train_on(20, epochs=100)
    whole = path.read_bytes()
    for damaged in (whole[:1000], b"", whole.replace(b"history", b"History"), whole + b"."):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"^checkpoint .*c\.pt is damaged; remove it to start again$"):
            train_on()
    path.write_bytes(whole[32:])
    with pytest.raises(InputError, match="is of an earlier version; remove it to start again"):
        train_on()


def test_scans_of_another_array_are_refused() -> None:
    with pytest.raises(InputError, match=r"has 128 input channels, but the scans have 8 \(4 taxels\)"):
        train(Split(easy_data(), range(21)), small_network(inputs=128), TrainConfig(), 0)
    with pytest.raises(InputError, match="the network has 6 classes, but the data have 3"):
        train(Split(easy_data(), range(21)), small_network(classes=6), TrainConfig(), 0)


def test_folds_are_stratified_and_cover_every_image_once() -> None:
    labels = np.repeat(np.arange(6), 40)
    folds = stratified_folds(labels, 6)
    assert sorted(np.concatenate(folds).tolist()) == list(range(240))
    for fold in folds:
        assert len(fold) == 40
        assert set(np.bincount(labels[fold]).tolist()) <= {6, 7}
    assert all(np.array_equal(a, b) for a, b in zip(folds, stratified_folds(labels, 6), strict=True))
    assert not np.array_equal(folds[0], stratified_folds(labels, 6, seed=1)[0])
    data = easy_data()
    for number in range(3):
        fold = Fold.choose(data, number, 3)
        assert (fold.number, fold.of, fold.test.tolist()) == (
            number,
            3,
            stratified_folds(data.labels, 3)[number].tolist(),
        )
        assert sorted([*fold.test, *fold.images]) == list(range(30)), "no image is learned where it is tested"
    assert Fold.choose(data, 0, 11).of == 10
    what = f"11 folds need 11 recordings or images of each class, but class {CLASSES[0]} has 10; add --folds 10"
    with pytest.raises(InputError, match=f"^{what}, or record more$"):
        stratified_folds(data.labels, 11, class_names=CLASSES)
    with pytest.raises(InputError, match=r"but class b has 1; record more$"):
        stratified_folds(np.array([0, 0, 1]), 6, class_names=("a", "b"))


def test_the_published_interval_comes_out_and_holds_the_spread_of_images_and_seeds() -> None:
    low, high = wilson(211, 240)
    assert (round(100 * low), round(100 * high)) == (83, 91)
    low, high = bootstrap(np.repeat([1.0, 0.0], [211, 29])[:, None])  # one seed: over images
    assert 0.82 < low < 0.85 < 0.90 < high < 0.93
    generator = np.random.default_rng(0)
    accuracies = np.array([0.95, 0.9, 0.5])  # the third seed fails
    correct = (generator.random((240, 3)) < accuracies).astype(float)
    low, high = bootstrap(correct)
    assert low == pytest.approx(0.5, abs=0.06)  # the third seed three times: 1 of 27 draws
    assert high == pytest.approx(0.94, abs=0.02)
    assert low < wilson(correct.mean() * 240, 240)[0] - 0.1
    for fixed in (np.tile(accuracies, (240, 1)), np.tile(generator.random((240, 1)), (1, 3))):
        low, high = bootstrap(fixed)
        means = fixed[generator.integers(240, size=(4000, 240, 1)), generator.integers(3, size=(4000, 1, 3))]
        wanted = np.percentile(means.mean((1, 2)), [2.5, 97.5])
        assert (low, high) == pytest.approx(tuple(wanted), abs=0.01)


def test_the_summary_of_two_cells_by_hand() -> None:
    cells = [
        {"fold": 0, "seed": 0, "test_images": [0, 1], "labels": [0, 1], "last": [0, 1], "selected": [0, 0]},
        {"fold": 1, "seed": 0, "test_images": [2, 3], "labels": [0, 1], "last": [1, 1], "selected": [0, 0]},
    ]
    found = summarise(cells, 4, 2)
    assert found["last"]["accuracy"] == 0.75
    assert found["last"]["confusion"] == [[1, 1], [0, 2]]
    assert found["last"]["sd_over_folds"] == pytest.approx(0.5 / 2**0.5)
    assert found["selected"]["accuracy"] == 0.5
    assert found["last"]["bootstrap_95"] == bootstrap(np.array([[1.0], [1.0], [0.0], [1.0]]))
    assert (found["labels"], found["last"]["predictions"]) == ("0101", ["0111"])
    assert summarise(cells[1:], 4, 2)["last"]["predictions"] == ["..11"], "no class for an image that was not tested"
    others = [cell | {"seed": 1, "last": cell["selected"], "selected": cell["last"]} for cell in cells]
    found = summarise([*cells, *others], 4, 2)["last"]
    assert found["accuracy"] == 0.625
    assert found["wilson_95"] == wilson(2.5, 4)
    assert found["bootstrap_95"] == bootstrap(np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]))
    assert found["sd_over_cells"] == pytest.approx(np.std([1.0, 0.5, 0.5, 0.5], ddof=1))


def test_settings_become_fields() -> None:
    assert parse_settings(["decay=0.5", "cosine=true", "reset=subtract", "shift_steps=3"]) == {
        "decay": 0.5,
        "cosine": True,
        "reset": "subtract",
        "shift_steps": 3,
    }
    for text, message in (
        ("decay=fast", "--set decay takes a number, not 'fast'"),
        ("cosine=1", "--set cosine takes true or false, not '1'"),
        ("nothing=1", "--set needs NAME=VALUE with one of the names"),
        ("decay", "--set needs NAME=VALUE with one of the names"),
    ):
        with pytest.raises(InputError) as error:
            parse_settings([text])
        assert str(error.value).startswith(message)


@pytest.mark.parametrize("name", RECIPES)
def test_every_recipe_is_a_valid_experiment(name: str) -> None:
    experiment = experiment_of(name, {}, 100, BinConfig())
    assert Experiment.from_dict(json.loads(json.dumps(experiment.to_dict()))) == experiment


@pytest.mark.parametrize("kind", KINDS)
def test_a_network_in_a_file_is_one_flat_list_in_a_fixed_order(kind: str) -> None:
    fields = {"inputs": 4, "classes": 2, "kind": kind, "hidden": 8, "dropout": 0.5}
    if kind == "spiking":
        fields |= {"floor": -2.0, "surrogate": "triangle", "readout": "membrane", "decay": 0.5}
    else:
        fields |= {"input_offset": 0.25, "input_center": True}
    config = NetworkConfig.from_dict(fields)
    flat = config.to_dict()
    assert tuple(flat) == tuple(name for name in FIELDS if name != "layers")  # one layer, so without its size
    assert flat | fields == flat
    assert NetworkConfig.from_dict(json.loads(json.dumps(flat))) == config
    with pytest.raises(InputError, match="unknown network field 'colour'; known fields are"):
        NetworkConfig.from_dict(fields | {"colour": 1})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("frames", [None, "frame:500:8", "frame-diff:500:8", "frame-onoff:500:8"])
def test_every_network_learns_from_every_readout(kind: str, frames: str | None) -> None:
    steps = None if frames is None else FrameSteps.parse(frames, 0.004)
    readout = ReadoutConfig(rows=1, columns=2, resolution=4)
    network = {"kind": kind, "hidden": 16, "input_rms": 2.0, "hidden_rate": 0.1}
    if kind != "spiking":
        del network["hidden_rate"]
    data = small_scans(readout, steps)
    experiment = Experiment(readout=readout, frames=steps, network=network, train=TrainConfig(epochs=2))
    training = train(Split(data, range(len(data))), experiment.network_config(data), experiment.train, 0)
    assert training.history[-1].gradient > 0, "what comes in reaches the weights"
    assert len(set(logits_of(training.network, data)[:, 0].tolist())) == len(data), "and the outputs"


@functools.cache
def small_scans(readout: ReadoutConfig, frames: FrameSteps | None) -> ScanData:
    textures = embedded_dataset().limit(3)
    if frames is not None:
        return frame_dataset(textures, PhysicalScan(), readout, frames)
    return record_dataset(textures, PhysicalScan(), PhysicalScan().configure(readout), BinConfig())


def test_the_leak_of_an_nlcs_experiment() -> None:
    def tau_of(experiment: Experiment) -> float:
        again = Experiment.from_dict(json.loads(json.dumps(experiment.to_dict())))
        assert again == experiment
        return again.scan_and_config()[1].tau_s

    plain = ReadoutConfig(encoding="nlcs", resolution=4)
    assert tau_of(Experiment(readout=plain)) == pytest.approx(0.2, rel=0.01)
    assert tau_of(Experiment(readout=plain, tau_s=0.1)) == pytest.approx(0.1, rel=0.01)
    assert tau_of(Experiment(readout=plain, given_leak=True)) == plain.tau_s
    own = plain.replace(leak_shift=4, leak_period=20)
    assert tau_of(Experiment(readout=own, given_leak=True)) == own.tau_s
    with pytest.raises(InputError, match="the readout has its own leak; set given_leak to use it"):
        Experiment(readout=own)
    with pytest.raises(InputError, match=r"^tau must be a positive number of seconds, not 0"):
        tau_of(Experiment(readout=plain, tau_s=0.0))


@pytest.mark.parametrize(
    ("fields", "options", "tau_s"),
    [
        ({}, {}, 0.2),
        ({"leak_shift": 3, "leak_period": 100}, {}, ReadoutConfig(leak_shift=3, leak_period=100).tau_s),
        ({"leak_shift": 3, "leak_period": 100}, {"tau": 0.1}, 0.1),
        ({"leak_shift": 6, "leak_period": 63, "sample_rate_hz": 10000.0}, {}, 0.4),
    ],
)
def test_the_leak_of_a_configuration_file_is_kept(
    tmp_path: Path, fields: dict[str, Any], options: dict[str, Any], tau_s: float
) -> None:
    (tmp_path / "nlcs.json").write_text(json.dumps({"encoding": "nlcs"} | fields))
    given = UNSET | {"config_file": tmp_path / "nlcs.json", "recipe": "tuned", "epochs": 1}
    _, config = build_experiment(given | options).scan_and_config()
    assert config.tau_s == pytest.approx(tau_s, rel=0.01)
    assert "leak_shift" not in fields or options or config.leak_shift == fields["leak_shift"]


@pytest.mark.parametrize(
    ("frames", "settings", "steps"),
    [
        ("frame:5000:10", None, 10),
        ("frame-diff:250:8", None, 10),
        ("frame-diff:125:8", None, 5),
        ("frame-diff:62.5:8", None, 2),
        ("frame-diff:62.5:8", ["shift_steps=7"], 7),
    ],
)
def test_slow_frames_are_moved_by_the_time_of_the_recipe(frames: str, settings: list[str] | None, steps: int) -> None:
    given = {"frames": frames, "settings": settings, "recipe": "cnn", "epochs": 1}
    assert build_experiment(UNSET | given).train.shift_steps == steps


def test_an_experiment_on_event_files_names_no_readout_of_its_own() -> None:
    experiment = Experiment(events="replay", readout=ReadoutConfig(resolution=4))
    assert experiment.to_dict()["readout"] is None
    assert Experiment.from_dict(experiment.to_dict()) == dataclasses.replace(experiment, preset=None)


def test_a_float_that_json_has_not_comes_back(tmp_path: Path) -> None:
    experiment = Experiment(network={"floor": -math.inf})
    write_json(tmp_path / "a.json", {"experiment": experiment.to_dict(), "gradient": math.inf})
    text = (tmp_path / "a.json").read_text()
    assert '"floor": "-inf"' in text
    assert "Infinity" not in text
    found = json.loads(text)["experiment"]
    assert Experiment.from_dict(found) == experiment


def test_too_few_images_or_folds_are_refused_before_any_training(tmp_path: Path) -> None:
    experiment = Experiment(network={"hidden": 16}, train=TrainConfig(epochs=1))
    for folds in (1, 0, -1):
        with pytest.raises(InputError, match=f"^folds must be at least 2, not {folds}$"):
            cross_validate(experiment, tmp_path / "a", pool=Local(1), folds=folds, data=easy_data())
    message = (
        "^inner validation needs 5 training images of each class, but fold 0 leaves 4 of brick; use more images or "
    )
    with pytest.raises(InputError, match=message):
        cross_validate(experiment, tmp_path / "b", pool=Local(1), folds=3, data=easy_data(18))
    cross_validate(experiment, tmp_path / "c", pool=Local(1), folds=3, seeds=1, data=easy_data(24))


def test_a_grid_is_chosen_by_inner_validation_in_each_cell_and_counts_for_both_readings() -> None:
    data = easy_data()
    fixed = {rate: Experiment(network=small, train=TrainConfig(epochs=4, learning_rate=rate)) for rate in (1e-6, 5e-3)}
    both = Experiment(network=small, train=TrainConfig(epochs=4), grid={"learning_rate": [1e-6, 5e-3]})
    cells = {rate: run_cell(experiment, data, 0, 0, 2) for rate, experiment in fixed.items()}
    found = run_cell(both, data, 0, 0, 2)
    assert found.pop("inner_accuracies") == [cell["inner_accuracy"] for cell in cells.values()]
    assert found.pop("setting") == {"learning_rate": 5e-3}
    assert found == cells[5e-3] != cells[1e-6]
    assert Experiment.from_dict(json.loads(json.dumps(both.to_dict()))) == both
    assert len(Experiment(grid={"learning_rate": [1e-3, 2e-3], "input_rms": [1.0, 2.0, 4.0]}).settings()) == 6
    with pytest.raises(InputError, match="dropout must be a probability below 1, not 2"):
        Experiment(grid={"dropout": [0.1, 2.0]})


small = {"hidden": 16, "input_rms": 2.0, "hidden_rate": 0.1, "readout": "membrane"}


def test_a_network_that_is_too_large_gets_one_sentence() -> None:
    with pytest.raises(MemoryError, match="hidden=2000000000 is too large; use fewer"):
        build(NetworkConfig.from_dict({"inputs": 8, "classes": 3, "hidden": 2_000_000_000}), 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--recipe", "best"],
            "recipe must be one of plain, paper, tuned, skin, portable, hardware, rnn, gru, cnn",
        ),
        (
            ["--tau", "0.2"],
            f"--tau is the leak of encoding {' or '.join(LEAKY)}, not of lcs; add --encoding {LEAKY[0]}",
        ),
        (["--device", "cuda:77"], "device 'cuda:77' is not available here; use cpu"),
        (["--device", "meta"], "device 'meta' is not available here; use cpu"),
        (["--tau", "0", "--encoding", "nlcs"], "--tau must be in 1e-09..1e+09, not 0.0"),
        (["--frames", "20"], "frames need KIND:RATE:BITS, with KIND one of frame, frame-diff, frame-onoff"),
        (["--frames", "frame:250:8:4"], "frames need KIND:RATE:BITS"),
        (["--frames", "frame:fast:8"], "frames need KIND:RATE:BITS"),
        (["--frames", "frame:0:8"], "rate_hz must be a positive number of hertz, not 0.0"),
        (["--frames", "frame:250:2"], "bits must be at least 3, not 2"),
        (["--frames", "frame-onoff:250:4:4"], "level_bits must be below the 4 bits of a sample"),
        (["--frames", "frame:250:8", "--resolution", "4"], "--resolution has no effect with --frames"),
        (["--frames", "frame:250:8", "--encoding", "lcs"], "--encoding has no effect with --frames"),
        (["--frames", "frame:250:8", "--tau", "1"], "--tau has no effect with --frames"),
        (
            ["--frames", "frame:250:8", "--recipe", "gru", "--set", "decay=0.9"],
            "--set decay has no effect on a network of kind gru",
        ),
        (["--events", "x", "--dataset", "embedded"], "--dataset has no effect with --events; leave one of the two out"),
        (["--events", "x", "--preset", "physical"], "--preset has no effect with --events"),
        (["--events", "x", "--resolution", "4"], "--resolution has no effect with --events"),
        (["--events", "x", "--start-rows", "1"], "--start-rows has no effect with --events"),
        (["--events", "x", "--config", "c.json"], "--config has no effect with --events"),
        (["--fold", "6"], "fold must be in 0..5, not 6"),
        (["--events", "nowhere"], "event folder nowhere does not exist; make one with eskin replay"),
        (
            ["--grid", "dropout=0,0.3"],
            "train needs a single value of each setting; use --set, or give the grid to crossval or sweep",
        ),
        (["--recipe", "gru", "--grid", "decay=0.9"], "--grid decay has no effect on a network of kind gru"),
        (["--grid", "dropout=0,fast"], "--grid dropout takes a number, not 'fast'"),
        (["--grid", "dropout=0", "--grid", "dropout=0.3"], "--grid has dropout twice; separate its values by commas"),
        (["--preset", "paper", "--start-rows", "2"], "the paper preset has one start row; use the physical preset"),
        *(
            (["--set", f"learning_rate={rate}"], "learning_rate must be ")
            for rate in ("1e300", "11", "0", "nan", "inf")
        ),
    ],
)
def test_bad_options_get_one_sentence(options: list[str], message: str, refuses: Any) -> None:
    refuses(f"error: {message}", "train --out out", *options)


@pytest.mark.parametrize("name", ["checkpoint.pt", "result.json", "weights.npz"])
def test_an_output_that_cannot_be_written_is_refused_before_the_scans(
    name: str, refuses: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "out" / name).mkdir(parents=True)
    monkeypatch.delattr(Experiment, "data")
    for command in ("train", "crossval") if name == "result.json" else ("train",):
        sentence = f"error: cannot write out/{name}: it is a folder; give the name of a file\n"
        refuses(sentence, command, "--dataset embedded --out out")


@pytest.mark.command("crossval")
def test_crossval_prints_both_readings(eskin: Any, folder: Path) -> None:
    (folder / "small.json").write_text(json.dumps({"rows": 1, "columns": 2}))
    options = "--dataset embedded --config small.json --bin 0.01 --set hidden=16 --workers 1"
    out, _ = eskin("crossval", options, "--folds 2 --seeds 1 --epochs 2 --out cv")
    report = json.loads((folder / "cv" / "result.json").read_text())
    for reading, words in (("last", "last epoch"), ("selected", "epoch selected by inner validation")):
        low, high = report[reading]["bootstrap_95"]
        assert f"{words}: {report[reading]['accuracy']:.1%}, 95 % interval over images and seeds " in out
        assert f"seeds {low:.1%} to {high:.1%} (48 images, 1 seeds), standard deviation over cells " in out
    assert report["last"]["images"] == 48
    assert report["experiment"]["readout"]["resolution"] == 4
