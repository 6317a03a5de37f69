"""Test that malicious files and extreme settings give one error message."""

import json
import math
import zipfile
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
import torch

from eskin.app.cli import printable
from eskin.base.errors import InputError
from eskin.base.files import MOST_UNPACKED
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.foreign.events import in_unit
from eskin.snn.adam import Adam
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.scans import Split
from eskin.snn.exchange.integer import Precision
from eskin.snn.exchange.nir_events import load_nir_data, save_nir_data
from eskin.snn.exchange.nir_network import load_nir, save_nir
from eskin.snn.exchange.weights import load_weights, save_weights
from eskin.snn.experiments.crossval import read_cell
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.trained import read_result
from eskin.snn.train import train
from eskin.snn.training import DivergedError, TrainConfig
from tests.snn.helpers import easy_data, small_network, some_weights

CLASSES = ("a", "b", "c")


def changed(path: Path, header: dict[str, Any] | None = None, **arrays: Any) -> Path:
    """Write a weight file with changed parts."""
    save_weights(path, some_weights())
    with np.load(path) as file:
        found = {name: file[name] for name in file.files}
    stated = json.loads(str(found.pop("metadata"))) | (header or {})
    np.savez(path, metadata=np.array(json.dumps(stated)), **(found | arrays))
    return path


def recording(**fields: Any) -> Recording:
    config = ReadoutConfig(rows=1, columns=2, **fields)
    return Recording(make_events([5, 90], [0, 0], [0, 1]), config, 100, metadata={"name": "a", "class": "sand"})


NETWORK = some_weights().network.config.to_dict()  # type: ignore[union-attr, operator]
STEP = "the time step must be a positive number of seconds, not"
NO_LIST = "class names must be a list of texts"
NO_NUMBER = "w_rec has values that are not finite; train again"
NO_REAL = r"w_rec holds values of type .*, instead of real numbers; train again"


