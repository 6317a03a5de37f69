"""Files of trained networks: NumPy archives in float32 or 8 bits (docs/guide/exchange.md)."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from eskin.base import formats
from eskin.base.errors import InputError
from eskin.base.files import read_arrays, write_arrays
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig

SCALE_SUFFIX = "_scale"
"""A matrix of 8-bit weights has an array of this name beside it: one factor per row."""

LARGEST = 127
"""Largest magnitude of an 8-bit weight."""


@dataclass(frozen=True)
class Weights:
    """A trained network with class names and time step."""

    network: nn.Module
    class_names: tuple[str, ...]
    """Names of the outputs, in their order."""
    step_s: float
    """Seconds per time step, with which the counts must be made."""

    def __repr__(self) -> str:
        parameters = sum(parameter.numel() for parameter in self.network.parameters())
        return f"Weights({parameters} parameters, {self.step_s:g} s per step, classes {', '.join(self.class_names)})"


def save_weights(path: str | Path, weights: Weights, eight_bits: bool = False) -> None:
    """Write a network to a weight file.

    - ``path``: ends in .npz.
    - ``eight_bits``: matrices as int8 with one float32 factor per row; vectors stay float32.

    Raise InputError if the name does not end in .npz, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"weight files end in .npz, but {path.name} does not; rename the output")
    network = weights.network
    arrays: dict[str, NDArray[Any]] = {}
    for name, tensor in network.state_dict().items():
        values = tensor.detach().cpu().numpy()
        if eight_bits and values.ndim >= 2:
            arrays[name], arrays[name + SCALE_SUFFIX] = quantise(values)
        else:
            arrays[name] = values
    if isinstance(network, SpikingNetwork):
        decay, output_decay = (d.detach().cpu().numpy() for d in network.decays())
        arrays |= {"decay": decay, "output_decay": output_decay}
    header = {
        "format": formats.WEIGHTS.name,
        "format_version": formats.WEIGHTS.version,
        "network": config_of(network).to_dict(),
        "class_names": list(weights.class_names),
        "step_s": weights.step_s,
    }
    arrays["metadata"] = np.array(json.dumps(header))
    write_arrays(path, {name: np.ascontiguousarray(a).reshape(a.shape) for name, a in arrays.items()})


def load_weights(path: str | Path) -> Weights:
    """Return the network from a weight file.

    Raise InputError if the file cannot be read, is damaged, or is something else.
    """
    return weights_of(Path(path), arrays_of(Path(path)))


def arrays_of(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file of weights, whose format is not known; raise InputError if it cannot be read."""
    if not path.exists():
        raise InputError(f"weight file {path} does not exist; make one with eskin train")
    return read_arrays(path, "a weight file", "train again")


def weights_of(path: Path, arrays: dict[str, NDArray[Any]]) -> Weights:
    """Return the network for the arrays of a weight file; raise InputError if they are damaged or something else."""
    try:
        return _from_arrays(arrays)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, RuntimeError, RecursionError):
        raise InputError(f"{path} is an archive, but not a weight file; train again") from None


def _from_arrays(arrays: dict[str, NDArray[Any]]) -> Weights:
    """Return the network for the arrays of a file, after checking metadata against arrays."""
    header = json.loads(str(arrays.pop("metadata")))
    formats.WEIGHTS.check(header)
    config = NetworkConfig.from_dict(header["network"])
    class_names = check_class_names(header["class_names"], config.classes)
    step_s = check_step(header["step_s"])
    with torch.device("meta"):  # shapes alone, no memory
        shapes = {name: tuple(tensor.shape) for name, tensor in build(config, seed=0).state_dict().items()}
    state = {}
    for name, shape in shapes.items():
        values = arrays[name]
        if values.dtype == np.int8:
            values = values * arrays[name + SCALE_SUFFIX].reshape(-1, *[1] * (values.ndim - 1))
        if values.dtype.kind not in "fiu":
            raise InputError(f"{name} holds values of type {values.dtype}, instead of real numbers; train again")
        values = values.astype(np.float32)
        if values.shape != shape:
            raise InputError(f"{name} has the shape {values.shape}, but the network has {shape}; train again")
        if not np.isfinite(values).all():
            raise InputError(f"{name} has values that are not finite; train again")
        state[name] = torch.from_numpy(values)
    network = build(config, seed=0)
    network.load_state_dict(state)
    return Weights(network, class_names, step_s)


def check_class_names(names: Any, classes: int) -> tuple[str, ...]:
    """Return checked class names: one distinct name per class."""
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) and name for name in names):
        raise InputError(f"class names must be a list of texts, not {names!r}")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"class {twice[0]!r} is named twice; give every class a unique name")
    if len(names) != classes:
        raise InputError(f"there are {len(names)} class names for {classes} classes; name every class once")
    return tuple(names)


def check_step(step_s: Any) -> float:
    """Return a checked time step: a positive number of seconds."""
    if type(step_s) not in (int, float) or not (0 < step_s < float("inf")):
        raise InputError(f"the time step must be a positive number of seconds, not {step_s!r}")
    return float(step_s)


def quantise(matrix: NDArray[Any]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return 8-bit weights and a scale for every row (first axis): weights * scale approximates the matrix.

    Rounded half to even, symmetric: the largest magnitude of a row becomes 127.
    """
    rows = matrix.reshape(len(matrix), -1)
    scale = (np.abs(rows).max(1) / LARGEST).astype(np.float32)
    safe = np.where(scale > 0, scale, 1.0)
    whole = np.clip(np.rint(rows / safe[:, None]), -LARGEST, LARGEST)
    return whole.astype(np.int8).reshape(matrix.shape), scale


def config_of(network: nn.Module) -> NetworkConfig:
    """Return the configuration of a network."""
    config = network.config
    assert isinstance(config, NetworkConfig)
    return config
