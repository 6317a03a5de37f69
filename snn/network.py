"""The networks: the paper's recurrent spiking network with its variants, and baselines for frames.

Every network takes a tensor of shape (steps, scans, channels) and returns an ``Output``. A variant is a value in
``NetworkConfig``, whose defaults are the paper's network (docs/guide/classifier.md).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import torch
from torch import Tensor, nn
from torch.nn import functional

from model.errors import InputError
from snn.kernels.layer import Backend, layer
from snn.kernels.rule import NeuronReset, NeuronRule

Kind = Literal["spiking", "rnn", "gru", "cnn"]
OutputMode = Literal["spikes", "membrane"]


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """All parameters of a network. Immutable, validated on construction.

    Parameters
    ----------
    inputs, classes : int
        Channels of a scan, and outputs.
    kind : "spiking", "rnn", "gru" or "cnn"
        Spiking; or, for frames, recurrent with ReLU units (the paper's baseline), gated, or 1-D convolutional.
    hidden : int
        Neurons or units of the hidden layer.
    input_scale, input_offset : float
        The offset is taken off what comes in, and the rest is multiplied by the scale.
    input_rms : float
        Where not 0, training sets the scale such that its scans come in with this root mean square.
    input_center : bool
        Training sets the offset to the mean of its scans; for frames, counts stay sparse.
    hidden_rate, output_rate : float
        Where not 0, training starts from biases with which every hidden neuron fires this often per step, and every
        output neuron is driven by this much of its threshold (``snn.calibration``).
    decay, output_decay : float
        Part of the membrane potential left after one step; 1 is the paper's neuron without leak.
    learn_decay : bool
        Every neuron learns its decays, from those values on (below 1).
    reset, reset_gradient, floor, surrogate, surrogate_scale, surrogate_width
        See ``NeuronRule``.
    readout : "spikes" or "membrane"
        The outputs fire and their spikes are added up; or their membranes do not fire and are averaged over time.
    output_scale : float
        What enters the SoftMax is multiplied by it.
    dropout : float
        Probability with which a hidden neuron does not reach the outputs, during a whole training scan.
    rate_weight, rate_limit : float
        Penalty: weight times the mean over hidden neurons of the square by which their mean spikes per step
        exceed the limit.
    """

    inputs: int
    classes: int
    kind: Kind = "spiking"
    hidden: int = 256
    input_scale: float = 1.0
    input_offset: float = 0.0
    input_rms: float = 0.0
    input_center: bool = False
    hidden_rate: float = 0.0
    output_rate: float = 0.0
    decay: float = 1.0
    output_decay: float = 1.0
    learn_decay: bool = False
    reset: NeuronReset = "zero"
    reset_gradient: bool = True
    floor: float = -1.0
    surrogate: str = "gaussian"
    surrogate_scale: float = 0.5
    surrogate_width: float = 0.5
    readout: OutputMode = "spikes"
    output_scale: float = 1.0
    dropout: float = 0.0
    rate_weight: float = 0.0
    rate_limit: float = 0.0

    def __post_init__(self) -> None:
        for name in ("inputs", "classes", "hidden"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name, choices in (("kind", get_args(Kind)), ("readout", get_args(OutputMode))):
            if getattr(self, name) not in choices:
                raise InputError(f"{name} must be one of {', '.join(choices)}, not {getattr(self, name)!r}")
        for name in ("input_scale", "output_scale"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name} must be a positive number, not {getattr(self, name)!r}")
        for name in ("decay", "output_decay"):
            value = getattr(self, name)
            if not 0 < value <= 1:
                raise InputError(f"{name} must be above 0 and at most 1, not {value!r}")
            if self.learn_decay and value == 1:
                raise InputError(f"{name} must be below 1 to be learned; give a start value such as 0.95")
        if not 0 <= self.dropout < 1:
            raise InputError(f"dropout must be a probability below 1, not {self.dropout!r}")
        if not math.isfinite(self.input_offset):
            raise InputError(f"input_offset must be a number, not {self.input_offset!r}")
        if self.kind == "spiking" and (self.input_center or self.input_offset):
            raise InputError("input_center and input_offset are for frames; spikes are counted from 0")
        for name in ("hidden_rate", "output_rate"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"{name} must be from 0 to below 1 spikes per step, not {getattr(self, name)!r}")
        for name in ("rate_weight", "rate_limit", "input_rms"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"{name} must be a number from 0, not {getattr(self, name)!r}")
        self.rule  # noqa: B018  # its fields are checked on construction

    @property
    def rule(self) -> NeuronRule:
        """The neurons' constants."""
        return NeuronRule(
            floor=self.floor,
            reset=self.reset,
            reset_gradient=self.reset_gradient,
            surrogate=self.surrogate,
            surrogate_scale=self.surrogate_scale,
            surrogate_width=self.surrogate_width,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a plain dictionary."""
        return dataclasses.asdict(self)


class Output(NamedTuple):
    """What a network says about a batch.

    Attributes
    ----------
    logits : shape (scans, classes)
        Go into the SoftMax.
    penalty : shape ()
        To be added to the loss.
    rate : float
        Mean spikes per step and hidden neuron; of the baselines 0.
    """

    logits: Tensor
    penalty: Tensor
    rate: float


def build(config: NetworkConfig, seed: int, backend: Backend = "auto") -> nn.Module:
    """Return a network with weights drawn from a seed; the global generator is left as it was.

    Raises
    ------
    MemoryError
        If the network is too large.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        try:
            if config.kind == "spiking":
                return SpikingNetwork(config, backend)
            return ConvolutionalNetwork(config) if config.kind == "cnn" else RecurrentBaseline(config)
        except RuntimeError:  # torch cannot hold its tensors
            raise MemoryError(f"a network with hidden={config.hidden} is too large; take fewer") from None


class SpikingNetwork(nn.Module):
    """Recurrent integrate-and-fire neurons, then one output neuron per class (paper, section II-D, Fig. 8).

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
                setattr(self, name, nn.Parameter(torch.full((size,), math.log(value / (1 - value)))))
            else:
                self.register_buffer(name, torch.full((size,), value), persistent=False)

    def decays(self) -> tuple[Tensor, Tensor]:
        """Return the decays of hidden and output neurons, shapes (hidden,) and (classes,)."""
        if self.config.learn_decay:
            return torch.sigmoid(self.raw_decay), torch.sigmoid(self.raw_output_decay)
        return self.raw_decay, self.raw_output_decay

    def spikes(self, x: Tensor) -> Tensor:
        """Return the hidden spikes, shape (steps, scans, hidden)."""
        x = _scaled(self.config, x)
        decay, _ = self.decays()
        return layer(self.config.rule, x, self.w_in, self.b_hidden, decay, self.w_rec, self.backend)

    def forward(self, x: Tensor) -> Output:
        """Return logits, penalty and rate for scans of shape (steps, scans, inputs)."""
        config = self.config
        s = self.spikes(x)
        penalty = s.new_zeros(())
        if config.rate_weight:
            excess = (s.mean((0, 1)) - config.rate_limit).clamp_min(0.0)
            penalty = config.rate_weight * excess.square().mean()
        rate = float(s.detach().mean())
        if config.dropout and self.training:
            s = s * functional.dropout(s.new_ones(s.shape[1:]), config.dropout)
        _, decay = self.decays()
        if config.readout == "spikes":
            out = layer(config.rule, s, self.w_out, self.b_out, decay, None, self.backend).sum(0)
        else:
            out = self._mean_membrane(functional.linear(s, self.w_out, self.b_out), decay)
        return Output(out * config.output_scale, penalty, rate)

    @staticmethod
    def _mean_membrane(current: Tensor, decay: Tensor) -> Tensor:
        """Return the mean over time of v <- decay v + current: every current counts for all steps behind it."""
        left = torch.arange(len(current) - 1, -1, -1, device=current.device)  # steps behind each step
        powers = torch.cumsum(decay[None, :] ** torch.arange(len(current), device=current.device)[:, None], 0)
        return torch.einsum("tbo,to->bo", current, powers[left]) / len(current)


class RecurrentBaseline(nn.Module):
    """One layer of ReLU or gated units on frames; a linear read-out of every step, averaged over the steps."""

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
        """Return logits for frames of shape (steps, scans, inputs)."""
        states, _ = self.units(_scaled(self.config, x))
        mean = functional.dropout(states.mean(0), self.config.dropout, self.training)
        return Output(self.out(mean) * self.config.output_scale, x.new_zeros(()), 0.0)


class ConvolutionalNetwork(nn.Module):
    """Three convolutions over time on frames, then the mean over time and a linear read-out."""

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
        """Return logits for frames of shape (steps, scans, inputs)."""
        features = self.layers(_scaled(self.config, x).permute(1, 2, 0)).mean(2)
        features = functional.dropout(features, self.config.dropout, self.training)
        return Output(self.out(features) * self.config.output_scale, x.new_zeros(()), 0.0)


def _scaled(config: NetworkConfig, x: Tensor) -> Tensor:
    """Return the scaled input, or raise InputError if it has another number of channels."""
    if x.ndim != 3 or x.shape[2] != config.inputs:
        raise InputError(
            f"the network takes {config.inputs} channels, the scans have {x.shape[-1]}; "
            f"they come from another array, encoding or time step"
        )
    if config.input_offset:
        x = x - config.input_offset
    return x if config.input_scale == 1 else x * config.input_scale
