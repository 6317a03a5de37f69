"""Write and load checkpoints, so that a stopped training continues with an identical result."""

import dataclasses
import hashlib
import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.network_config import NetworkConfig
from eskin.snn.training import Epoch, TrainConfig, Training


def digest(data: ScanData) -> str:
    """Return a digest of scans and images."""
    found = hashlib.sha256(np.ascontiguousarray(data.values).tobytes())
    found.update(data.labels.tobytes() + data.images.tobytes())
    if not data.of_one_length:
        found.update(np.asarray(data.lengths).tobytes())
    return found.hexdigest()


@dataclass(frozen=True)
class Checkpoint:
    """Checkpoint file of a training, written every few epochs and at the end."""

    path: Path
    every: int = 5


def fingerprint(split: Split, network_config: NetworkConfig, train_config: TrainConfig, seed: int) -> str:
    """Return a JSON text of everything that determines the result of a training."""
    parts = {
        "network": network_config.to_dict(),
        "train": train_config.to_dict(),
        "seed": seed,
        "data": digest(split.data),
        "images": [int(image) for image in split.learned],
        "held_out": None if split.held_out is None else [int(image) for image in split.held_out],
        "test": None if split.test is None else [int(image) for image in split.test],
    }
    return json.dumps(parts, sort_keys=True)


def save_checkpoint(path: Path, training: Training, key: str) -> None:
    """Write the complete state of a training to a file, which begins with the SHA-256 of the rest."""
    content = {
        "key": key,
        "network": training.network.state_dict(),
        "optimizer": training.optimizer.state,
        "history": [dataclasses.asdict(epoch) for epoch in training.history],
        "best": training.best,
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    with atomic_write(path) as file:
        file.write(hashlib.sha256(buffer.getvalue()).digest() + buffer.getvalue())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return the content of a checkpoint; raise InputError if the file is damaged."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    if data[:32] != hashlib.sha256(data[32:]).digest():
        why = "of an earlier version" if data.startswith(b"PK") else "damaged"  # these were archives of torch
        raise InputError(f"checkpoint {path} is {why}; remove it to start again")
    with _whole(path):
        return dict(torch.load(io.BytesIO(data[32:]), map_location="cpu", weights_only=True))


@contextmanager
def _whole(path: Path) -> Iterator[None]:
    """Raise InputError for a checkpoint whose content is not that of a training."""
    try:
        yield
    except InputError:
        raise
    except Exception:  # torch raises many types, depending on what is wrong
        raise InputError(f"checkpoint {path} does not hold a training; remove it to start again") from None


class OtherTraining(InputError):  # the sentence a user reads
    """Raised for a checkpoint of a training with other parameters, data or seed."""


def own_checkpoint(path: Path, key: str) -> dict[str, Any]:
    """Return the content of a checkpoint; raise InputError as ``load_checkpoint``."""
    content = read_checkpoint(path)
    with _whole(path):
        if content["key"] != key:
            found = "; ".join(_differences(json.loads(content["key"]), json.loads(key)))
            raise OtherTraining(
                f"checkpoint {path} belongs to another configuration ({found}); "
                f"remove it or choose another folder with --out"
            )
    return content


def load_checkpoint(path: Path, training: Training, key: str) -> None:
    """Restore the state of a training from a checkpoint.

    Raise InputError if the file is damaged, or was written by a training with other parameters, data or seed.
    """
    content = own_checkpoint(path, key)
    with _whole(path):
        training.network.load_state_dict(content["network"])
        training.optimizer.load_state(content["optimizer"])
        training.history = [Epoch(**epoch) for epoch in content["history"]]
        training.best = content["best"]


def _differences(there: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return a text for each field that differs, with both values if they are short."""
    found = []
    for name, value in now.items():
        other = there.get(name)
        if isinstance(value, dict) and isinstance(other, dict):
            found += _differences(other, value)
        elif value != other:
            readable = name != "data" and not isinstance(value, list)
            found.append(f"{name}: {other} there, {value} now" if readable else f"other {name.replace('_', ' ')}")
    return found
