"""Compare the classes of a float network with the classes of integer networks, on random events."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.weights import Weights
from eskin.snn.experiments.intervals import wilson


def random_events(scans: int, bins: int, inputs: int, most: float, seed: int) -> NDArray[np.uint8]:
    """Return random events of shape (scans, bins, inputs), 0 or 1.

    Every channel of a scan has a rate of its own, uniform up to ``most`` events per bin.
    """
    rng = np.random.default_rng(seed)
    rates = rng.uniform(0.0, most, (scans, 1, inputs))
    return (rng.random((scans, bins, inputs)) < rates).astype(np.uint8)


@torch.no_grad()
def agreement(weights: Weights, events: NDArray[np.uint8], bits: Sequence[int]) -> dict[str, Any]:
    """Compare the predicted classes of a float network with the classes of integer networks."""
    counts = torch.from_numpy(events).float().transpose(0, 1)
    found = weights.network.eval()(counts)
    classes = found.logits.argmax(1).numpy()
    points = []
    for number in bits:
        made = quantise(weights, Precision(in_bits=number, rec_bits=number, out_bits=number)).network
        evidence, rate = made.run_counts(events)
        same = int((evidence.argmax(1) == classes).sum())
        low, high = wilson(same, len(events))
        points.append({"bits": number, "same": same, "wilson_95": [low, high], "spikes_per_bin": rate})
    times = np.bincount(classes, minlength=len(weights.class_names)).tolist()
    return {"scans": len(events), "classes": times, "spikes_per_bin": found.rate, "points": points}
