"""Test spikes and gradients of the neuron layer against a plain loop, and the networks."""

import itertools
import math
import shutil
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from eskin.base.errors import InputError
from eskin.snn.kernels.layer import MAX_ENTRIES, Backend, layer
from eskin.snn.kernels.reference import layer_reference
from eskin.snn.kernels.rule import SURROGATES, NeuronReset, NeuronRule
from eskin.snn.network import Output, SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig
from tests.snn.helpers import small_network

needs_kernel = pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler for the kernel")
RESETS: tuple[NeuronReset, ...] = ("zero", "subtract")
RULES = [
    NeuronRule(reset=reset, reset_gradient=through, surrogate=surrogate, surrogate_width=0.7)
    for reset, through, surrogate in itertools.product(RESETS, (False, True), SURROGATES)
]


def grid(shape: tuple[int, ...], seed: int, spread: float = 0.4) -> Tensor:
    """Return random multiples of 1/256, whose sums are exact in float32."""
    generator = torch.Generator().manual_seed(seed)
    return torch.round(torch.randn(shape, generator=generator) * spread * 256) / 256


def tensors(steps: int, batch: int, inputs: int, neurons: int, density: float, seed: int = 0) -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    x = torch.poisson(torch.full((steps, batch, inputs), density), generator=generator)
    return {
        "x": x,
        "w_in": grid((neurons, inputs), seed + 1),
        "bias": grid((neurons,), seed + 2, 0.05),
        "decay": torch.ones(neurons),
        "w_rec": grid((neurons, neurons), seed + 3, 0.2),
    }


def run(function: Any, rule: NeuronRule, values: dict[str, Tensor], **options: Any) -> tuple[Tensor, list[Tensor]]:
    """Return spikes, and the gradients of a weighted sum of spikes."""
    leaves = {name: value.detach().clone().requires_grad_() for name, value in values.items()}
    spikes = function(rule, **leaves, **options)
    weights = torch.randn(spikes.shape, generator=torch.Generator().manual_seed(9), dtype=spikes.dtype)
    gradients = torch.autograd.grad(
        (spikes * weights).sum(), list(leaves.values()), allow_unused=True, materialize_grads=True
    )  # in one step there is no decay and no recurrence
    return spikes.detach(), list(gradients)


def check(function, rule: NeuronRule, values: dict[str, Tensor], rtol=1e-3, part=1e-4, atol=0.0, **options) -> Tensor:
    """Compare spikes and gradients with plain autograd, to ``atol`` plus ``part`` of the largest; return the spikes."""
    spikes, gradients = run(function, rule, values, **options)
    expected, expected_gradients = run(layer_reference, rule, values)
    assert torch.equal(spikes, expected)
    for got, wanted in zip(gradients, expected_gradients, strict=True):
        torch.testing.assert_close(got, wanted, rtol=rtol, atol=atol + part * float(wanted.abs().max()))
    return spikes


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_torch_path_equals_plain_autograd_in_double_precision(rule: NeuronRule) -> None:
    values = {name: value.double() for name, value in tensors(20, 3, 6, 11, 0.5).items()}
    values["decay"] = torch.linspace(0.5, 1.0, 11).double()
    assert 0.02 < check(layer, rule, values, rtol=1e-10, part=0, atol=1e-10).mean() < 0.6


@pytest.mark.quick
@needs_kernel
@pytest.mark.parametrize("rule", RULES, ids=str)
def test_kernel_equals_plain_autograd(rule: NeuronRule) -> None:
    assert 0.02 < check(layer, rule, tensors(20, 5, 12, 40, 0.2), backend="kernel").mean() < 0.6


@needs_kernel
@pytest.mark.parametrize(
    ("steps", "batch", "inputs", "neurons", "density"),
    [
        (1, 1, 1, 1, 1.0),
        (3, 2, 5, 6, 0.0),
        (9, 9, 3, 33, 5.0),
        (30, 32, 16, 256, 0.1),
        (4, 1, 200, 300, 0.01),
        (6, 1, 60, 300, 0.05),
    ],
)
def test_kernel_takes_any_size_and_density(steps: int, batch: int, inputs: int, neurons: int, density: float) -> None:
    check(layer, NeuronRule(), tensors(steps, batch, inputs, neurons, density), atol=1e-7, backend="kernel")


@needs_kernel
@pytest.mark.parametrize("backend", ["kernel", "torch"])
def test_decays_and_layers_without_recurrence(backend: Backend) -> None:
    values = tensors(25, 4, 8, 20, 0.4)
    values["decay"] = torch.linspace(0.2, 0.99, 20)
    del values["w_rec"]
    check(layer, NeuronRule(floor=-0.5), values, backend=backend)


