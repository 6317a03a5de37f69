"""Test weight files: exact round trip, 8-bit error of at most half a step, rejected files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork
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


def test_a_file_of_another_kind_is_named_with_the_command_that_makes_the_right_one(tmp_path: Path) -> None:
    path, integer = tmp_path / "float.npz", tmp_path / "integer.npz"
    save_weights(path, made())
    with pytest.raises(InputError) as refused:
        IntegerWeights.load(path)
    remedy = "make one with eskin quantise WEIGHTS.npz -o INTEGER.npz"
    assert str(refused.value) == f"{path}: it is a float network instead of an integer network; {remedy}"
    shapes = {"w_in": (4, 4), "w_rec": (4, 4), "w_out": (4, 2), "b_hidden": 4, "b_out": 2}
    config = ClassifierConfig(inputs=4, hidden=4, classes=2, lanes=4)
    network = IntegerNetwork(config, **{name: np.zeros(shape, np.int64) for name, shape in shapes.items()})
    IntegerWeights(network, ("a", "b")).save(integer)
    with pytest.raises(InputError, match="it is an integer network instead of a float network; make one"):
        load_weights(integer)
