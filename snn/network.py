"""The networks: the paper's recurrent spiking network with variants, and non-spiking baselines.

Every network takes a tensor of shape (steps, scans, channels) and returns an ``Output``. A variant is a value in
``NetworkConfig``, whose defaults are the paper's network (docs/guide/classifier.md).
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from eskin.base.errors import InputError
from eskin.snn.kernels.layer import Backend, layer
from eskin.snn.network_config import NetworkConfig
from eskin.snn.rounding import rounded_weights


class Output(NamedTuple):
    """Output of a network for a batch."""

    logits: Tensor
    """Input of the SoftMax. Shape (scans, classes)."""
    penalty: Tensor
    """Penalty, added to the loss. Shape ()."""
    rate: float
    """Mean spikes per step and hidden neuron; 0 for a baseline."""


def build(config: NetworkConfig, seed: int, backend: Backend = "auto") -> nn.Module:
    """Return a network with weights initialised from a seed.

    Raise MemoryError if the network is too large.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        try:
            if config.kind == "spiking":
                return SpikingNetwork(config, backend)
            return ConvolutionalNetwork(config) if config.kind == "cnn" else RecurrentBaseline(config)
        except RuntimeError:  # torch cannot allocate the tensors
            raise MemoryError(f"a network with hidden={config.hidden} is too large; use fewer") from None


