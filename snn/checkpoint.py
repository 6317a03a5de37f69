"""Write and load checkpoints, so that a stopped training continues with an identical result."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import math
import pickle
import zipfile
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

CHECKPOINT_FORMAT = 1


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
    """Write the complete state of a training to a file."""
    content = {
        "format": CHECKPOINT_FORMAT,
        "key": key,
        "network": training.network.state_dict(),
        "optimizer": training.optimizer.state_dict(),
        "history": [dataclasses.asdict(epoch) for epoch in training.history],
        "epochs": len(training.history),
        "best": training.best,
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    with atomic_write(path) as file:
        file.write(buffer.getvalue())


class OtherTraining(InputError):  # the sentence a user reads
    """Raised for a checkpoint of a training with other parameters, data or seed."""


def load_checkpoint(path: Path, training: Training, key: str) -> None:
    """Restore the state of a training from a checkpoint.

    Raise InputError if the file is damaged, or was written by a training with other parameters, data or seed.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        if content["format"] != CHECKPOINT_FORMAT:
            raise InputError(f"checkpoint {path} has another format; remove it to start again")
        if content["key"] != key:
            there = json.loads(content["key"])
            if not isinstance(there, dict):
                raise ValueError
            found = "; ".join(_differences(there, json.loads(key)))
            raise OtherTraining(
                f"checkpoint {path} belongs to another configuration ({found}); "
                f"remove it or choose another folder with --out"
            )
        training.network.load_state_dict(content["network"])
        training.optimizer.load_state_dict(content["optimizer"])
        training.history = [Epoch(**epoch) for epoch in content["history"]]
        training.best = content["best"]
        _check_sound(training)
        if content.get("epochs", len(training.history)) != len(training.history):
            raise ValueError("epochs are missing")
    except InputError:
        raise
    except (OSError, RuntimeError, EOFError, LookupError, TypeError, ValueError, AttributeError, RecursionError,
            pickle.UnpicklingError, zipfile.BadZipFile):  # fmt: skip
        raise InputError(f"checkpoint {path} is damaged; remove it to start again") from None


def _check_sound(training: Training) -> None:
    """Raise ValueError if loaded values are not finite or have wrong types."""
    tensors = [*training.network.state_dict().values()]
    for state in training.optimizer.state_dict()["state"].values():
        tensors += [value for value in state.values() if isinstance(value, torch.Tensor)]
    if not all(torch.isfinite(tensor).all() for tensor in tensors):
        raise ValueError("a weight or a moment of the optimizer is not finite")
    if [epoch.number for epoch in training.history] != list(range(1, len(training.history) + 1)):
        raise ValueError("its epochs are not numbered")
    for epoch in training.history:
        if not all(math.isfinite(value) for value in (epoch.loss, epoch.accuracy, epoch.rate, epoch.silent_outputs)):
            raise ValueError("an epoch has no finite loss")
    steps = max((int(one.get("step", 0)) for one in training.optimizer.state_dict()["state"].values()), default=0)
    if bool(steps) != bool(training.history):
        raise ValueError("the optimizer state belongs to other epochs")
    if not isinstance(training.best, dict) or not isinstance(training.best.get("held_out", 0.0), float):
        raise ValueError("the best epoch is damaged")


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
