"""Train a network, with checkpoints from which a stopped training continues with an identical result.

All random numbers of an epoch (order, augmentation, dropout) derive from the seed and the number of the epoch. A
checkpoint therefore needs no generator state, and an interrupted training ends with the same bits as an uninterrupted
one.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from eskin.base.errors import InputError
from eskin.base.progress import note
from eskin.model.classifier.config import ClassifierConfig
from eskin.snn.adam import Adam
from eskin.snn.calibration import calibrate
from eskin.snn.checkpoint import Checkpoint, fingerprint, load_checkpoint, save_checkpoint
from eskin.snn.data.augment import augment
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.network import Output, build
from eskin.snn.network_config import NetworkConfig
from eskin.snn.training import DivergedError, Epoch, TrainConfig, Training

CALIBRATION_SCANS = 128
"""Largest number of training scans, evenly spread, that set the input scale and the first biases."""

BATCH = 64
"""Number of scans in a batch for a trained network."""


def train(
    split: Split,
    network_config: NetworkConfig,
    train_config: TrainConfig,
    seed: int,
    *,
    checkpoint: Checkpoint | None = None,
    device: str = "cpu",
    progress: Callable[[Epoch], object] | None = None,
) -> Training:
    """Return a trained network.

    Raise InputError if the network does not fit the data, or the checkpoint is damaged or of another configuration;
    DivergedError if the loss is not finite.

    - ``split``: the scans, and which images are learned, held out and tested.
    - ``network_config``, ``train_config``, ``seed``: with the split they fix the result.
    - ``checkpoint``: checkpoint to load and to write.
    - ``device``: device name of torch.
    - ``progress``: called with every epoch of this run.
    """
    data = split.data
    check_fits(network_config, data)
    scans = data.scans_of(split.learned)
    network = build(network_config, seed)
    some = scans[:: -(-len(scans) // CALIBRATION_SCANS)]
    calibrate(network, _inputs(data, some, train_config, np.random.default_rng(seed)))
    network.to(device)
    optimizer = Adam(network.parameters(), train_config.learning_rate, train_config.weight_decay)
    training = Training(network, optimizer)
    key = ""
    if checkpoint is not None:
        key = fingerprint(split, network_config, train_config, seed)
        if checkpoint.path.exists():
            load_checkpoint(checkpoint.path, training, key)
    done = len(training.history)
    if 0 < done < train_config.epochs:
        note(f"continuing after epoch {done} of {train_config.epochs}")
    for number in range(done, train_config.epochs):
        epoch = _epoch(training, data, scans, train_config, seed, number, device)
        if split.held_out is not None and len(split.held_out):
            epoch = _note_held_out(training, split, epoch, device)
        training.history.append(epoch)
        if checkpoint is not None and (epoch.number % checkpoint.every == 0 or epoch.number == train_config.epochs):
            save_checkpoint(checkpoint.path, training, key)
        if progress is not None:
            progress(epoch)
    return training


def _note_held_out(training: Training, split: Split, epoch: Epoch, device: str) -> Epoch:
    """Return an epoch with the accuracy on held-out images."""
    network, data, held_out = training.network, split.data, split.held_out
    assert held_out is not None
    accuracy = float((predicted_classes(network, data, held_out, device) == data.image_labels[held_out]).mean())
    if accuracy >= training.best.get("held_out", -1.0):
        training.best = {"epoch": epoch.number, "held_out": accuracy}
        if split.test is not None:
            training.best["predictions"] = predicted_classes(network, data, split.test, device).tolist()
    return dataclasses.replace(epoch, held_out=accuracy)


def _epoch(
    training: Training,
    data: ScanData,
    scans: NDArray[np.int64],
    config: TrainConfig,
    seed: int,
    number: int,
    device: str,
) -> Epoch:
    """Train on every training scan once."""
    generator = np.random.default_rng([seed, number])
    dropout = int(generator.integers(2**62))
    # torch.manual_seed also queues a call with a traceback for every absent accelerator: half the time of small data
    (torch.default_generator if device == "cpu" else torch).manual_seed(dropout)
    network = training.network.train()
    training.optimizer.learning_rate = config.rate_at(number)
    order = generator.permutation(np.repeat(scans, config.windows))
    weights = _class_weights(data.labels[scans], len(data.class_names)) if config.balanced else None
    loss_sum = correct = largest = rate = 0.0
    seen = torch.zeros(len(data.class_names), device=device)
    for start in range(0, len(order), config.batch):
        chosen = order[start : start + config.batch]
        batch = _inputs(data, chosen, config, generator)
        batch = augment(batch, data.taxels, config, generator, data.frames).to(device)
        labels = torch.from_numpy(data.labels[chosen]).to(device)
        output: Output = network(batch)
        loss = _loss(output.logits, labels, weights) + output.penalty
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
    if not all(torch.isfinite(parameter).all() for parameter in network.parameters()):
        raise DivergedError(
            f"the training diverged in epoch {number + 1}: a weight is not a number; lower the learning rate"
        )
    count = len(order)
    silent = int((seen == 0).sum())
    return Epoch(number + 1, loss_sum / count, correct / count, None, rate / count, largest, silent)


def _inputs(data: ScanData, scans: NDArray[np.int64], config: TrainConfig, generator: np.random.Generator) -> Tensor:
    """Return the training input of scans: all steps, or a window of each."""
    return data.windows(scans, config.window_steps, generator) if config.window_steps else data.batch(scans)


def _class_weights(labels: NDArray[np.int64], classes: int) -> Tensor:
    """Return the loss weight of each class, inverse to its number of scans, with mean 1."""
    counts = np.bincount(labels, minlength=classes)
    weights = len(labels) / (np.count_nonzero(counts) * np.maximum(counts, 1))
    return torch.from_numpy(weights.astype(np.float32))


def _loss(logits: Tensor, labels: Tensor, weights: Tensor | None) -> Tensor:
    """Return the mean cross-entropy of a batch, weighted by class."""
    if weights is None:
        return functional.cross_entropy(logits, labels)
    weights = weights.to(logits)
    return functional.cross_entropy(logits, labels, weight=weights, reduction="sum") / len(labels)


def predicted_classes(
    network: nn.Module, data: ScanData, images: Sequence[int] | NDArray[np.int64], device: str = "cpu"
) -> NDArray[np.int64]:
    """Return the predicted class of every image, from its first scan, shape (len(images),)."""
    return logits_of(network, data, data.first_scans(images), device).argmax(1)


def logits_of(
    network: nn.Module,
    data: ScanData,
    scans: NDArray[np.int64] | None = None,
    device: str = "cpu",
) -> NDArray[np.float32]:
    """Return the logits of scans, shape (scans, classes).

    A scan that was filled up goes in alone and with its own steps: its evidence is that of all its steps and no other.
    """
    scans = np.arange(len(data)) if scans is None else scans
    together = BATCH if data.of_one_length else 1
    network.eval()
    parts = []
    with torch.no_grad():
        for start in range(0, len(scans), together):
            chosen = scans[start : start + together]
            batch = data.batch(chosen)[: max(map(data.steps_of, chosen.tolist()))]
            parts.append(network(batch.to(device)).logits.cpu().numpy())
    return np.concatenate(parts) if parts else np.zeros((0, len(data.class_names)), np.float32)


def check_fits(config: NetworkConfig | ClassifierConfig, data: ScanData) -> None:
    """Check that inputs and classes of a network fit the data."""
    if config.inputs != data.channels:
        raise InputError(
            f"the network has {config.inputs} input channels, but the scans have {data.channels} "
            f"({data.taxels} taxels); use scans with the same array, encoding and time step"
        )
    if config.classes != len(data.class_names):
        raise InputError(f"the network has {config.classes} classes, but the data have {len(data.class_names)}")
