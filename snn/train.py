"""Training of one network, with checkpoints from which it goes on as if it had never stopped.

All that is random in an epoch (order, augmentation, dropout) is drawn from the seed and the number of the epoch, so
that a checkpoint needs no generator state, and an interrupted training ends in the same bits as one in one piece.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import math
import pickle
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from model.errors import InputError
from model.files import atomic_write
from snn.calibration import calibrate
from snn.dataset import AugmentConfig, ScanData, augment
from snn.network import NetworkConfig, Output, build

CHECKPOINT_FORMAT = 1
CALIBRATION_SCANS = 128
"""At most so many training scans, evenly spread, set the scale of the inputs and the first biases."""

BATCH = 64
"""Scans that a trained network takes at once."""

LARGE_GRADIENT = 1e4
"""Norm of the gradient, before clipping, that is reported as a sign of divergence."""

SILENT, SATURATED = 1e-4, 0.5
"""Mean spikes per step and hidden neuron outside of which the surrogate gradient teaches little."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """How a network is trained. Paper: Adam 1e-3, batch 32, up to 500 epochs.

    Parameters
    ----------
    epochs, batch : int
    learning_rate : float
    weight_decay : float
        Decoupled (AdamW) where not zero.
    cosine : bool
        The learning rate falls to zero along half a cosine; else it is constant.
    clip : float
        Largest norm of the gradient.
    shift_steps, speed_spread, drop_taxels
        See ``AugmentConfig``.
    """

    epochs: int = 100
    batch: int = 32
    learning_rate: float = 1e-3
    weight_decay: float = 0.0
    cosine: bool = False
    clip: float = 1.0
    shift_steps: int = 0
    speed_spread: float = 0.0
    drop_taxels: float = 0.0

    def __post_init__(self) -> None:
        for name in ("epochs", "batch"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("learning_rate", "clip"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name} must be a positive number, not {getattr(self, name)!r}")
        if not (math.isfinite(self.weight_decay) and self.weight_decay >= 0):
            raise InputError(f"weight_decay must be a number from 0, not {self.weight_decay!r}")
        self.augmentation  # noqa: B018  # its fields are checked on construction

    @property
    def augmentation(self) -> AugmentConfig:
        """What is changed at random in every scan."""
        return AugmentConfig(shift_steps=self.shift_steps, speed_spread=self.speed_spread, drop_taxels=self.drop_taxels)

    def rate_at(self, epoch: int) -> float:
        """Return the learning rate of an epoch, counted from 0."""
        return self.learning_rate * (0.5 * (1 + math.cos(math.pi * epoch / self.epochs)) if self.cosine else 1.0)


@dataclass(frozen=True)
class Epoch:
    """What one epoch gave.

    Attributes
    ----------
    number : int
        From 1.
    loss : float
        Mean cross-entropy over the training scans, penalty included.
    accuracy : float
        Of the training scans while they were learned.
    held_out : float or None
        Accuracy on the images that were held out for selection or display.
    rate : float
        Mean spikes per step and hidden neuron.
    gradient : float
        Largest norm of the gradient before clipping.
    silent_outputs : int
        Outputs that were 0 for all training scans: output neurons that never fired.
    """

    number: int
    loss: float
    accuracy: float
    held_out: float | None
    rate: float
    gradient: float
    silent_outputs: int = 0

    def warnings(self, spiking: bool, classes: int) -> list[str]:
        """Return the signs of divergence, as sentences."""
        found = []
        if self.loss > 3 * math.log(classes) and self.number > 1:
            found.append(f"the loss of {self.loss:.3g} is more than three times that of guessing")
        if self.gradient > LARGE_GRADIENT:
            found.append(f"the gradient reached a norm of {self.gradient:.3g} before clipping")
        if self.silent_outputs:
            found.append(f"output neurons never fire ({self.silent_outputs} of {classes}): try another seed or readout")
        if spiking and not SILENT <= self.rate <= SATURATED:
            state = "hardly fire" if self.rate < SILENT else "fire in most steps"
            found.append(f"the hidden neurons {state} ({self.rate:.2g} spikes per step)")
        return found


@dataclass
class Training:
    """A network being trained, and all that a checkpoint holds.

    Attributes
    ----------
    network : nn.Module
    optimizer : torch.optim.Optimizer
    history : list of Epoch
    best : dict
        Epoch and predictions of the epoch with the highest held-out accuracy, the latest among equals.
    """

    network: nn.Module
    optimizer: torch.optim.Optimizer
    history: list[Epoch] = field(default_factory=list)
    best: dict[str, Any] = field(default_factory=dict)


class DivergedError(InputError):
    """The loss is no longer a number."""


def train(
    data: ScanData,
    images: Sequence[int] | NDArray[np.int64],
    network_config: NetworkConfig,
    train_config: TrainConfig,
    seed: int,
    *,
    held_out: Sequence[int] | NDArray[np.int64] | None = None,
    test: Sequence[int] | NDArray[np.int64] | None = None,
    checkpoint: Path | None = None,
    checkpoint_every: int = 5,
    device: str = "cpu",
    progress: Callable[[Epoch], object] | None = None,
) -> Training:
    """Return a trained network.

    Parameters
    ----------
    data : ScanData
    images : sequence of int
        Training images; all their scans are used.
    network_config, train_config, seed
        With the data they fix the result.
    held_out : sequence of int, optional
        Images of which the accuracy is noted after every epoch.
    test : sequence of int, optional
        Images whose predictions are kept for the epoch that ``held_out`` selects; they select nothing.
    checkpoint : Path, optional
        File to go on from, if it is there, and to write every ``checkpoint_every`` epochs and at the end.
    device : str
        As torch names it.
    progress : callable, optional
        Called with every Epoch of this run.

    Raises
    ------
    InputError
        If the network does not fit the data, or the checkpoint is damaged or of another configuration.
    DivergedError
        If the loss is not finite.
    """
    check_fits(network_config, data)
    scans = data.scans_of(images)
    network = build(network_config, seed)
    calibrate(network, data.batch(scans[:: -(-len(scans) // CALIBRATION_SCANS)]))
    network.to(device)
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=train_config.learning_rate, weight_decay=train_config.weight_decay
    )
    training = Training(network, optimizer)
    key = ""
    if checkpoint is not None:
        key = fingerprint(data, images, network_config, train_config, seed, held_out, test)
        if checkpoint.exists():
            load_checkpoint(checkpoint, training, key)
    for number in range(len(training.history), train_config.epochs):
        epoch = _epoch(training, data, scans, train_config, seed, number, device)
        if held_out is not None and len(held_out):
            accuracy = float((predict(network, data, held_out, device) == data.image_labels[held_out]).mean())
            epoch = dataclasses.replace(epoch, held_out=accuracy)
            if accuracy >= training.best.get("held_out", -1.0):
                training.best = {"epoch": epoch.number, "held_out": accuracy}
                if test is not None:
                    training.best["predictions"] = predict(network, data, test, device).tolist()
        training.history.append(epoch)
        if checkpoint is not None and (epoch.number % checkpoint_every == 0 or epoch.number == train_config.epochs):
            save_checkpoint(checkpoint, training, key)
        if progress is not None:
            progress(epoch)
    return training


def _epoch(
    training: Training,
    data: ScanData,
    scans: NDArray[np.int64],
    config: TrainConfig,
    seed: int,
    number: int,
    device: str,
) -> Epoch:
    """Learn from every training scan once."""
    generator = np.random.default_rng([seed, number])
    torch.manual_seed(int(generator.integers(2**62)))  # dropout
    network = training.network.train()
    for group in training.optimizer.param_groups:
        group["lr"] = config.rate_at(number)
    order = generator.permutation(scans)
    loss_sum = correct = largest = rate = 0.0
    seen = torch.zeros(len(data.class_names), device=device)
    for start in range(0, len(order), config.batch):
        chosen = order[start : start + config.batch]
        batch = augment(data.batch(chosen), data.taxels, config.augmentation, generator, data.frames).to(device)
        labels = torch.from_numpy(data.labels[chosen]).to(device)
        output: Output = network(batch)
        loss = functional.cross_entropy(output.logits, labels) + output.penalty
        value = float(loss.detach())
        if not math.isfinite(value):
            raise DivergedError(
                f"the training diverged in epoch {number + 1}: the loss is {value}; "
                f"lower the learning rate or the input scale"
            )
        training.optimizer.zero_grad()
        loss.backward()
        norm = float(nn.utils.clip_grad_norm_(network.parameters(), config.clip))
        training.optimizer.step()
        seen = torch.maximum(seen, output.logits.detach().abs().amax(0))
        loss_sum += value * len(chosen)
        correct += float((output.logits.argmax(1) == labels).sum())
        rate += output.rate * len(chosen)
        largest = max(largest, norm)
    count = len(order)
    silent = int((seen == 0).sum())
    return Epoch(number + 1, loss_sum / count, correct / count, None, rate / count, largest, silent)


def predict(
    network: nn.Module, data: ScanData, images: Sequence[int] | NDArray[np.int64], device: str = "cpu"
) -> NDArray[np.int64]:
    """Return the class of every image, from the scan of its first start row, shape (len(images),)."""
    scans = data.scans_of(images, first_row_only=True)
    of_image = dict(zip(data.images[scans].tolist(), scans.tolist(), strict=True))
    ordered = np.array([of_image[int(image)] for image in images], np.int64)
    return logits_of(network, data, ordered, device).argmax(1)


def logits_of(
    network: nn.Module,
    data: ScanData,
    scans: NDArray[np.int64] | None = None,
    device: str = "cpu",
) -> NDArray[np.float32]:
    """Return what the network says about some scans, by default about all, shape (scans, classes)."""
    scans = np.arange(len(data)) if scans is None else scans
    network.eval()
    with torch.no_grad():
        parts = [
            network(data.batch(scans[start : start + BATCH]).to(device)).logits.cpu().numpy()
            for start in range(0, len(scans), BATCH)
        ]
    return np.concatenate(parts) if parts else np.zeros((0, len(data.class_names)), np.float32)


def check_fits(config: NetworkConfig, data: ScanData) -> None:
    """Refuse a network whose inputs or classes are not those of the data."""
    if config.inputs != data.channels:
        raise InputError(
            f"the network takes {config.inputs} channels, the scans have {data.channels} ({data.taxels} taxels); "
            f"they come from another array, encoding or time step"
        )
    if config.classes != len(data.class_names):
        raise InputError(f"the network knows {config.classes} classes, the data have {len(data.class_names)}")


# -- checkpoints -------------------------------------------------------------------------------------


def digest(data: ScanData) -> str:
    """Return a text that is the same only for the same scans of the same images."""
    found = hashlib.sha256(np.ascontiguousarray(data.values).tobytes())
    found.update(data.labels.tobytes() + data.images.tobytes())
    return found.hexdigest()


def fingerprint(
    data: ScanData,
    images: Sequence[int] | NDArray[np.int64],
    network_config: NetworkConfig,
    train_config: TrainConfig,
    seed: int,
    held_out: Sequence[int] | NDArray[np.int64] | None = None,
    test: Sequence[int] | NDArray[np.int64] | None = None,
) -> str:
    """Return a text that is the same only where a training would give the same network."""
    parts = {
        "network": network_config.to_dict(),
        "train": dataclasses.asdict(train_config),
        "seed": seed,
        "data": digest(data),
        "images": [int(image) for image in images],
        "held_out": None if held_out is None else [int(image) for image in held_out],
        "test": None if test is None else [int(image) for image in test],
    }
    return json.dumps(parts, sort_keys=True)


def save_checkpoint(path: Path, training: Training, key: str) -> None:
    """Write everything that is needed to go on, whole or not at all."""
    content = {
        "format": CHECKPOINT_FORMAT,
        "key": key,
        "network": training.network.state_dict(),
        "optimizer": training.optimizer.state_dict(),
        "history": [dataclasses.asdict(epoch) for epoch in training.history],
        "best": training.best,
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    with atomic_write(path) as file:
        file.write(buffer.getvalue())


def load_checkpoint(path: Path, training: Training, key: str) -> None:
    """Put a training where a checkpoint left it.

    Raises
    ------
    InputError
        If the file is damaged, or was written by a training with other parameters, data or seed.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        if content["format"] != CHECKPOINT_FORMAT:
            raise InputError(f"checkpoint {path} has another format; remove it to start anew")
        if content["key"] != key:
            found = "; ".join(_differences(json.loads(content["key"]), json.loads(key)))
            raise InputError(
                f"checkpoint {path} is of another configuration ({found}); "
                f"remove it or choose another folder with --out"
            )
        training.network.load_state_dict(content["network"])
        training.optimizer.load_state_dict(content["optimizer"])
        training.history = [Epoch(**epoch) for epoch in content["history"]]
        training.best = content["best"]
    except InputError:
        raise
    except (OSError, RuntimeError, EOFError, KeyError, TypeError, ValueError, pickle.UnpicklingError,
            zipfile.BadZipFile):  # fmt: skip
        raise InputError(f"checkpoint {path} is damaged; remove it to start anew") from None


def _differences(there: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return the fields that differ, with both values where these are numbers or words to read."""
    found = []
    for name, value in now.items():
        other = there.get(name)
        if isinstance(value, dict) and isinstance(other, dict):
            found += _differences(other, value)
        elif value != other:
            readable = name != "data" and not isinstance(value, list)
            found.append(f"{name}: {other} there, {value} now" if readable else f"other {name.replace('_', ' ')}")
    return found
