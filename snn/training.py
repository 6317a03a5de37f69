"""Settings and state of a training."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_type_hints

from torch import nn

from eskin.base.errors import InputError
from eskin.snn.adam import Adam
from eskin.snn.data.augment import AugmentConfig

LARGE_GRADIENT = 1e4
"""Norm of the gradient, before clipping, that is reported as a sign of divergence."""


_OF_WINDOWS: dict[str, Any] = {"window_steps": 0, "windows": 1, "balanced": False}
"""Defaults of the fields for long recordings."""

LARGEST_RATE = 10.0
"""Largest learning rate; the default is 1e-3, and 1e30 would train nothing in finite numbers."""

SILENT, SATURATED = 1e-4, 0.5
"""Range of the mean spikes per step and hidden neuron; outside this range, the network learns little."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig(AugmentConfig):
    """Settings of a training; the paper uses Adam 1e-3, batches of 32, and up to 500 epochs."""

    noun = ("the fields of a training", "training")

    epochs: int = 100
    batch: int = 32
    learning_rate: float = 1e-3
    weight_decay: float = 0.0
    """Decoupled (AdamW) where not zero."""
    cosine: bool = False
    """The learning rate falls to zero along half a cosine; else it is constant."""
    clip: float = 1.0
    """Largest norm of the gradient."""
    window_steps: int = 0
    """Steps of the windows drawn from the scans in every epoch; 0: whole scans."""
    windows: int = 1
    """Number of windows of each scan in an epoch, for any length of the scan."""
    balanced: bool = False
    """Every class has an equal weight in the loss, for any number of scans."""

    def __post_init__(self) -> None:
        self._check_types()
        super().__post_init__()
        for name, least in (("epochs", 1), ("batch", 1), ("windows", 1), ("window_steps", 0)):
            self._check_least(name, least)
        if not 0 < self.learning_rate <= LARGEST_RATE:
            raise InputError(
                f"learning_rate must be above 0 and at most {LARGEST_RATE:g}, not {self.learning_rate!r}: "
                f"Adam moves every weight by about that much"
            )
        if not (math.isfinite(self.clip) and self.clip > 0):
            raise InputError(f"clip must be a positive number, not {self.clip!r}")
        if not 0 <= self.weight_decay * self.learning_rate <= 1:
            raise InputError(f"weight_decay must be from 0 to 1 / learning_rate, not {self.weight_decay!r}")

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary, those of the augmentation last.

        Fields of windows are left out where they have their default, so files of trainings on whole scans stay equal.
        """
        found = {name: getattr(self, name) for name in (*type(self).__annotations__, *AugmentConfig.__annotations__)}
        return {name: value for name, value in found.items() if name not in _OF_WINDOWS or value != _OF_WINDOWS[name]}

    def rate_at(self, epoch: int) -> float:
        """Return the learning rate of an epoch, counted from 0."""
        return self.learning_rate * (0.5 * (1 + math.cos(math.pi * epoch / self.epochs)) if self.cosine else 1.0)


def parted(fields: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the fields of a network, and the fields of a training."""
    known = get_type_hints(TrainConfig)
    network = {name: value for name, value in fields.items() if name not in known}
    return network, {name: value for name, value in fields.items() if name in known}


@dataclass(frozen=True)
class Epoch:
    """Results of one epoch."""

    number: int
    """Number, from 1."""
    loss: float
    """Mean cross-entropy over the training scans, penalty included."""
    accuracy: float
    """Accuracy on the training scans during the epoch."""
    held_out: float | None
    """Accuracy on the images that were held out for selection or display."""
    rate: float
    """Mean spikes per step and hidden neuron."""
    gradient: float
    """Largest norm of the gradient before clipping."""
    silent_outputs: int = 0
    """Outputs that were 0 for all training scans: output neurons that never fired."""

    def warnings(self, spiking: bool, classes: int) -> list[str]:
        """Return warnings about signs of divergence."""
        found = []
        if self.loss > 3 * math.log(classes) and self.number > 1:
            found.append(f"the loss of {self.loss:.3g} is more than three times that of guessing")
        if self.gradient > LARGE_GRADIENT:
            found.append(f"the gradient reached a norm of {self.gradient:.3g} before clipping")
        if self.silent_outputs:
            found.append(f"output neurons never fire ({self.silent_outputs} of {classes}): try another seed or readout")
        if spiking and not SILENT <= self.rate <= SATURATED:
            state = "hardly fire" if self.rate < SILENT else "fire in most steps"
            found.append(f"the hidden neurons {state} ({self.rate:.2g} spikes per step)")
        return found


@dataclass
class Training:
    """A network in training, with the complete state of a checkpoint."""

    network: nn.Module
    optimizer: Adam
    history: list[Epoch] = field(default_factory=list)
    best: dict[str, Any] = field(default_factory=dict)
    """Epoch and predictions of the epoch with the highest held-out accuracy, the latest among equals."""


class DivergedError(InputError):
    """Raised if the loss or a weight is not finite."""