def test_a_kernel_that_cannot_take_a_sequence_refuses_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert torch.iinfo(torch.int32).max >= MAX_ENTRIES
    values = tensors(3, 2, 5, 6, 0.5)
    with pytest.raises(InputError, match="the kernel needs float32 on the CPU"):
        layer(NeuronRule(), **{name: value.double() for name, value in values.items()}, backend="kernel")
    monkeypatch.setattr("eskin.snn.kernels.layer.MAX_ENTRIES", 3 * 2 * 6)
    with pytest.raises(InputError, match="the kernel needs float32 on the CPU"):
        layer(NeuronRule(), **values, backend="kernel")


def test_decays_begin_where_the_configuration_says() -> None:
    fixed = {"inputs": 4, "classes": 3, "hidden": 9, "decay": 0.9, "output_decay": 0.8}
    hidden, outputs = SpikingNetwork(NetworkConfig(**fixed)).decays()
    torch.testing.assert_close(hidden, torch.full((9,), 0.9))
    learned, of_outputs = SpikingNetwork(NetworkConfig(**fixed, learn_decay=True)).decays()
    for decays in (outputs, of_outputs):
        torch.testing.assert_close(decays, torch.full((3,), 0.8))
    taus = -1 / learned.log()
    torch.testing.assert_close(taus[[0, -1]], torch.tensor([-1 / math.log(0.9), 1.0]))
    ratios = taus[1:] / taus[:-1]
    torch.testing.assert_close(ratios, ratios[:1].expand(8), rtol=1e-4, atol=0)
    quick = SpikingNetwork(NetworkConfig(**fixed | {"decay": 0.2}, learn_decay=True)).decays()[0]
    torch.testing.assert_close(quick, torch.full((9,), 0.2), msg="already faster than one step")


@pytest.mark.quick
def test_a_neuron_by_hand() -> None:
    x = torch.tensor([0.5, 0.5, 0.25, 1.5, -3.0, 1.75, 0.5]).view(-1, 1, 1)
    one, zero = torch.ones(1, 1), torch.zeros(1)
    to_zero = layer(NeuronRule(), x, one, zero, one[0]).flatten().tolist()
    assert to_zero == [0, 0, 1, 1, 0, 0, 1]  # exactly 1 does not fire; -3 is held at -1
    subtract = layer(NeuronRule(reset="subtract"), x, one, zero, one[0]).flatten().tolist()
    assert subtract == [0, 0, 1, 1, 0, 0, 1]
    free = layer(NeuronRule(floor=-10.0), x, one, zero, one[0]).flatten().tolist()
    assert free == [0, 0, 1, 1, 0, 0, 0]


def test_the_surrogate_of_the_paper_is_half_the_normal_density_and_passes_its_reset() -> None:
    rule = NeuronRule()
    assert (rule.floor, rule.reset, rule.reset_gradient) == (-1.0, "zero", True)
    assert (rule.surrogate, rule.surrogate_scale, rule.surrogate_width) == ("gaussian", 0.5, 0.5)
    v = torch.tensor([1.0, 1.5, 0.0])
    normal = torch.distributions.Normal(1.0, 0.5)
    torch.testing.assert_close(NeuronRule().slope(v), 0.5 * normal.log_prob(v).exp())


def test_the_default_network_is_that_of_the_paper() -> None:
    network = build(NetworkConfig.from_dict({"inputs": 128, "classes": 6}), seed=1)
    eye = network.w_rec @ network.w_rec.t()
    torch.testing.assert_close(eye, torch.eye(256), atol=1e-5, rtol=0)
    limit = (6 / (128 + 256)) ** 0.5
    assert 0.95 * limit < network.w_in.abs().max() <= limit
    assert [tuple(d.unique().tolist()) for d in network.decays()] == [(1.0,), (1.0,)]
    x = torch.poisson(torch.full((30, 4, 128), 0.2))
    s = layer_reference(network.config.rule, x, network.w_in, network.b_hidden, torch.ones(256), network.w_rec)
    o = layer_reference(network.config.rule, s, network.w_out, network.b_out, torch.ones(6))
    torch.testing.assert_close(network(x).logits, o.sum(0))
    assert network(x).rate == pytest.approx(float(s.detach().mean()))


