"""Test integer networks: equal to float networks with integer weights, close to other float networks."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from eskin.base import progress
from eskin.base.errors import InputError
from eskin.model.classifier.file import IntegerWeights, weight_image
from eskin.model.classifier.network import State
from eskin.snn.exchange.integer import Precision, quantise, summary
from eskin.snn.exchange.nir_network import load_nir, to_nir
from eskin.snn.exchange.weights import Weights, save_weights
from eskin.snn.experiments.agreement import agreement, random_events
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig
from eskin.snn.rounding import grid_of, related_grids
from tests.snn.helpers import small_network


def network(seed: int = 0, step: float | None = None, **fields: Any) -> SpikingNetwork:
    """Return a network with random weights, or with random multiples of a step."""
    base = {"inputs": 6, "classes": 3, "hidden": 24, "input_scale": 0.5}
    made = build(NetworkConfig.from_dict(base | fields), seed)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, parameter in made.named_parameters():
            if step is None:
                parameter.copy_(torch.randn(parameter.shape, generator=generator) * (0.1 if "b_" in name else 0.4))
            else:
                whole = torch.randint(-100, 101, parameter.shape, generator=generator).float()
                whole.view(-1)[0] = 127
                parameter.copy_(whole * step / (made.config.input_scale if name == "w_in" else 1))
    return made


def weights_of(made: SpikingNetwork) -> Weights:
    return Weights(made, ("a", "b", "c"), 0.004)


COUNTS = np.random.default_rng(5).poisson(0.8, (4, 30, 6))


@pytest.mark.parametrize("reset", ["zero", "subtract"])
@pytest.mark.parametrize("readout", ["spikes", "membrane"])
def test_a_network_of_whole_numbers_stays_what_it_is(reset: str, readout: str) -> None:
    made = network(step=1 / 128, reset=reset, readout=readout)
    whole = quantise(weights_of(made), Precision())
    x = torch.from_numpy(COUNTS.transpose(1, 0, 2)).float()
    spikes, logits = made.eval().spikes(x).detach().numpy(), made(x).logits.detach().numpy()
    state = State(whole.network, len(COUNTS))
    for number in range(COUNTS.shape[1]):
        state.add_counts(COUNTS[:, number])
        _, fired, *_ = state.end_bin()
        assert np.array_equal(fired, spikes[number])
    assert 0.02 < spikes.mean() < 0.98
    expected = state.evidence if readout == "spikes" else state.evidence * whole.notes["output_unit"] / COUNTS.shape[1]
    assert np.allclose(logits, expected, rtol=1e-5, atol=1e-5)  # a sum near 0 of terms near 40, in float32
    assert np.array_equal(whole.network.run_counts(COUNTS)[0], state.evidence)


def test_a_bias_as_large_as_its_bits_hold_is_kept_and_a_larger_one_shifted() -> None:
    made = network(step=1 / 128)
    found = {bits: quantise(weights_of(made), Precision(bias_bits=bits)).network for bits in (9, 8, 7)}
    assert [whole.config.bias_shift for whole in found.values()] == [0, 0, 2]
    assert found[8].b_hidden.max() == 127
    assert found[8].b_hidden.tolist() == found[9].b_hidden.tolist()


def test_more_bits_make_a_smaller_error_and_steps_are_powers_of_two_of_each_other() -> None:
    made = network(1)
    errors = []
    for bits in range(2, 9):
        precision = Precision(in_bits=bits, rec_bits=bits, out_bits=bits)
        whole = quantise(weights_of(made), precision)
        errors.append(whole.notes["w_rec"]["error"])
        ratio = np.log2(whole.notes["w_in"]["step"] / whole.notes["w_rec"]["step"])
        assert ratio == round(ratio) == whole.network.config.in_shift - whole.network.config.rec_shift
        assert abs(whole.network.w_rec).max() < 2 ** (bits - 1)
        assert whole.network.config.threshold.bit_length() >= 8
        assert not whole.network.config.saturates
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.01


def test_clipping_is_chosen_where_it_makes_the_error_smaller() -> None:
    values = np.random.default_rng(0).normal(size=4000)
    top = float(np.abs(values).max())
    grid = grid_of(values, 4)
    assert grid.step < top / 7
    assert grid.error(values) < grid.__class__(top / 7, 7).error(values)
    first, second = related_grids((values[:, None], values[:, None] * 5), (4, 4))
    assert second.step / first.step in (4.0, 8.0)


def test_the_nearest_leak_is_taken_and_said() -> None:
    whole = quantise(weights_of(network(decay=0.8, output_decay=0.95, readout="membrane")), Precision())
    assert (whole.network.config.leak_shift, whole.network.config.out_leak_shift) == (2, 4)
    assert whole.notes["decay"]["hardware"] == 0.75
    fields = {"decay": 0.9, "output_decay": 0.5, "synapse_decay": 0.55}
    config = quantise(weights_of(network(**fields)), Precision(decay_bits=4)).network.config
    assert (config.leak_factor, config.leak_shift) == (1, 3)  # 0.1 is nearest to 2 / 16
    assert (config.synapse_factor, config.synapse_shift) == (7, 4)
    assert (config.out_leak_factor, config.out_leak_shift) == (1, 1)
    assert config.out_synapse_shift == 0


@pytest.mark.command("agree")
def test_published_networks_are_bit_exact_in_the_rtl(folder: Path, eskin: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the NIR paper's Braille networks in RTL, and compare the classes with the float networks."""
    monkeypatch.setattr(progress, "SILENCE_S", 0.01)
    paths = []
    for file in sorted((Path(__file__).parent / "nir_paper").glob("*.nir")):
        reset = "subtract" if "subtract" in file.name else "zero"
        paths.append(f"{reset}.npz")
        save_weights(paths[-1], load_nir(file, 1e-4, reset=reset))
    out, notes = eskin("agree", *paths, "--bits 8 --scans 64 --bins 24 --rate 0.5 --sim icarus -o out")
    assert re.search(r"^bit-exact: 2 runs, \d{4} clocks, 1\d\d events, 48 bins, 0 mismatches$", out, re.MULTILINE)
    slow = re.findall(r"^building and simulating (zero|subtract) for icarus: \d+ s so far$", notes, re.MULTILINE)
    assert set(slow) == {"zero", "subtract"}
    for network in json.loads((folder / "out" / "agreement.json").read_text())["networks"]:
        assert network["rtl"]["hidden spikes"] > 10
        assert network["rtl"]["output spikes"] > 10
        assert network["points"][0]["same"] >= 50
    eskin("agree", paths[0], "--bits 8 --scans 1 --bins 1 --rtl 0 -o new")
    assert (folder / "new" / "agreement.json").exists()


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"floor": 0.5}, "needs a floor of at most 0, but the network has 0.5"),
        ({"kind": "gru"}, "the hardware needs a spiking network, not kind gru"),
    ],
)
def test_networks_without_hardware_are_not_quantised(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        quantise(weights_of(network(**fields)), Precision())


def test_learned_decays_become_the_nearest_shift_of_each_neuron(tmp_path: Path) -> None:
    made = network(decay=0.9, output_decay=0.9, learn_decay=True)
    decays = torch.tensor([0.5, 0.74, 0.99, 0.9999] * 6), torch.tensor([0.876, 0.3, 0.97])
    with torch.no_grad():
        for parameter, values in zip((made.raw_decay, made.raw_output_decay), decays, strict=True):
            parameter.copy_(torch.logit(values))
    whole = quantise(weights_of(made), Precision())
    assert whole.network.leak.tolist() == [1, 2, 7, 0] * 6
    assert whole.network.out_leak.tolist() == [3, 1, 5]
    assert set(whole.network.threshold.tolist()) == {whole.network.config.threshold}
    assert "decay of 0.5 to 1 becomes a shift for each neuron, 0.00307 off on average" in summary(whole)
    whole.save(tmp_path / "integer.npz")
    loaded = IntegerWeights.load(tmp_path / "integer.npz").network
    assert (loaded.config, loaded.leak.tolist()) == (whole.network.config, whole.network.leak.tolist())
    with pytest.raises(InputError, match="decays of each neuron become shifts; leave --decay-bits out"):
        quantise(weights_of(made), Precision(decay_bits=4))


def test_a_network_that_has_diverged_and_an_absurd_clock_are_refused() -> None:
    made = network()
    with torch.no_grad():
        made.w_out[1, 2] = torch.inf
    with pytest.raises(InputError, match="w_out has values that are not finite; train again"):
        quantise(weights_of(made), Precision())
    for clock_hz in (1.0, 1e300, math.nan):
        with pytest.raises(InputError, match=r"^the clock must be in 1000\.\.1e\+10 hertz, not "):
            Precision(clock_hz=clock_hz)


def test_a_network_that_rounds_its_weights_learns_through_it_and_becomes_what_it_was() -> None:
    made = network(2, weight_bits=3)
    x = torch.from_numpy(COUNTS.transpose(1, 0, 2)).float()
    made(x).logits.sum().backward()
    gradient = made.w_rec.grad
    assert gradient.abs().sum() > 0
    w_in, w_rec, w_out = (matrix.detach().numpy() for matrix in made.weights())
    assert len(np.unique(w_rec)) <= 7
    whole = quantise(weights_of(made), Precision(in_bits=3, rec_bits=3, out_bits=3))
    for name, matrix, scale in (("w_in", w_in, 0.5), ("w_rec", w_rec, 1.0), ("w_out", w_out, 1.0)):
        integers = getattr(whole.network, name).T
        assert np.allclose(integers * whole.notes[name]["step"], matrix * scale, atol=1e-6)
    with pytest.raises(InputError, match="rounds its weights to 3 bits, which NIR cannot express"):
        to_nir(weights_of(made))


@pytest.mark.command("quantise")
def test_the_command_writes_the_network_and_its_images(folder: Path, eskin: Any) -> None:
    made = network(3, decay=0.8)
    save_weights(folder / "weights.npz", weights_of(made))
    out, _ = eskin("quantise weights.npz -o integer.npz --bits 4 --out-bits 6")
    assert "decay of 0.8 becomes 0.75" in out
    loaded = IntegerWeights.load(folder / "integer.npz")
    expected = quantise(weights_of(made), Precision(in_bits=4, rec_bits=4, out_bits=6, narrow=True))
    assert loaded.network.config == expected.network.config
    assert loaded.network.config.clocks_per_bin == 200_000
    lines = (folder / "integer.weights.hex").read_text().split()
    assert [int(line, 16) for line in lines] == weight_image(expected.network)
    assert (folder / "integer.neurons.hex").exists()


@pytest.mark.parametrize("own", [False, True])
def test_float_and_integer_networks_read_the_same_scans(own: bool) -> None:
    made = build(small_network(decay=0.75, output_decay=0.875, learn_decay=own), seed=1).eval()
    if own:
        made.raw_decay.data[::2] = math.log(15)  # a decay of 15 / 16
    weights = Weights(made, ("a", "b", "c"), 0.004)
    found = agreement(weights, random_events(scans=9, bins=40, inputs=8, most=1.0, seed=2), [8])
    assert (found["scans"], sum(found["classes"])) == (9, 9)
    assert found["points"][0]["same"] >= 8
    assert found["points"][0]["spikes_per_bin"] == pytest.approx(found["spikes_per_bin"], rel=0.05)
