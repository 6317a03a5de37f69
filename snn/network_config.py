"""Configuration of a network of any kind."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from eskin.base.errors import InputError
from eskin.snn.fields import NetworkFields
from eskin.snn.kernels.rule import NetworkReset, NeuronRule

Kind = Literal["spiking", "rnn", "gru", "cnn"]
OutputMode = Literal["spikes", "membrane"]

KINDS = get_args(Kind)


@dataclass(frozen=True, kw_only=True)
class NetworkConfig(NetworkFields):
    """All parameters of a network; immutable and validated. The defaults are those of the paper."""

    noun = ("the fields of a network", "network")

    inputs: int
    classes: int
    """Channels of a scan, and outputs."""
    kind: Kind = "spiking"
    """Recurrent spiking neurons, or a baseline without spikes: recurrent with ReLU units (the paper's baseline), gated,
    or 1-D convolutional."""
    hidden: int = 256
    """Neurons or units of the hidden layer."""
    input_scale: float = 1.0
    """Factor of the input."""
    input_offset: float = 0.0
    """Value subtracted from the inputs of a baseline before scaling."""
    input_rms: float = 0.0
    """If not 0, training scales the input of its scans to this root mean square."""
    input_center: bool = False
    """Training sets the offset to the mean of its scans."""
    hidden_rate: float = 0.0
    output_rate: float = 0.0
    """If not 0, training starts from biases with which every hidden neuron fires this often per step, and the mean
    input of every output neuron is this fraction of its threshold (``eskin.snn.calibration``)."""
    decay: float = 1.0
    output_decay: float = 1.0
    """Part of the membrane potential left after one step; 1 is the paper's neuron without leak."""
    synapse_decay: float = 0.0
    output_synapse_decay: float = 0.0
    """Part of the synaptic current left after one step (NIR: CubaLIF); 0 for inputs that reach the membrane at once."""
    learn_decay: bool = False
    """Every neuron learns its decays (below 1). Time constants of hidden neurons start spread from one step to that of
    ``decay``."""
    layers: tuple[int, ...] = ()
    """Sizes of the layers of a stack, whose sum is ``hidden``; none for one recurrent layer. The first layer reads the
    channels, each other one the layer before, and the outputs read the last; a layer may also read itself."""
    reset: NetworkReset = NeuronRule.reset
    reset_gradient: bool = NeuronRule.reset_gradient
    floor: float = NeuronRule.floor
    surrogate: str = NeuronRule.surrogate
    surrogate_scale: float = NeuronRule.surrogate_scale
    surrogate_width: float = NeuronRule.surrogate_width
    """Constants of every neuron, as in ``NeuronRule``."""
    readout: OutputMode = "spikes"
    """Output neurons: they fire and their spikes are added, or their membranes are averaged over time."""
    weight_bits: int = 0
    """If not 0, the network computes with weights rounded to this many bits, like ``eskin quantise``, and gradients
    pass through the rounding (straight-through)."""
    output_scale: float = 1.0
    """Factor of the input of the SoftMax."""
    dropout: float = 0.0
    """Probability with which a hidden neuron does not reach the outputs, during a whole training scan."""
    rate_weight: float = 0.0
    rate_limit: float = 0.0
    """Penalty: weight times the mean over hidden neurons of the square by which their mean spikes per step exceed the
    limit."""

    def __post_init__(self) -> None:
        fields_of(self.kind)
        self._check_types(but=("layers",))
        for name in ("inputs", "classes", "hidden"):
            self._check_least(name, 1)
        if not isinstance(self.layers, (list, tuple)) or not all(
            type(size) is int and size > 0 for size in self.layers
        ):
            raise InputError(f"layers must list numbers of neurons, not {self.layers!r}")
        object.__setattr__(self, "layers", tuple(self.layers) if len(self.layers) > 1 else ())
        if self.layers and sum(self.layers) != self.hidden:
            raise InputError(f"layers must have {self.hidden} neurons in total, not {sum(self.layers)}")
        if self.reset == "delayed" and (self.synapse_decay or self.output_synapse_decay):
            raise InputError("a delayed reset needs neurons without a synaptic current")
        for name in ("input_scale", "output_scale"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name} must be a positive number, not {getattr(self, name)!r}")
        if self.kind == "spiking" and (self.input_center or self.input_offset):
            raise InputError("input_center and input_offset are for the kinds rnn, gru and cnn; neurons count from 0")
        if not math.isfinite(self.input_offset):
            raise InputError(f"input_offset must be a number, not {self.input_offset!r}")
        if not 0 <= self.dropout < 1:
            raise InputError(f"dropout must be a probability below 1, not {self.dropout!r}")
        for name in ("decay", "output_decay"):
            value = getattr(self, name)
            if not 0 < value <= 1:
                raise InputError(f"{name} must be above 0 and at most 1, not {value!r}")
            if self.learn_decay and value == 1:
                raise InputError(f"{name} must be below 1 to be learned; give a start value such as 0.95")
        spikes = " spikes per step"
        units = {"synapse_decay": "", "output_synapse_decay": "", "hidden_rate": spikes, "output_rate": spikes}
        for name, unit in units.items():
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"{name} must be from 0 to below 1{unit}, not {getattr(self, name)!r}")
        if self.weight_bits != 0 and not 2 <= self.weight_bits <= 8:
            raise InputError(f"weight_bits must be 0 or in 2..8, not {self.weight_bits}")
        for name in ("rate_weight", "rate_limit", "input_rms"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"{name} must be a number from 0, not {getattr(self, name)!r}")
        _ = self.rule  # checks its fields

    @property
    def rule(self) -> NeuronRule:
        """Constants of every neuron; the network itself adds what a delayed reset subtracts less."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(NeuronRule)}
        return NeuronRule(**fields | {"reset": "subtract" if self.reset == "delayed" else self.reset})

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary, without ``layers`` if there is one layer."""
        fields = super().to_dict()
        return {name: value for name, value in fields.items() if name != "layers" or value}

    @classmethod
    def from_dict(cls, fields: Any) -> NetworkConfig:
        """Return the network configuration for a dictionary; fields of other kinds are ignored.

        Raise InputError if a field is unknown, has the wrong type, or is out of range.
        """
        cls._check_dict(fields)
        if missing := [name for name in ("inputs", "classes") if name not in fields]:
            raise InputError(f"the fields of a network need {missing[0]}")
        known = [*fields_of(fields.get("kind", "spiking")), *BASELINE]
        return cls(**{name: fields[name] for name in known if name in fields})


FIELDS = tuple(field.name for field in dataclasses.fields(NetworkConfig))
"""Names of the fields, in the order of the files."""

BASELINE = ("input_offset", "input_center")
SPIKING = (*FIELDS[FIELDS.index("hidden_rate") : FIELDS.index("output_scale")], "rate_weight", "rate_limit")
"""Fields of baselines, and fields of spiking networks."""


def fields_of(kind: Any) -> list[str]:
    """Return the names of the fields that have an effect on a kind of network; raise InputError for another kind."""
    if kind not in KINDS:
        raise InputError(f"kind must be one of {', '.join(KINDS)}, not {kind!r}")
    return [name for name in FIELDS if name not in (BASELINE if kind == "spiking" else SPIKING)]