@pytest.mark.parametrize(
    "variant",
    [
        {"decay": 0.9, "output_decay": 0.9, "learn_decay": True},
        {"reset": "subtract", "input_scale": 0.25},
        {"rate_weight": 1.0, "rate_limit": 0.01},
        {"readout": "membrane", "output_decay": 0.95},
        {"dropout": 0.5},
        {"weight_bits": 2},
        {"weight_bits": 8},
        {"kind": "rnn"},
        {"kind": "gru"},
        {"kind": "cnn"},
    ],
    ids=str,
)
def test_every_variant_learns_on_every_parameter(variant: dict[str, Any]) -> None:
    network = build(NetworkConfig.from_dict(dict(inputs=10, classes=3, hidden=24, **variant)), seed=0)
    output = network(torch.poisson(torch.full((25, 6, 10), 0.5), generator=torch.Generator().manual_seed(0)))
    assert output.logits.shape == (6, 3)
    (functional.cross_entropy(output.logits, torch.arange(6) % 3) + output.penalty).backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().sum() > 0 or "bias_hh" in name, name


def test_only_rates_above_the_limit_of_a_weighted_penalty_cost() -> None:
    def found(**fields: float) -> Output:
        network = build(small_network(**fields), seed=0)
        x = torch.poisson(torch.full((25, 6, 8), 2.0), generator=torch.Generator().manual_seed(0))
        output: Output = network(x)
        assert isinstance(network, SpikingNetwork)
        excess = (network.spikes(x).mean((0, 1)) - fields.get("rate_limit", 0.0)).clamp_min(0.0)
        torch.testing.assert_close(output.penalty, fields.get("rate_weight", 0.0) * excess.square().mean())
        return output

    assert found(rate_limit=0.01).penalty == 0
    assert found(rate_weight=2.0, rate_limit=0.05).penalty > 0
    assert found(rate_weight=2.0, rate_limit=1.0).penalty == 0


@pytest.mark.parametrize("fields", [{}, {"output_synapse_decay": 0.5}, {"learn_decay": True, "decay": 0.9}])
def test_the_mean_membrane_and_its_gradients_are_those_of_a_loop(fields: dict[str, Any]) -> None:
    common = {"inputs": 5, "classes": 3, "hidden": 16, "readout": "membrane", "output_decay": 0.8, "dropout": 0.5}
    network = build(NetworkConfig.from_dict(common | fields), seed=0)
    if "learn_decay" in fields:
        network.raw_output_decay.data += torch.tensor([-1.0, 0.0, 1.0])
    x = torch.poisson(torch.full((12, 2, 5), 1.0), generator=torch.Generator().manual_seed(0))
    torch.manual_seed(1)
    kept = functional.dropout(torch.ones(2, 16), 0.5)
    v, current, total = torch.zeros(2, 3), torch.zeros(2, 3), torch.zeros(2, 3)
    for spikes in network.spikes(x):
        current = fields.get("output_synapse_decay", 0.0) * current
        current = current + functional.linear(spikes * kept, network.w_out, network.b_out)
        v = network.decays()[1] * v + current
        total = total + v
    torch.manual_seed(1)
    found, learned = network(x).logits, list(network.parameters())
    torch.testing.assert_close(found, total / 12)
    expected = torch.autograd.grad((total / 12).square().sum(), learned)
    torch.testing.assert_close(torch.autograd.grad(found.square().sum(), learned), expected)


def test_building_and_running_leave_the_global_generator_alone() -> None:
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    first, second = (build(NetworkConfig.from_dict({"inputs": 4, "classes": 2}), seed=5) for _ in range(2))
    assert torch.rand(1) == expected
    for a, b in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "lstm"}, "kind must be one of spiking, rnn, gru, cnn, not 'lstm'"),
        ({"decay": 0.0}, "decay must be above 0 and at most 1, not 0.0"),
        ({"learn_decay": True}, "decay must be below 1 to be learned; give a start value such as 0.95"),
        ({"surrogate": "box"}, "surrogate must be one of gaussian, fast-sigmoid, triangle, arctan, not 'box'"),
        ({"dropout": 1.0}, "dropout must be a probability below 1, not 1.0"),
        ({"hidden": 0}, "hidden must be at least 1, not 0"),
        ({"weight_bits": 1}, "weight_bits must be 0 or in 2..8, not 1"),
        ({"weight_bits": 9}, "weight_bits must be 0 or in 2..8, not 9"),
        ({"hidden_rate": 1.0}, "hidden_rate must be from 0 to below 1 spikes per step, not 1.0"),
        (
            {"input_center": True},
            "input_center and input_offset are for the kinds rnn, gru and cnn; neurons count from 0",
        ),
        *(
            ({name: 1e300}, f"{name} must be a number of at most 3.4e+38, which float32 holds, not 1e+300")
            for name in ("output_scale", "rate_weight", "surrogate_scale", "input_rms")
        ),
    ],
)
def test_bad_networks_are_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        NetworkConfig.from_dict({"inputs": 4, "classes": 2} | fields)
    assert str(error.value) == message
