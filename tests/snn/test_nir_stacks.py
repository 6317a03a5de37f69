"""Test stacks of layers from snnTorch and Norse: equal spikes and classes in float, in integers and in the RTL."""

import itertools
from pathlib import Path
from typing import Any

import nir
import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.cocotb_tests.blocks.classifier import play_scans
from eskin.model.classifier.network import State
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.nir_network import from_nir, to_nir
from eskin.snn.network import SpikingNetwork

SIZES = (8, 12, 10, 4)
COUNTS = torch.from_numpy(np.random.default_rng(3).poisson(0.6, (40, 16, SIZES[0]))).float()


def snntorch_stack(**leaky: Any) -> torch.nn.Module:
    """Return two hidden layers and an output layer with Leaky neurons."""
    import snntorch

    torch.manual_seed(1)
    parts: list[torch.nn.Module] = []
    for size, after in itertools.pairwise(SIZES):
        linear = torch.nn.Linear(size, after)
        torch.nn.init.normal_(linear.weight, 0.1, 0.5)
        beta = torch.full((after,), 0.9375 if after == 10 else 0.75)
        parts += [linear, snntorch.Leaky(beta=beta, threshold=torch.ones(after), init_hidden=True, **leaky)]
    return torch.nn.Sequential(*parts)


def graph_of(net: torch.nn.Module) -> nir.NIRGraph:
    from snntorch.export_nir import export_to_nir

    return export_to_nir(net, torch.zeros(SIZES[0]))


def spikes_of(net: torch.nn.Module) -> list[torch.Tensor]:
    """Return the spikes of every layer, each of shape (steps, scans, neurons)."""
    with torch.no_grad():
        states = [[], [], []]
        for x in COUNTS:
            for number in range(3):
                x = net[2 * number + 1](net[2 * number](x))
                states[number].append(x)
    return [torch.stack(spikes) for spikes in states]


@pytest.mark.parametrize(
    ("reset", "leaky"),
    [
        ("delayed", {}),
        ("zero", {"reset_mechanism": "zero", "reset_delay": False}),
    ],
)
def test_a_stack_of_snntorch_has_its_spikes_and_its_classes_in_the_rtl(
    reset: str, leaky: dict[str, Any], tmp_path: Path
) -> None:
    theirs = snntorch_stack(**leaky)
    weights = from_nir(graph_of(theirs), 1e-4, reset=reset)
    network = weights.network.eval()
    assert isinstance(network, SpikingNetwork)
    assert network.config.layers == (12, 10)
    expected = spikes_of(theirs)
    assert all(0.01 < float(spikes.mean()) < 0.9 for spikes in expected)
    with torch.no_grad():
        assert torch.equal(network.spikes(COUNTS), torch.cat(expected[:2], 2))
        logits = network(COUNTS).logits
    assert torch.equal(logits, expected[2].sum(0))

    made = quantise(weights, Precision(lanes=4))
    config = made.network.config
    assert [tuple(group) for group in config.layers] == [(0, 12, ()), (12, 22, (0,))]
    assert config.recurrent_words == 12 * 3  # of words 3 to 5: from each neuron of the first layer to the second
    counts = COUNTS.numpy().astype(np.int64).transpose(1, 0, 2)
    evidence, _ = made.network.run_counts(counts)
    assert (evidence.argmax(1) == logits.argmax(1).numpy()).mean() > 0.8
    if reset == "delayed":
        seen = play_scans(made, counts[:1], "icarus", tmp_path)
        assert seen["hidden spikes"] > 100
        assert seen["output spikes"] > 10


def test_a_layer_begins_one_bin_after_the_layer_before() -> None:
    theirs = snntorch_stack()
    made = quantise(from_nir(graph_of(theirs), 1e-4, reset="delayed"), Precision(lanes=4)).network
    state, spikes = State(made), []
    counts = COUNTS[:, 0].numpy().astype(np.int64)
    for row in (*counts, counts[0] * 0):
        state.add_counts(row[None])
        state.end_bin()
        spikes.append(state.spikes[0])
    fired = np.array(spikes)
    assert not fired[0, 12:].any()
    first, second = (layer[:, 0].numpy() for layer in spikes_of(theirs)[:2])
    assert (fired[:-1, :12] == first).mean() > 0.97
    assert (fired[1:, 12:] == second).mean() > 0.9


def test_what_a_stack_cannot_express_is_refused_with_its_node() -> None:
    graph = graph_of(snntorch_stack())
    weights = from_nir(graph, 1e-4, reset="delayed")
    with pytest.raises(InputError, match="export this stack as"):
        to_nir(weights)
    names = [name for name, node in graph.nodes.items() if isinstance(node, nir.LIF)]
    lif = graph.nodes[names[1]]
    graph.nodes[names[1]] = nir.LI(tau=lif.tau, r=lif.r, v_leak=lif.v_leak)
    with pytest.raises(
        InputError, match=f"node '{names[1]}' is of type LI, where the network has IF or LIF or CubaLIF"
    ):
        from_nir(graph, 1e-4)
    one = np.ones(10)
    graph.nodes[names[1]] = nir.CubaLIF(
        tau_mem=one, tau_syn=one, r=one, w_in=one, v_leak=0 * one, v_threshold=one, v_reset=0 * one
    )
    with pytest.raises(InputError, match=f"'{names[1]}' differ in tau_syn"):
        from_nir(graph, 1e-4)
