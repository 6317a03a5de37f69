"""Test weight files: exact round trip, 8-bit error of at most half a step, rejected files."""

import json
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.base.files import MAX_UNPACKED
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.events.recording import Recording
from eskin.snn.exchange.weights import Weights, load_weights, quantise, save_weights
from tests.snn.helpers import some_weights

CLASSES = ("a", "b", "c")


def made(**fields: Any) -> Weights:
    return some_weights(seed=4, hidden=20, **fields)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"decay": 0.9, "output_decay": 0.8, "learn_decay": True},
        {"kind": "gru", "input_offset": 0.3},
        {"kind": "cnn"},
    ],
    ids=str,
)
def test_a_network_comes_back_bit_exact(tmp_path: Path, fields: dict[str, Any]) -> None:
    weights, path = made(**fields), tmp_path / "w.npz"
    save_weights(path, weights)
    loaded = load_weights(path)
    x = torch.poisson(torch.full((15, 4, 6), 0.7))
    assert torch.equal(loaded.network.eval()(x).logits, weights.network.eval()(x).logits)
    assert (loaded.class_names, loaded.step_s) == (CLASSES, 0.002)
    first = path.read_bytes()
    save_weights(path, loaded)
    assert path.read_bytes() == first


def test_eight_bit_weights_are_within_half_a_step(tmp_path: Path) -> None:
    weights = made()
    save_weights(tmp_path / "w.npz", weights, eight_bits=True)
    loaded = load_weights(tmp_path / "w.npz")
    for name, tensor in weights.network.state_dict().items():
        found = loaded.network.state_dict()[name]
        if tensor.ndim == 1:
            assert torch.equal(found, tensor)
        else:
            step = tensor.abs().amax(1, keepdim=True) / 127
            assert ((found - tensor).abs() <= 0.501 * step).all()
            assert not torch.equal(found, tensor)
    whole, scale = quantise(np.array([[0.0, 0.0], [1.27, -0.635]]))
    assert whole.tolist() == [[0, 0], [127, -64]]
    assert scale.tolist() == [0.0, np.float32(0.01)]


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"weight files end in \.npz, but w\.bin does not; rename the output"):
        save_weights(tmp_path / "w.bin", made())
    with pytest.raises(InputError, match="does not exist; make one with eskin train"):
        load_weights(tmp_path / "none.npz")
    path = tmp_path / "w.npz"
    path.write_bytes(b"not an archive")
    with pytest.raises(InputError, match="is damaged or not a weight file; train again"):
        load_weights(path)
    np.savez(path, events=np.zeros(3))
    with pytest.raises(InputError, match="is an archive, but not a weight file; train again"):
        load_weights(path)
    save_weights(path, made())
    with pytest.raises(InputError) as refused:
        IntegerWeights.load(path)
    remedy = "make one with eskin quantise WEIGHTS.npz -o INTEGER.npz"
    assert str(refused.value) == f"{path}: it is a float network instead of an integer network; {remedy}"
    shapes = {"w_in": (4, 4), "w_rec": (4, 4), "w_out": (4, 2), "b_hidden": 4, "b_out": 2}
    config = ClassifierConfig(inputs=4, hidden=4, classes=2, lanes=4)
    network = IntegerNetwork(config, **{name: np.zeros(shape, np.int64) for name, shape in shapes.items()})
    IntegerWeights(network, ("a", "b")).save(path)
    with pytest.raises(InputError, match="it is an integer network instead of a float network; make one"):
        load_weights(path)


def changed(path: Path, header: dict[str, Any] | None = None, **arrays: Any) -> Path:
    """Write a weight file with changed parts."""
    save_weights(path, some_weights())
    with np.load(path) as file:
        found = {name: file[name] for name in file.files}
    stated = json.loads(str(found.pop("metadata"))) | (header or {})
    np.savez(path, metadata=np.array(json.dumps(stated)), **(found | arrays))
    return path


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
    assert MAX_UNPACKED == 2**30
    monkeypatch.setattr("eskin.base.files.MAX_UNPACKED", 2**20)
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("events.npy", bytes(2**21))
    assert path.stat().st_size < 2**14
    for read in (load_weights, Recording.load):
        with pytest.raises(InputError, match=r"a\.npz claims 2 MiB of data, more than 1, and is refused"):
            read(path)
