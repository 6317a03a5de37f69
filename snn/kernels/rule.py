"""Constants of a neuron, and the surrogate derivative of its spike."""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError

NeuronReset = Literal["zero", "subtract"]
NetworkReset = Literal["zero", "subtract", "delayed"]
"""Resets of a network; a delayed reset subtracts the threshold one step later, after the leak, as snnTorch does."""

SURROGATES = ("gaussian", "fast-sigmoid", "triangle", "arctan")
"""Shapes of the derivative, in the order of the switch in cpu.cpp."""


@dataclass(frozen=True, kw_only=True)
class NeuronRule(Configuration):
    """Constants of a neuron with threshold 1."""

    floor: float = -1.0
    """v is held above it (paper's network: -1); minus infinity for none."""
    reset: NeuronReset = "zero"
    reset_gradient: bool = True
    """The gradient also flows through the spike that resets, as in the rule as written; else that spike counts as a
    constant, and with reset by subtraction gradients become large (docs/guide/classifier.md)."""
    surrogate: str = "gaussian"
    """Shape f of the derivative of a spike, scale / width * f((v - 1) / width): gaussian (normal density), fast-sigmoid
    1 / (1 + |d|)**2, triangle max(0, 1 - |d|), arctan 1 / (1 + d**2)."""
    surrogate_scale: float = 0.5
    surrogate_width: float = 0.5
    """Paper's network: 0.5 times the normal density with sigma 0.5."""

    def __post_init__(self) -> None:
        self._check_types()
        if self.surrogate not in SURROGATES:
            raise InputError(f"surrogate must be one of {', '.join(SURROGATES)}, not {self.surrogate!r}")
        if not self.floor < 1:
            raise InputError(f"floor must be below the threshold of 1, not {self.floor!r}")
        for name in ("surrogate_scale", "surrogate_width"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number, not {value!r}")

    def slope(self, v: Tensor) -> Tensor:
        """Return the surrogate derivative ds/dv, in the shape of v."""
        d = (v - 1.0) / self.surrogate_width
        if self.surrogate == "gaussian":
            shape = torch.exp(-0.5 * d * d) / math.sqrt(2 * math.pi)
        elif self.surrogate == "fast-sigmoid":
            shape = (1.0 + d.abs()) ** -2
        elif self.surrogate == "triangle":
            shape = (1.0 - d.abs()).clamp_min(0.0)
        else:
            shape = 1.0 / (1.0 + d * d)
        return shape * (self.surrogate_scale / self.surrogate_width)