class SpikingNetwork(nn.Module):
    """Recurrent integrate-and-fire neurons and one output neuron per class (paper, section II-D, Fig. 8).

    W_rec starts orthogonal, the other weights Xavier-uniform, biases zero.

    Attributes
    ----------
    w_in, w_rec, w_out : shapes (hidden, inputs), (hidden, hidden), (classes, hidden)
    b_hidden, b_out : shapes (hidden,), (classes,)
    raw_decay, raw_output_decay : shapes (hidden,), (classes,)
        Learned decays before the logistic function; buffers of the constant decays where none are learned.
    """

    raw_decay: Tensor
    raw_output_decay: Tensor

    def __init__(self, config: NetworkConfig, backend: Backend = "auto") -> None:
        super().__init__()
        self.config, self.backend = config, backend
        self.w_in = nn.Parameter(nn.init.xavier_uniform_(torch.empty(config.hidden, config.inputs)))
        self.w_rec = nn.Parameter(nn.init.orthogonal_(torch.empty(config.hidden, config.hidden)))
        self.w_out = nn.Parameter(nn.init.xavier_uniform_(torch.empty(config.classes, config.hidden)))
        self.b_hidden = nn.Parameter(torch.zeros(config.hidden))
        self.b_out = nn.Parameter(torch.zeros(config.classes))
        for name, size, value in (
            ("raw_decay", config.hidden, config.decay),
            ("raw_output_decay", config.classes, config.output_decay),
        ):
            if config.learn_decay:
                fastest = 1.0 if name == "raw_decay" else math.inf
                setattr(self, name, nn.Parameter(_first_decays(size, value, fastest)))
            else:
                self.register_buffer(name, torch.full((size,), value), persistent=False)
        if config.layers:
            with torch.no_grad():
                for matrix, exists in zip((self.w_in, self.w_rec, self.w_out), connections(config), strict=True):
                    matrix.mul_(exists)

    def decays(self) -> tuple[Tensor, Tensor]:
        """Return the decays of hidden and output neurons, shapes (hidden,) and (classes,)."""
        if self.config.learn_decay:
            return torch.sigmoid(self.raw_decay), torch.sigmoid(self.raw_output_decay)
        return self.raw_decay, self.raw_output_decay

    def weights(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return w_in, w_rec and w_out, rounded if ``weight_bits`` is set."""
        bits, scale = self.config.weight_bits, self.config.input_scale
        if not bits:
            return self.w_in, self.w_rec, self.w_out
        w_in, w_rec, w_out = rounded_weights((self.w_in * scale, self.w_rec, self.w_out), bits)
        return w_in / scale, w_rec, w_out

    def spikes(self, x: Tensor) -> Tensor:
        """Return the hidden spikes, shape (steps, scans, hidden), without a delay between the layers of a stack."""
        w_in, w_rec, _ = self.weights()
        return self._hidden(x, w_in, w_rec)

    def _hidden(self, x: Tensor, w_in: Tensor, w_rec: Tensor) -> Tensor:
        decay, _ = self.decays()
        x, config = _scaled(self.config, x), self.config
        late = self._late(decay)
        w_rec = w_rec if late is None else w_rec + late
        found: list[Tensor] = []
        before, start = slice(0), 0
        for size in config.layers or (config.hidden,):
            own = slice(start, start + size)
            w = w_rec[own, before] if found else w_in[own]
            constants = self.b_hidden[own], decay[own], w_rec[own, own]
            x = layer(config.rule, x, w, *constants, self.backend, config.synapse_decay)
            found.append(x)
            before, start = own, own.stop
        return torch.cat(found, 2) if config.layers else x

    def _late(self, decay: Tensor) -> Tensor | None:
        """Return the recurrent weights that make a reset by subtraction a delayed one, or None for another reset.

        A delayed reset subtracts the threshold 1 after the leak: decay * v - 1 = decay * (v - 1) - (1 - decay).
        """
        return torch.diag(decay - 1) if self.config.reset == "delayed" else None

    def forward(self, x: Tensor) -> Output:
        """Return logits, penalty and spike rate for scans of shape (steps, scans, inputs)."""
        config = self.config
        w_in, w_rec, w_out = self.weights()
        s = self._hidden(x, w_in, w_rec)
        penalty = s.new_zeros(())
        if config.rate_weight:
            excess = (s.mean((0, 1)) - config.rate_limit).clamp_min(0.0)
            penalty = config.rate_weight * excess.square().mean()
        rate = float(s.detach().mean())
        if config.layers:
            s, w_out = s[..., -config.layers[-1] :], w_out[:, -config.layers[-1] :]
        kept = s.new_ones(s.shape[1:])
        if config.dropout and self.training:
            kept = functional.dropout(kept, config.dropout)
        if config.readout == "spikes":
            s = s * kept if config.dropout and self.training else s
            _, decay = self.decays()
            currents = config.output_synapse_decay
            out = layer(config.rule, s, w_out, self.b_out, decay, self._late(decay), self.backend, currents).sum(0)
        else:
            out = self._mean_membrane(s, kept, w_out)
        return Output(out * config.output_scale, penalty, rate)

    def _mean_membrane(self, s: Tensor, kept: Tensor, w_out: Tensor) -> Tensor:
        """Return the mean over time of leaky membranes, v <- decay v + current, shape (scans, classes).

        A current counts in all later steps, with weights that depend on time alone. The spikes ``s`` (steps, scans,
        hidden) are therefore summed over time before the product with ``w_out``; ``kept`` has their factors.
        """
        _, decay = self.decays()
        different = decay if self.config.learn_decay else decay[:1]
        powers = different ** torch.arange(len(s), device=s.device)[:, None]
        reach = synaptic(torch.cumsum(powers, 0), self.config.output_synapse_decay).flip(0) / len(s)
        summed = torch.mm(reach.t(), s.reshape(len(s), -1)).view(-1, *s.shape[1:]) * kept
        if len(summed) == 1:
            return functional.linear(summed[0], w_out) + self.b_out * reach.sum(0)
        return torch.einsum("obh,oh->bo", summed, w_out) + self.b_out * reach.sum(0)


def _first_decays(size: int, decay: float, fastest: float) -> Tensor:
    """Return the first decays of neurons that learn them, before the logistic function, shape (size,).

    The time constants are evenly spread, on a logarithmic scale, from that of the given decay down to ``fastest`` steps
    (N. Perez-Nieves et al., Nature Communications 12:5791, 2021).
    """
    slowest = -1 / math.log(decay)
    taus = torch.logspace(math.log10(slowest), math.log10(min(slowest, fastest)), size, dtype=torch.float64)
    return torch.logit(torch.exp(-1 / taus)).float()


def connections(config: NetworkConfig) -> tuple[Tensor, Tensor, Tensor]:
    """Return 1 for each weight of w_in, w_rec and w_out that a network has, and 0 for others."""
    ahead = layers_ahead(config)
    return ahead[:, :1] == 0, (ahead == 0) | (ahead == 1), ahead[-1] == 0


def layers_ahead(config: NetworkConfig) -> Tensor:
    """Return by how many layers each hidden neuron is ahead of each other one, shape (hidden, hidden)."""
    sizes = config.layers or (config.hidden,)
    number = torch.repeat_interleave(torch.arange(len(sizes)), torch.tensor(sizes))
    return number[:, None] - number


def synaptic(currents: Tensor, decay: float) -> Tensor:
    """Return the synaptic currents of all steps."""
    if not decay:
        return currents
    found = [currents[0]]
    for current in currents[1:].unbind():
        found.append(current + decay * found[-1])
    return torch.stack(found)


class RecurrentBaseline(nn.Module):
    """Baseline: one layer of recurrent ReLU or gated units, with a linear read-out averaged over time."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        if config.kind == "gru":
            self.units: nn.RNNBase = nn.GRU(config.inputs, config.hidden)
        else:
            self.units = nn.RNN(config.inputs, config.hidden, nonlinearity="relu")
        for name, parameter in self.units.named_parameters():
            if name.startswith("bias"):
                nn.init.zeros_(parameter)
            elif name.startswith("weight_hh"):
                for gate in parameter.split(config.hidden):
                    nn.init.orthogonal_(gate)
            else:
                nn.init.xavier_uniform_(parameter)
        self.out = nn.Linear(config.hidden, config.classes)
        nn.init.xavier_uniform_(self.out.weight)

    def forward(self, x: Tensor) -> Output:
        """Return logits for scans of shape (steps, scans, inputs)."""
        states, _ = self.units(_scaled(self.config, x))
        mean = functional.dropout(states.mean(0), self.config.dropout, self.training)
        return Output(self.out(mean) * self.config.output_scale, x.new_zeros(()), 0.0)


class ConvolutionalNetwork(nn.Module):
    """Baseline: three convolutions over time, then a mean over time and a linear read-out."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        width = max(config.hidden // 4, 1)
        layers: list[nn.Module] = []
        for inputs, outputs in ((config.inputs, width), (width, width), (width, config.hidden)):
            layers += [nn.Conv1d(inputs, outputs, 5, padding=2), nn.GroupNorm(1, outputs), nn.ReLU()]
        self.layers = nn.Sequential(*layers)
        self.out = nn.Linear(config.hidden, config.classes)

    def forward(self, x: Tensor) -> Output:
        """Return logits for scans of shape (steps, scans, inputs)."""
        features = self.layers(_scaled(self.config, x).permute(1, 2, 0)).mean(2)
        features = functional.dropout(features, self.config.dropout, self.training)
        return Output(self.out(features) * self.config.output_scale, x.new_zeros(()), 0.0)


def _scaled(config: NetworkConfig, x: Tensor) -> Tensor:
    """Return the scaled input; raise InputError for a wrong number of channels."""
    if x.ndim != 3 or x.shape[2] != config.inputs:
        raise InputError(
            f"the network has {config.inputs} input channels, but the scans have {x.shape[-1]}; "
            f"use scans with the same array, encoding and time step"
        )
    if config.input_offset:
        x = x - config.input_offset
    return x if config.input_scale == 1 else x * config.input_scale
