"""Compare NeuroBench's metrics with values computed by hand."""

import dataclasses

import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.snn.data.scans import ScanData
from eskin.snn.exchange.neurobench import measure
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig
from tests.snn.helpers import easy_data, small_network


def by_hand(**fields: object) -> tuple[SpikingNetwork, ScanData]:
    """Return a network of two channels, two hidden neurons and two classes, and a scan of three steps.

    Channel 0 makes neuron 0 fire in the same step; a spike of neuron 0 makes neuron 1 fire one step later, and class 0
    fire in the same step. Channel 1 reaches both neurons with too little.
    """
    config = NetworkConfig.from_dict(
        {"inputs": 2, "classes": 2, "hidden": 2, "decay": 0.01, "output_decay": 0.01} | fields
    )
    network = SpikingNetwork(config)
    for name, rows in (("w_in", [[2, 0.1], [0, 0.1]]), ("w_rec", [[0, 0], [2, 0]]), ("w_out", [[2, 0], [0, 0.5]])):
        getattr(network, name).data = torch.tensor(rows, dtype=torch.float32)
    counts = np.array([[[1, 0], [0, 1], [0, 2]]], np.int16)
    return network, ScanData(counts, np.array([0]), np.array([0]), ("scan",), ("a", "b"), 2, 0.001, 1.0)


def test_the_metrics_of_a_small_network_are_those_computed_by_hand() -> None:
    network, data = by_hand()
    found = measure(network, data)
    # Weights: 12, zeros: 1 + 3 + 2. Float32: 12 weights, 4 biases, 4 decays.
    assert found["footprint_bytes"] == 4 * 20
    assert found["connection_sparsity"] == pytest.approx(6 / 12)
    # Step 0: neuron 0 and class 0 fire; step 1: neuron 1. So 3 spikes of 4 neurons in 3 steps.
    assert found["activation_sparsity"] == pytest.approx(1 - 3 / 12)
    # Inputs: step 0 reaches one weight, step 1 two, and step 2 two with a count of 2. Neuron 0 reaches one recurrent
    # weight and one output, neuron 1 one output.
    operations = {"Effective_MACs": 2.0, "Effective_ACs": 1 + 2 + 2 + 1, "Dense": 3 * 12}
    assert found["synaptic_operations"] == operations


def test_without_output_spikes_only_hidden_neurons_are_activations() -> None:
    network, data = by_hand(readout="membrane")
    found = measure(network, data)
    assert found["activation_sparsity"] == pytest.approx(1 - 2 / 6)
    assert found["synaptic_operations"]["Effective_ACs"] == 6


def test_a_mean_over_scans_does_not_depend_on_their_padding() -> None:
    data = easy_data(images=6)
    network = build(small_network(), 0)
    alone = measure(network, data)
    longer = np.concatenate([data.values, np.zeros_like(data.values)], 1)
    padded = ScanData(
        longer, data.labels, data.images, data.names, data.class_names, 4, 0.004, 1.0, lengths=np.full(6, data.steps)
    )
    found = measure(network, padded)
    assert found["synaptic_operations"] == pytest.approx(alone["synaptic_operations"])
    assert found["activation_sparsity"] == pytest.approx(alone["activation_sparsity"])
    assert alone["synaptic_operations"]["Effective_MACs"] > 0


def test_a_spike_reaches_the_next_layer_of_a_stack_in_its_own_step() -> None:
    network, data = by_hand(layers=(1, 1))
    network.w_in.data[1] = 0
    network.w_out.data = torch.tensor([[0.0, 2], [0, 0]])
    found = measure(network, dataclasses.replace(data, values=np.array([[[1, 0], [0, 1], [1, 0]]], np.int16)))
    # Weights: 2 of the inputs, 3 between neurons, 2 of the outputs; zeros: 2 + 1.
    assert found["connection_sparsity"] == pytest.approx(3 / 7)
    # Neuron 0, neuron 1 and class 0 fire in steps 0 and 2, each for one weight; each step has one input.
    assert found["activation_sparsity"] == pytest.approx(1 - 6 / 12)
    assert found["synaptic_operations"] == {"Effective_MACs": 0.0, "Effective_ACs": 3 + 2 * 2, "Dense": 3 * 7}


def test_a_network_of_frames_is_refused() -> None:
    network = build(NetworkConfig(inputs=8, classes=3, kind="gru"), 0)
    with pytest.raises(InputError, match="the network is no spiking network"):
        measure(network, easy_data())