@pytest.mark.parametrize(
    ("header", "w_rec", "sentence"),
    [
        *(({}, np.full((5, 5), bad, np.float32), NO_NUMBER) for bad in (math.nan, math.inf, -math.inf)),
        *(({}, np.zeros((5, 5), kind), NO_REAL) for kind in (np.complex64, np.bool_, "U3")),
        *(({"step_s": step}, None, STEP) for step in (0, -1, 0.0, math.nan, math.inf, True, "0.1", None)),
        *(({"class_names": names}, None, NO_LIST) for names in ("abc", None, [1, 2, 3], ["a", None, "c"])),
        ({"class_names": ["a", "a", "b"]}, None, "class 'a' is named twice; give every class a unique name"),
        ({"class_names": ["a", "b"]}, None, "there are 2 class names for 3 classes; name every class once"),
        ({"class_names": ["a", "b", "c", "d"]}, None, "there are 4 class names for 3 classes"),
        *(
            ({"network": NETWORK | {name: value}}, None, f"{name} must be ")
            for name, value in (("hidden", "5"), ("decay", True), ("floor", [1]), ("kind", 3), ("hidden", None))
        ),
    ],
)
def test_a_weight_file_with_a_wrong_part_is_refused(
    tmp_path: Path, header: dict[str, Any], w_rec: Any, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        load_weights(changed(tmp_path / "w.npz", header, **({} if w_rec is None else {"w_rec": w_rec})))


def test_a_file_that_claims_a_large_network_is_refused_before_it_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = changed(tmp_path / "w.npz", {"network": NETWORK | {"hidden": 12_000}})
    made: list[object] = []
    original = torch.empty

    def noted(*size: Any, **options: Any) -> torch.Tensor:
        tensor = original(*size, **options)
        made.append(tensor.device.type)
        return tensor

    monkeypatch.setattr(torch, "empty", noted)
    with pytest.raises(InputError, match=r"w_in has the shape \(5, 6\), but the network has \(12000, 6\)"):
        load_weights(path)
    assert set(made) == {"meta"}, "shapes alone"


def test_an_archive_that_unpacks_to_more_than_memory_is_for_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_UNPACKED == 2**30
    monkeypatch.setattr("eskin.base.files.MOST_UNPACKED", 2**20)
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("events.npy", bytes(2**21))
    assert path.stat().st_size < 2**14
    for read in (load_weights, Recording.load):
        with pytest.raises(InputError, match=r"a\.npz claims 2 MiB of data, more than 1, and is refused"):
            read(path)


@pytest.mark.parametrize("kind", ["external link", "soft link", "external storage", "virtual", "bomb", "circle"])
@pytest.mark.parametrize("reader", [load_nir, load_nir_data])
def test_a_nir_file_reads_no_other_file_and_no_more_than_it_may(tmp_path: Path, kind: str, reader: Any) -> None:
    path, secret = tmp_path / "a.nir", tmp_path / "secret"
    if reader is load_nir:
        save_nir(path, some_weights())
    else:
        save_nir_data(path, recording())
    secret.write_bytes(np.arange(100.0).tobytes())
    with h5py.File(path, "a") as file:
        if kind == "external link":
            file["more"] = h5py.ExternalLink(str(secret), "/")
        elif kind == "soft link":
            file["more"] = h5py.SoftLink("/")
        elif kind == "external storage":
            file.create_dataset("more", (100,), "f8", external=[(str(secret), 0, 800)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(str(secret), "a", (100,))
            file.create_virtual_dataset("more", layout)
        elif kind == "bomb":
            file.create_dataset("more", (2**28,), "f8", chunks=(2**20,), compression="gzip")
        else:
            file.create_group("more")["again"] = file["/"]
    sentence = {
        "external link": "links 'more' to another object or file; export it completely",
        "soft link": "links 'more' to another object or file",
        "external storage": "refers to another file for '/more'; export it completely",
        "virtual": "refers to another file for '/more'",
        "bomb": "claims more than 1024 MiB of data, and is refused",
        "circle": "has a group that contains itself",
    }[kind]
    with pytest.raises(InputError) as error:
        reader(path)
    assert sentence in str(error.value)


@pytest.mark.parametrize("rate", ["1e30", "1e38", "1e300", "11", "0", "nan", "inf"])
def test_a_learning_rate_that_trains_nothing_is_refused(refuses: Any, rate: str) -> None:
    refuses("error: learning_rate must be ", f"train --dataset embedded --set learning_rate={rate}")


def test_weights_that_are_no_numbers_after_an_epoch_stop_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    original = Adam.step

    def broken(self: Adam) -> None:
        original(self)
        with torch.no_grad():
            self.parameters[0].view(-1)[0] = math.nan

    monkeypatch.setattr(Adam, "step", broken)
    with pytest.raises(DivergedError, match="a weight is not a number; lower the learning rate"):
        train(Split(easy_data(), range(21)), small_network(), TrainConfig(epochs=1, batch=64), 0)


CELL = {"fold": 0, "seed": 0, "test_images": [0], "labels": [1], "last": [1], "selected": [0]}


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        json.dumps({"experiment": {}, "result": 3}),
        *(
            json.dumps({"experiment": {}, "result": CELL | change})
            for change in ({"labels": 3}, {"last": ["x"]}, {"last": [1, 1]}, {"fold": None}, {"test_images": [-1]})
        ),
    ],
    ids=range(7),
)
def test_a_file_in_the_place_of_a_cell_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "cell.json").write_text(json.dumps({"experiment": {}, "result": CELL}))
    assert read_cell(tmp_path / "cell.json") == ({}, CELL)
    (tmp_path / "cell.json").write_text(text)
    with pytest.raises(InputError, match="is not the result of a training; remove it"):
        read_cell(tmp_path / "cell.json")


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
    good = {"experiment": experiment, "class_names": list(CLASSES), "fold": 0, "folds": 2, "labels": [0, 1, 2]}
    path = tmp_path / "result.json"
    path.write_text(json.dumps(good))
    assert read_result(path, path, some_weights()).class_names == CLASSES
    name = next(iter(change))
    path.write_text(json.dumps(good | ({"experiment": experiment | change} if name in experiment else change)))
    with pytest.raises(InputError, match="is damaged or not the result of a training; remove it or train again"):
        read_result(path, path, some_weights())


@pytest.mark.parametrize("bad", [True, 2.0, "3", 0])
def test_frames_per_step_is_a_whole_number(bad: Any) -> None:
    with pytest.raises(InputError, match="frames_per_step must be at least 1, not"):
        FrameSteps(frames_per_step=bad)


