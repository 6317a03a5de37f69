"""NeuroBench's metrics of a spiking network, by their published definitions.

Source: Yik et al., "The NeuroBench framework for benchmarking neuromorphic computing algorithms and systems", Nature
Communications 16, 1545, 2025, section "Algorithm track metrics". The package neurobench counts what goes through
``nn.Linear`` modules, of which the compiled layers of this project have none.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from eskin.base.errors import InputError
from eskin.snn.data.scans import ScanData
from eskin.snn.network import SpikingNetwork

BATCH = 64


def measure(network: nn.Module, data: ScanData) -> dict[str, Any]:
    """Return footprint, sparsities and synaptic operations of a network that classifies scans.

    - ``footprint_bytes``: parameters and buffers.
    - ``connection_sparsity``: share of weights that are zero, without biases.
    - ``activation_sparsity``: share of neurons and steps without a spike.
    - ``synaptic_operations``: mean of a scan. A non-zero input that meets a non-zero weight is an operation: an
      accumulation (``Effective_ACs``) if all inputs of the layer in that step are 0 or 1, as spikes are, else a
      multiplication (``Effective_MACs``). ``Dense`` counts every weight in every step. Biases and leaks do not count,
      and ``input_scale`` belongs to the weights.
    """
    if not isinstance(network, SpikingNetwork):
        raise InputError("--metrics counts synaptic operations of spikes; the network is no spiking network")
    network.eval()
    with torch.no_grad():
        weights = network.weights()
        zeros = sum(int((one == 0).sum()) for one in weights)
        size = sum(one.numel() for one in weights)
        totals = np.zeros(4)  # MACs, ACs, spikes, neurons times steps
        steps = 0
        together = BATCH if data.of_one_length else 1
        for start in range(0, len(data), together):
            chosen = np.arange(start, min(start + together, len(data)))
            x = data.batch(chosen)[: max(map(data.steps_of, chosen.tolist()))]
            totals += _count(network, x, weights)
            steps += x.shape[0] * x.shape[1]
    macs, acs, spikes, neurons = totals.tolist()
    return {
        "footprint_bytes": sum(one.numel() * one.element_size() for one in (*network.parameters(), *network.buffers())),
        "connection_sparsity": zeros / size,
        "activation_sparsity": 1 - spikes / neurons,
        "synaptic_operations": {
            "Effective_MACs": macs / len(data),
            "Effective_ACs": acs / len(data),
            "Dense": steps * size / len(data),
        },
    }


def _count(network: SpikingNetwork, x: Tensor, weights: tuple[Tensor, Tensor, Tensor]) -> list[float]:
    """Return MACs, ACs, spikes, and neurons times steps for inputs of shape (steps, scans, channels)."""
    reach_in, reach_rec, reach_out = ((one != 0).sum(0).double() for one in weights)  # operations of an input
    entering = (x != 0).double() @ reach_in
    binary = ((x == 0) | (x == 1)).all(-1)
    s = network.spikes(x).double()
    inner = float((s[:-1] @ reach_rec).sum() + (s @ reach_out).sum())  # recurrent spikes arrive one step later
    spikes, neurons = float(s.sum()), s.numel()
    if network.config.readout == "spikes":  # then the logits are their scaled number
        logits = network(x).logits
        spikes += float(logits.double().sum()) / network.config.output_scale
        neurons += len(x) * logits.numel()
    return [float(entering[~binary].sum()), float(entering[binary].sum()) + inner, spikes, neurons]
