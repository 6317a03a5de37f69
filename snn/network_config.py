"""Configuration of a network: common fields, and fields of its kind.

In files and on the command line their fields are one flat list (``NetworkConfig.to_dict``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from eskin.base.errors import InputError
from eskin.snn.flat import flatten, hints_of, refuse_unknown, takes_flat_fields, unflatten
from eskin.snn.kernels.rule import NeuronRule

BaselineKind = Literal["rnn", "gru", "cnn"]
OutputMode = Literal["spikes", "membrane"]

KINDS = ("spiking", *get_args(BaselineKind))


@dataclass(frozen=True, kw_only=True)
class SpikingConfig:
    """Parameters of recurrent spiking neurons and output neurons; the defaults are those of the paper."""

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
    """Every neuron learns its decays, starting from the given values (below 1)."""
    rule: NeuronRule = field(default_factory=NeuronRule)
    readout: OutputMode = "spikes"
    """Output neurons: they fire and their spikes are added, or their membranes are averaged over time."""
    weight_bits: int = 0
    """If not 0, the network computes with weights rounded to this many bits, like ``eskin quantise``, and gradients
    pass through the rounding (straight-through)."""
    rate_weight: float = 0.0
    rate_limit: float = 0.0
    """Penalty: weight times the mean over hidden neurons of the square by which their mean spikes per step exceed the
    limit."""

    def __post_init__(self) -> None:
        if self.readout not in get_args(OutputMode):
            raise InputError(f"readout must be one of {', '.join(get_args(OutputMode))}, not {self.readout!r}")
        for name in ("decay", "output_decay"):
            value = getattr(self, name)
            if not 0 < value <= 1:
                raise InputError(f"{name} must be above 0 and at most 1, not {value!r}")
            if self.learn_decay and value == 1:
                raise InputError(f"{name} must be below 1 to be learned; give a start value such as 0.95")
        for name in ("synapse_decay", "output_synapse_decay"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"{name} must be from 0 to below 1, not {getattr(self, name)!r}")
        for name in ("hidden_rate", "output_rate"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"{name} must be from 0 to below 1 spikes per step, not {getattr(self, name)!r}")
        if self.weight_bits != 0 and not 2 <= self.weight_bits <= 8:
            raise InputError(f"weight_bits must be 0 or in 2..8, not {self.weight_bits}")
        _from_zero(self, "rate_weight", "rate_limit")


@dataclass(frozen=True, kw_only=True)
class BaselineConfig:
    """Parameters of a network without spikes."""

    kind: BaselineKind = "rnn"
    """Recurrent with ReLU units (the paper's baseline), gated, or 1-D convolutional."""
    input_offset: float = 0.0
    """Value subtracted from the inputs before scaling."""
    input_center: bool = False
    """Training sets the offset to the mean of its scans."""

    def __post_init__(self) -> None:
        if self.kind not in get_args(BaselineKind):
            raise InputError(f"kind must be one of {', '.join(KINDS)}, not {self.kind!r}")
        if not math.isfinite(self.input_offset):
            raise InputError(f"input_offset must be a number, not {self.input_offset!r}")


@takes_flat_fields
@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """All parameters of a network; immutable and validated.

    Fields of the units may stand beside the others: ``NetworkConfig(inputs=64, classes=6, decay=0.9)``.
    """

    inputs: int
    classes: int
    """Channels of a scan, and outputs."""
    hidden: int = 256
    """Neurons or units of the hidden layer."""
    input_scale: float = 1.0
    """Factor of the input."""
    input_rms: float = 0.0
    """If not 0, training scales the input of its scans to this root mean square."""
    output_scale: float = 1.0
    """Factor of the input of the SoftMax."""
    dropout: float = 0.0
    """Probability with which a hidden neuron does not reach the outputs, during a whole training scan."""
    units: SpikingConfig | BaselineConfig = field(default_factory=SpikingConfig)
    """Configuration of the network's kind."""

    def __post_init__(self) -> None:
        for name in ("inputs", "classes", "hidden"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("input_scale", "output_scale"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name} must be a positive number, not {getattr(self, name)!r}")
        if not 0 <= self.dropout < 1:
            raise InputError(f"dropout must be a probability below 1, not {self.dropout!r}")
        _from_zero(self, "input_rms")

    @property
    def kind(self) -> str:
        """Kind of the network: "spiking", or the kind of a baseline."""
        return self.units.kind if isinstance(self.units, BaselineConfig) else "spiking"

    @property
    def neurons(self) -> SpikingConfig:
        """Neuron rule of a spiking network."""
        assert isinstance(self.units, SpikingConfig)
        return self.units

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as one flat dictionary."""
        other = SpikingConfig() if isinstance(self.units, BaselineConfig) else BaselineConfig()
        found = flatten(other) | flatten(self) | {"kind": self.kind}
        return {name: found[name] for name in FIELDS}

    @classmethod
    def from_dict(cls, fields: Any) -> NetworkConfig:
        """Return the network configuration for flat fields; fields of other kinds are ignored.

        Raise InputError if a field is unknown, has the wrong type, or is out of range.
        """
        refuse_unknown(fields, FIELDS, "network")
        if missing := [name for name in ("inputs", "classes") if name not in fields]:
            raise InputError(f"the fields of a network need {missing[0]}")
        kind = fields.get("kind", "spiking")
        if kind not in KINDS:
            raise InputError(f"kind must be one of {', '.join(KINDS)}, not {kind!r}")
        units: SpikingConfig | BaselineConfig
        if kind == "spiking":
            if fields.get("input_center") or fields.get("input_offset"):
                raise InputError(
                    "input_center and input_offset are for the kinds rnn, gru and cnn; neurons count from 0"
                )
            units = unflatten(SpikingConfig, fields)
        else:
            units = unflatten(BaselineConfig, fields)
        return unflatten(cls, fields | {"units": units})


def _from_zero(config: Any, *names: str) -> None:
    for name in names:
        if not (math.isfinite(getattr(config, name)) and getattr(config, name) >= 0):
            raise InputError(f"{name} must be a number from 0, not {getattr(config, name)!r}")


FIELDS = (
    *("inputs", "classes", "kind", "hidden", "input_scale", "input_offset", "input_rms", "input_center"),
    *("hidden_rate", "output_rate", "decay", "output_decay", "synapse_decay", "output_synapse_decay"),
    "learn_decay",
    *("reset", "reset_gradient", "floor", "surrogate", "surrogate_scale", "surrogate_width"),
    *("readout", "weight_bits", "output_scale", "dropout", "rate_weight", "rate_limit"),
)
"""Names of the flat fields, in the order of the files."""

HINTS = {**hints_of(NetworkConfig), **hints_of(SpikingConfig), **hints_of(BaselineConfig), "kind": Literal[KINDS]}
HINTS = {name: HINTS[name] for name in FIELDS}
"""Types of the flat fields."""
