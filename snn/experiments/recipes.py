"""Named parameter sets for networks and training, chosen by ``--recipe`` (docs/guide/classifier.md)."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

BASELINES = ("rnn", "gru", "cnn")
"""Recipes that are made for frames."""

_FRAMES: dict[str, Any] = {"input_rms": 1.0, "input_center": True, "cosine": True, "shift_steps": 10}

_TUNED: dict[str, Any] = {
    "input_rms": 2.0,
    "decay": 0.8,
    "output_decay": 0.95,
    "readout": "membrane",
    "dropout": 0.3,
    "weight_decay": 0.01,
    "cosine": True,
    "shift_steps": 10,
}

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
    "tuned": _TUNED,
    "skin": {
        "hidden": 128,
        "input_rms": 2.0,
        "decay": 0.9375,
        "output_decay": 0.984375,
        "readout": "membrane",
        "output_scale": 0.25,
        "dropout": 0.3,
        "learning_rate": 5e-3,
        "weight_decay": 0.01,
        "cosine": True,
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
    "hardware": _TUNED | {"decay": 0.75, "output_decay": 0.9375},
    "rnn": {"kind": "rnn", **_FRAMES},
    "gru": {"kind": "gru", "dropout": 0.3, "weight_decay": 0.01, **_FRAMES},
    "cnn": {"kind": "cnn", "dropout": 0.3, "weight_decay": 0.01, **_FRAMES},
}
"""Fields of NetworkConfig and TrainConfig by name of the recipe: the paper's network without and with what helps its
training; leaky variants whose outputs do not fire, ``skin`` for own recordings, whose leaks follow their length
(``for_recordings``); one that other libraries hold whole; and baselines for frames."""

WINDOW_S = 5.0
"""Length of the training windows of long recordings, unless most recordings are shorter."""

WHOLE_STEPS, LIKE = 512, 1.5
"""Largest number of steps, and largest ratio of lengths, of recordings that training uses whole."""

MAX_WINDOWS = 4
"""Most windows of a recording in an epoch."""

UPDATES, MOST_EPOCHS = 2400, 400
"""Updates of the weights in a training on recordings, where the user gives no epochs, and the most epochs."""

_BATCHES = 8
"""Least number of batches in an epoch, if there are enough scans: few steps teach little."""

_LEAK, _OUTPUT_LEAK = 1 / 10, 4 / 10
"""Time constants of the neurons and of the outputs, as parts of a window."""


def for_recordings(recipe: str, seconds: NDArray[np.float64], bin_s: float) -> dict[str, Any]:
    """Return the network and training parameters that depend on the lengths of a user's recordings.

    Long recordings, or those of unequal length, are learned in windows, as many of each; nine in ten recordings last
    as long as a window. The leaks of the recipe ``skin`` are the shifts that are nearest to parts of a window.

    - ``seconds``: shape (recordings,).
    - ``bin_s``: seconds of a time step.
    """
    steps = np.maximum(seconds / bin_s + 1e-9, 1).astype(int)
    found: dict[str, Any] = {"balanced": True}
    window, windows = int(steps.max()), 1
    if window > WHOLE_STEPS or window > LIKE * steps.min():
        window = max(min(round(WINDOW_S / bin_s), int(np.percentile(steps, 10))), 1)
        windows = min(max(round(float(steps.mean()) / window), 1), MAX_WINDOWS)
        found |= {"window_steps": window, "windows": windows}
    found["batch"] = batch_for(len(steps) * windows)
    if recipe == "skin":
        for name, part in (("decay", _LEAK), ("output_decay", _OUTPUT_LEAK)):
            found[name] = 1 - 2.0 ** -min(max(round(math.log2(max(window * part, 1))), 1), 10)
    return found


def batch_for(windows: int) -> int:
    """Return the batch of a training on recordings, for all windows of an epoch."""
    from eskin.snn.training import TrainConfig  # imports torch, which the help of a command needs not

    return min(max(windows // _BATCHES, 4), TrainConfig().batch)


def epochs_for(recordings: int, windows: int, batch: int, updates: int) -> int:
    """Return the epochs in which a training on recordings makes about so many updates."""
    return min(max(round(updates / math.ceil(recordings * windows / batch)), 1), MOST_EPOCHS)
