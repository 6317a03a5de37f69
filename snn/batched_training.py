"""Train several convolutional networks together, because a single network does not fill a GPU.

The networks differ in training images and seed.

Every network gets the scans, shifts and learning rates of ``eskin.snn.train.train``. Only its dropout differs.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from eskin.snn.adam import Adam
from eskin.snn.calibration import calibrate
from eskin.snn.data.scans import ScanData
from eskin.snn.network import ConvolutionalNetwork, build
from eskin.snn.network_config import NetworkConfig
from eskin.snn.train import CALIBRATION_SCANS
from eskin.snn.training import DivergedError, TrainConfig

Images = Sequence[int] | NDArray[np.int64]


def train_together(
    data: ScanData,
    learned: Sequence[Images],
    seeds: Sequence[int],
    network_config: NetworkConfig,
    train_config: TrainConfig,
    device: str,
) -> list[ConvolutionalNetwork]:
    """Return one trained network for each entry of ``learned``, on the CPU.

    Raise DivergedError if a weight is not finite at the end.

    - ``learned``, ``seeds``: training images and seed of each network; all networks have equally many scans.
    - ``network_config``, ``train_config``: equal for all networks. Windows, class weights, speeds and dropped taxels
      are not supported.
    - ``device``: device name of torch.
    """
    others = ("window_steps", "windows", "balanced", "speed_spread", "drop_taxels")
    supported = dataclasses.replace(train_config, **{name: getattr(TrainConfig, name) for name in others})
    if network_config.kind != "cnn" or train_config != supported:
        raise NotImplementedError("only convolutional networks with shifted whole scans are trained together")
    scans = np.stack([data.scans_of(images) for images in learned])
    networks = []
    for one, seed in zip(scans, seeds, strict=True):
        network = build(network_config, seed)
        calibrate(network, data.batch(one[:: -(-len(one) // CALIBRATION_SCANS)]))
        assert isinstance(network, ConvolutionalNetwork)
        networks.append(network)
    stacked, _ = torch.func.stack_module_state(networks)
    weights = {name: nn.Parameter(value.detach().to(device)) for name, value in stacked.items()}
    scale, offset = (
        torch.tensor([getattr(network.config, name) for network in networks], device=device).view(-1, 1, 1, 1)
        for name in ("input_scale", "input_offset")
    )
    optimizer = Adam(weights.values(), train_config.learning_rate, train_config.weight_decay)
    values = torch.from_numpy(data.values).to(device)
    targets = torch.from_numpy(data.labels).to(device)
    for epoch in range(train_config.epochs):
        optimizer.learning_rate = train_config.rate_at(epoch)
        order, shifts = _drawn(scans, seeds, epoch, train_config)
        for start in range(0, order.shape[1], train_config.batch):
            part = slice(start, start + train_config.batch)
            chosen = order[:, part].to(device)
            moved = _moved(values[chosen], shifts[:, part].to(device), data.frames)
            logits = _logits(network_config, weights, (moved - offset) * scale)
            losses = functional.cross_entropy(logits.flatten(0, 1), targets[chosen].flatten(), reduction="none")
            optimizer.zero_grad()
            losses.view(chosen.shape).mean(1).sum().backward()
            _clip_each(optimizer.parameters, train_config.clip)
            optimizer.step()
    for number, network in enumerate(networks):
        network.load_state_dict({name: weight[number] for name, weight in weights.items()})
    if not all(torch.isfinite(p).all() for network in networks for p in network.parameters()):
        raise DivergedError("a training diverged: a weight is not a number; lower the learning rate")
    return networks


def _drawn(scans: NDArray[np.int64], seeds: Sequence[int], epoch: int, config: TrainConfig) -> tuple[Tensor, Tensor]:
    """Return order and shifts of the scans in an epoch, shape (networks, scans), as ``train`` draws them."""
    orders, shifts = [], []
    for one, seed in zip(scans, seeds, strict=True):
        generator = np.random.default_rng([seed, epoch])
        generator.integers(2**62)  # the seed of the dropout in ``train``
        orders.append(generator.permutation(one))
        most, starts = config.shift_steps, range(0, len(one), config.batch)
        sizes = [min(config.batch, len(one) - start) for start in starts]
        drawn = [generator.integers(-most, most + 1, size) if most else np.zeros(size, np.int64) for size in sizes]
        shifts.append(np.concatenate(drawn))
    return torch.from_numpy(np.stack(orders)), torch.from_numpy(np.stack(shifts))


def _moved(batch: Tensor, shifts: Tensor, frames: bool) -> Tensor:
    """Return scans, shape (networks, scans, steps, channels), shifted in time as by ``augment``."""
    steps = batch.shape[2]
    source = torch.arange(steps, device=batch.device) - shifts[..., None]
    index = source.clamp(0, steps - 1)[..., None].expand(-1, -1, -1, batch.shape[3])
    moved = batch.gather(2, index).float()
    return moved if frames else moved * ((source >= 0) & (source < steps))[..., None]


def _clip_each(parameters: Sequence[nn.Parameter], most: float) -> None:
    """Scale the gradients of each network to a norm of at most ``most``."""
    gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
    squares = torch.stack([gradient.flatten(1).square().sum(1) for gradient in gradients]).sum(0)
    factors = (most / (squares.sqrt() + 1e-6)).clamp(max=1.0)
    for gradient in gradients:
        gradient.mul_(factors.view(-1, *[1] * (gradient.ndim - 1)))


def _logits(config: NetworkConfig, weights: Mapping[str, Tensor], x: Tensor) -> Tensor:
    """Return logits, shape (networks, scans, classes), of scaled scans of shape (networks, scans, steps, channels).

    ``weights`` has the stacked parameters of ``ConvolutionalNetwork`` by name.
    """
    h = x.transpose(2, 3)
    for number in range(0, 9, 3):
        h = _convolved(h, weights[f"layers.{number}.weight"], weights[f"layers.{number}.bias"])
        h = functional.layer_norm(h, h.shape[-2:])  # GroupNorm with one group
        scale, offset = (weights[f"layers.{number + 1}.{name}"][:, None, :, None] for name in ("weight", "bias"))
        h = torch.relu(h * scale + offset)
    features = functional.dropout(h.mean(3), config.dropout)
    logits = torch.baddbmm(weights["out.bias"][:, None], features, weights["out.weight"].transpose(1, 2))
    return logits * config.output_scale


def _convolved(x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Return the convolution over time of every network's scans with its own kernel.

    Shapes: x (networks, scans, channels, steps), weight (networks, outputs, channels, width), bias (networks, outputs).
    """
    width = weight.shape[3]
    windows = functional.pad(x, (width // 2, width // 2)).unfold(3, width, 1)  # ..., channels, steps, width
    columns = windows.permute(0, 2, 4, 1, 3).flatten(3).flatten(1, 2)  # networks, channels * width, scans * steps
    found = torch.baddbmm(bias[:, :, None], weight.flatten(2), columns)
    return found.view(*found.shape[:2], x.shape[1], x.shape[3]).transpose(1, 2)
