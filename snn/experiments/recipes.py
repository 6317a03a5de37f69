"""Named sets of fields of NetworkConfig and TrainConfig, for ``--recipe`` (docs/guide/classifier.md)."""

from __future__ import annotations

import math
from typing import Any

BASELINES = ("rnn", "gru", "cnn")
"""Recipes that are made for frames."""

_FRAMES: dict[str, Any] = {"input_rms": 1.0, "input_center": True, "cosine": True, "shift_steps": 10}

RECIPES: dict[str, dict[str, Any]] = {
    "plain": {},
    "paper": {
        "input_rms": 3.0,
        "hidden_rate": 0.1,
        "output_rate": 0.1,
        "output_scale": 0.1,
        "cosine": True,
        "shift_steps": 10,
    },
    "tuned": {
        "input_rms": 2.0,
        "decay": 0.8,
        "output_decay": 0.95,
        "readout": "membrane",
        "dropout": 0.3,
        "weight_decay": 0.01,
        "cosine": True,
        "shift_steps": 10,
    },
    "portable": {
        "input_rms": 2.0,
        "hidden_rate": 0.1,
        "output_rate": 0.1,
        "decay": 0.5,
        "output_decay": 0.75,
        "floor": -math.inf,
        "output_scale": 0.1,
        "dropout": 0.3,
        "cosine": True,
        "shift_steps": 10,
    },
    "hardware": {
        "input_rms": 2.0,
        "decay": 0.75,
        "output_decay": 0.9375,
        "readout": "membrane",
        "dropout": 0.3,
        "weight_decay": 0.01,
        "cosine": True,
        "shift_steps": 10,
    },
    "rnn": {"kind": "rnn", **_FRAMES},
    "gru": {"kind": "gru", "dropout": 0.3, "weight_decay": 0.01, **_FRAMES},
    "cnn": {"kind": "cnn", "dropout": 0.3, "weight_decay": 0.01, **_FRAMES},
}
"""Fields of NetworkConfig and TrainConfig by name of the recipe: the paper's network without and with what helps its
training; a leaky variant whose outputs do not fire; one that other libraries hold whole; and baselines for frames."""