@pytest.mark.parametrize("rate", [1e-9, 1e12])  # the ends of what a configuration takes
def test_events_at_an_absurd_clock_are_converted_or_refused_in_one_sentence(call: Any, rate: float) -> None:
    recording(sample_rate_hz=rate).save(Path("a.npz"))
    for out in ("a.nir", "a.npy"):
        code, _, error = call("convert", "a.npz", "-o", out)
        assert code == 0 or (code, error.count("\n")) == (2, 1), error
        assert Path(out).exists() == (code == 0)
    if rate < 1:
        config = ReadoutConfig(rows=1, columns=2, sample_rate_hz=rate)
        late = Recording(make_events([10**9], [0], [0]), config, 10**9 + 1)
        with pytest.raises(InputError, match="too long for microseconds; use clocks"):
            in_unit(late)


def test_export_of_an_absurd_time_step_is_one_sentence(refuses: Any, folder: Path) -> None:
    save_weights(Path("w.npz"), some_weights(step_s=1e308, decay=0.5))
    refuses("gives time constants that NIR cannot store", "export w.npz -o w.nir")


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ("a,a,b", "class 'a' is named twice"),
        ("a,,b", "class names must be a list of texts, not ['a', '', 'b']"),
        ("a,b", "node 'readout' has 3 outputs, not 2; give a class name for each output"),
    ],
)
def test_import_takes_a_name_for_each_class(refuses: Any, names: str, sentence: str) -> None:
    save_nir(Path("w.nir"), some_weights())
    refuses(f"error: w.nir: {sentence}", "import w.nir -o b.npz --classes", names)


def test_a_name_is_shown_and_not_obeyed() -> None:
    assert printable("\x1b[2Jclear\x07 \u202egnp.exe \x9b1m") == "\\x1b[2Jclear\\x07 \\u202egnp.exe \\x9b1m"
    assert printable("Kylberg Gefühl, 砂 — ok") == "Kylberg Gefühl, 砂 — ok"


def test_commands_and_errors_print_names_safely(call: Any, folder: Path) -> None:
    evil = "sand\x1b]0;title\x07"
    save_weights(Path("w.npz"), some_weights((evil, "b", "c"), 1e-5, inputs=4, readout="membrane"))
    made = recording()
    Recording(made.events, made.config, 100, metadata={"name": evil, "class": evil}).save(Path("a.npz"))
    code, out, error = call("predict", "w.npz", "--events", "a.npz", "-o", "p.json")
    assert code == 0, error
    assert "sand\\x1b]0;title\\x07" in out
    assert "\x1b" not in out + error
    Recording(made.events, made.config, 100, metadata={"name": evil, "class": f"not {evil}"}).save(Path("a.npz"))
    code, out, error = call("predict", "w.npz", "--events", "a.npz", "-o", "p.json")
    assert code == 2
    assert "has the unknown class" in error
    assert "\x1b" not in out + error
    save_nir(Path("w.nir"), load_weights(Path("w.npz")))
    code, out, _ = call("import", "w.nir", "-o", "b.npz")
    assert (code, "\x1b" in out) == (0, False)


def test_train_names_the_data_it_used(call: Any, folder: Path) -> None:
    Path("small.json").write_text(json.dumps({"rows": 1, "columns": 2}))
    words = ["--dataset", "embedded", "--config", "small.json", "--bin", "0.01", "--set", "hidden=8", "--epochs", "1"]
    code, out, error = call("train", *words)
    assert code == 0, error
    assert out.startswith("data: events of lcs with 4 bits from embedded textures, physical scan\n")


def test_one_class_is_no_result(call: Any, folder: Path) -> None:
    events = make_events([0, 50], 0, 0, [True, False])
    for number in range(4):
        place = Path(f"e/only/{number}.npz")
        place.parent.mkdir(parents=True, exist_ok=True)
        metadata = {"name": f"only/{number}", "class": "only"}
        Recording(events, ReadoutConfig(rows=1, columns=1), 1_000_000, metadata=metadata).save(place)
    code, _, error = call("train --events e --folds 2")
    assert (code, error) == (2, "error: recordings in e has one class, only; a classifier needs two at least\n")


@pytest.mark.parametrize("clock_hz", [1.0, 1e-300, 1e300, math.nan])
def test_hardware_has_a_clock(clock_hz: float) -> None:
    with pytest.raises(InputError, match=r"^the clock must be in 1000\.\.1e\+10 hertz, not "):
        Precision(clock_hz=clock_hz)
