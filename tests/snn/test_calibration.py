"""Test the calibration of a network before training."""

import pytest
import torch

from eskin.snn.calibration import calibrate
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig


def scans(seed: int = 0, rate: float = 2.0) -> torch.Tensor:
    """Return counts with different rates per channel, shape (60, 24, 16)."""
    generator = torch.Generator().manual_seed(seed)
    rates = torch.rand(16, generator=generator) * 2 * rate
    return torch.poisson(rates.expand(60, 24, 16), generator=generator)


def spiking(seed: int = 2, **fields: float) -> SpikingNetwork:
    return build(NetworkConfig.from_dict(dict(inputs=16, classes=6, hidden=64, **fields)), seed)


def test_without_the_fields_nothing_changes() -> None:
    network, untouched = spiking(), spiking()
    calibrate(network, scans())
    assert network.config == untouched.config
    assert all(torch.equal(a, b) for a, b in zip(network.parameters(), untouched.parameters(), strict=True))


def test_counts_come_in_with_the_root_mean_square_asked_for() -> None:
    network, counts = spiking(input_rms=3.0), scans()
    calibrate(network, torch.zeros(5, 2, 16))
    assert network.config.input_scale == 1.0, "scans without events"
    calibrate(network, counts)
    size = (counts * network.config.input_scale).square().mean().sqrt()
    assert float(size) == pytest.approx(3.0, rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_neurons_start_near_the_rates_asked_for(seed: int) -> None:
    counts = scans(seed)
    before = spiking(seed).spikes(counts).detach().mean((0, 1))
    assert float((before < 0.01).float().mean()) > 0.15, "without it many neurons hardly fire"
    network = spiking(seed, input_rms=3.0, hidden_rate=0.1, output_rate=0.1)
    calibrate(network, counts)
    rates = network.spikes(counts).detach().mean((0, 1))
    assert float(rates.min()) > 0.02
    assert float(rates.mean()) == pytest.approx(0.1, abs=0.06)
    assert torch.allclose(rates @ network.w_out.t() + network.b_out, torch.full((6,), 0.1), atol=1e-5)
    assert bool((network(counts).logits.mean(0) > 0).all()), "all outputs fire"


def test_frames_are_centred_and_scaled() -> None:
    network = build(
        NetworkConfig.from_dict({"inputs": 16, "classes": 6, "kind": "rnn", "input_rms": 1.0, "input_center": True}), 0
    )
    frames = 0.4 + 0.1 * torch.randn(50, 8, 16, generator=torch.Generator().manual_seed(1))
    calibrate(network, frames)
    config = network.config
    entering = (frames - config.to_dict()["input_offset"]) * config.input_scale
    assert float(entering.mean()) == pytest.approx(0.0, abs=1e-4)
    assert float(entering.std()) == pytest.approx(1.0, rel=1e-3)
