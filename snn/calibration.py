"""Calibrate the input scale and the initial biases of a network on its training scans.

Integrate-and-fire neurons without a leak whose input has a negative mean stay at the floor: they never fire and receive
no gradient. With the biases set here each neuron starts at a given mean rate, similar to data-dependent initialisation
of deep networks (D. Mishkin, J. Matas, "All you need is a good init", ICLR 2016). Only the starting point of the
network differs.
"""

import dataclasses

import torch
from torch import Tensor, nn

from eskin.snn.network import SpikingNetwork
from eskin.snn.network_config import NetworkConfig

ROUNDS = 30
"""Steps towards the rate of the hidden neurons, which excite each other; each halves the distance."""


@torch.no_grad()
def calibrate(network: nn.Module, scans: Tensor) -> None:
    """Set input scale and offset, and the biases of a spiking network in place, as configured.

    - ``network``: network from ``build``. ``network.config`` receives the resulting numbers.
    - ``scans``: shape (steps, scans, inputs); training scans; the same scans give the same numbers.
    """
    config = network.config
    assert isinstance(config, NetworkConfig)
    offset = float(scans.mean()) if config.input_center else config.input_offset
    scale = config.input_scale
    if config.input_rms:
        size = float((scans - offset).square().mean().sqrt())
        scale = config.input_rms / size if size else 1.0
    network.config = dataclasses.replace(config, input_scale=scale, input_offset=offset)
    if not isinstance(network, SpikingNetwork):
        return
    if config.hidden_rate:
        drive = torch.einsum("tbi,hi->h", scans, network.w_in) * (scale / (scans.shape[0] * scans.shape[1]))
        network.b_hidden.copy_(config.hidden_rate - drive)
        for _ in range(ROUNDS):
            network.b_hidden.add_(config.hidden_rate - network.spikes(scans).mean((0, 1)), alpha=0.5)
    if config.output_rate:
        rates = network.spikes(scans).mean((0, 1))
        network.b_out.copy_(config.output_rate - network.w_out @ rates)
