"""Trained networks as plain NumPy archives, in float32 or 8 bits (docs/guide/exchange.md)."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from model.errors import InputError
from model.files import atomic_write
from snn.network import SpikingNetwork, build
from snn.network_config import NetworkConfig

FORMAT_NAME = "spiking-eskin-readout weights"
FORMAT_VERSION = 1
SCALE_SUFFIX = "_scale"
"""A matrix of 8-bit weights has an array of this name beside it: one factor per row."""

LARGEST = 127
"""Largest magnitude of an 8-bit weight."""


@dataclass(frozen=True)
class Weights:
    """A trained network with what is needed to use it.

    Attributes
    ----------
    network : nn.Module
    class_names : tuple of str
        Of the outputs, in their order.
    step_s : float
        Seconds per time step, with which the counts must be made.
    """

    network: nn.Module
    class_names: tuple[str, ...]
    step_s: float


def save_weights(path: Path, weights: Weights, eight_bits: bool = False) -> None:
    """Write a network, whole or not at all; equal networks give equal bytes.

    Parameters
    ----------
    path : Path
        Ends in .npz.
    weights : Weights
    eight_bits : bool
        Matrices as int8 with one float32 factor per row; vectors stay float32.

    Raises
    ------
    InputError
        If the name does not end in .npz, or the file cannot be written.
    """
    if path.suffix != ".npz":
        raise InputError(f"weight files end in .npz, {path.name} does not; rename the output")
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
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "network": config_of(network).to_dict(),
        "class_names": list(weights.class_names),
        "step_s": weights.step_s,
    }
    arrays["metadata"] = np.array(json.dumps(header))
    with atomic_write(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            data = io.BytesIO()
            np.lib.format.write_array(data, np.ascontiguousarray(values).reshape(values.shape), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0)), data.getvalue())


def load_weights(path: Path) -> Weights:
    """Return the network of a file that ``save_weights`` wrote.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, or is something else.
    """
    if not path.exists():
        raise InputError(f"weight file {path} does not exist; make one with python -m snn train")
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except OSError as error:
        if error.strerror:
            raise InputError(f"cannot read {path}: {error.strerror}") from None
        raise InputError(f"{path} is damaged or not a weight file; train again") from None
    except Exception:  # a damaged archive makes zipfile, zlib and NumPy raise almost any type
        raise InputError(f"{path} is damaged or not a weight file; train again") from None
    try:
        header = json.loads(str(arrays.pop("metadata")))
        if header["format"] != FORMAT_NAME or header["format_version"] != FORMAT_VERSION:
            raise InputError(f"{path} has format version {header['format_version']!r}, this program reads 1")
        network = build(NetworkConfig.from_dict(header["network"]), seed=0)
        state = {
            name: torch.from_numpy(_plain(arrays, name).astype(np.float32))
            for name in arrays
            if name in network.state_dict()
        }
        network.load_state_dict(state)
        return Weights(network, tuple(header["class_names"]), float(header["step_s"]))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RuntimeError):
        raise InputError(f"{path} is an archive, but not a weight file; train again") from None


def quantise(matrix: NDArray[Any]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return 8-bit weights and the factor of every row (first axis), such that weights * factor is the matrix.

    Rounded half to even, symmetric: the largest magnitude of a row becomes 127.
    """
    rows = matrix.reshape(len(matrix), -1)
    scale = (np.abs(rows).max(1) / LARGEST).astype(np.float32)
    safe = np.where(scale > 0, scale, 1.0)
    whole = np.clip(np.rint(rows / safe[:, None]), -LARGEST, LARGEST)
    return whole.astype(np.int8).reshape(matrix.shape), scale


def config_of(network: nn.Module) -> NetworkConfig:
    """Return the configuration that a network was built with."""
    config = network.config
    assert isinstance(config, NetworkConfig)
    return config


def _plain(arrays: dict[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """Return an array in float, multiplied out if it is in 8 bits."""
    values = arrays[name]
    if values.dtype != np.int8:
        return values
    scale = arrays[name + SCALE_SUFFIX]
    return values * scale.reshape(-1, *[1] * (values.ndim - 1))
