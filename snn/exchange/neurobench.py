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
from eskin.snn.network import SpikingNetwork, connections, layers_ahead

BATCH = 64


def measure(network: nn.Module, data: ScanData) -> dict[str, Any]:
    """Return footprint, sparsities and synaptic operations of a network that classifies scans.

    - ``footprint_bytes``: parameters and buffers.
    - ``connection_sparsity``: share of weights that are zero, without biases. A stack has weights within a layer, and
      from each layer to the next.
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
        exist = [one.expand_as(w) for one, w in zip(connections(network.config), network.weights(), strict=True)]
        found = [(w != 0) & one for one, w in zip(exist, network.weights(), strict=True)]
        size, used = (sum(int(one.sum()) for one in weights) for weights in (exist, found))
        reach = _reach(network, *found)
        totals = np.zeros(4)  # MACs, ACs, spikes, neurons times steps
        steps = 0
        together = BATCH if data.of_one_length else 1
        for start in range(0, len(data), together):
            chosen = np.arange(start, min(start + together, len(data)))
            x = data.batch(chosen)[: max(map(data.steps_of, chosen.tolist()))]
            totals += _count(network, x, *reach)
            steps += x.shape[0] * x.shape[1]
    macs, acs, spikes, neurons = totals.tolist()
    return {
        "footprint_bytes": sum(one.numel() * one.element_size() for one in (*network.parameters(), *network.buffers())),
        "connection_sparsity": 1 - used / size,
        "activation_sparsity": 1 - spikes / neurons,
        "synaptic_operations": {
            "Effective_MACs": macs / len(data),
            "Effective_ACs": acs / len(data),
            "Dense": steps * size / len(data),
        },
    }


def _reach(network: SpikingNetwork, w_in: Tensor, w_rec: Tensor, w_out: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the operations of an input, of a spike in its own step, and of a spike one step later."""
    own = layers_ahead(network.config) == 0  # a spike reaches the next layer of a stack at once
    now = (w_rec & ~own).sum(0) + w_out.sum(0)
    return w_in.sum(0).double(), now.double(), (w_rec & own).sum(0).double()


def _count(network: SpikingNetwork, x: Tensor, entry: Tensor, now: Tensor, later: Tensor) -> list[float]:
    """Return MACs, ACs, spikes, and neurons times steps for inputs of shape (steps, scans, channels)."""
    entering = (x != 0).double() @ entry
    binary = ((x == 0) | (x == 1)).all(-1)
    s = network.spikes(x).double()
    inner = float((s @ now).sum() + (s[:-1] @ later).sum())
    spikes, neurons = float(s.sum()), s.numel()
    if network.config.readout == "spikes":  # then the logits are their scaled number
        logits = network(x).logits
        spikes += float(logits.double().sum()) / network.config.output_scale
        neurons += len(x) * logits.numel()
    return [float(entering[~binary].sum()), float(entering[binary].sum()) + inner, spikes, neurons]
