"""Measure the accuracy of integer networks with few bits.

The integer network is the golden model of the RTL, with every rounding and every saturation, so these are results of
the hardware (docs/results/classifier.md#in-whole-numbers).
"""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.network import IntegerNetwork
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.weights import Weights
from eskin.snn.experiments.intervals import scored, wilson
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.robustness import Cells, Subject, by_case, kept_cell, right_by_image

FLOAT = "float"
"""Name of the float network among the variants."""

COSTS = ("memory_bits", "membrane_bits", "threshold", "operations_hz")
"""Fields of an integer network in the result."""

_VARIANT = re.compile(r"([2-8])(?::t(\d+))?(?::m(\d+))?")


def parse_variants(text: str) -> dict[str, Precision]:
    """Return the precision of each variant in a text such as ``8,4:t6,4:m12``.

    A variant gives the bits of all weights, the least bits of the threshold (t),
    and the bits of a hidden potential (m).

    Raise InputError if the text has another form, or repeats a variant.
    """
    found: dict[str, Precision] = {}
    for name in (part.strip() for part in text.split(",")):
        match = _VARIANT.fullmatch(name)
        if match is None or name in found:
            raise InputError(
                f"--variants must list different BITS[:tTHRESHOLD_BITS][:mMEMBRANE_BITS] with 2..8 bits, for example "
                f"8,4:t6,4:m12, not {name!r}"
            )
        bits, threshold, membrane = (None if one is None else int(one) for one in match.groups())
        assert bits is not None
        weights: dict[str, Any] = dict.fromkeys(("in_bits", "rec_bits", "out_bits"), bits)
        others: dict[str, Any] = {} if threshold is None else {"threshold_bits": threshold}
        found[name] = Precision(**weights, **others, membrane_bits=membrane)
    return found


def in_precisions(
    subjects: Sequence[Subject], variants: dict[str, Precision], out: Path, progress: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return the predictions of every network at every precision; results stored in ``out`` are reused.

    Raise InputError if a file is of other weights or variants.
    """
    found = []
    for subject in subjects:
        path, key = out / f"{subject.name}.json", {"variants": list(variants)}
        found.append(kept_cell(subject, path, key, partial(_cell, subject, variants)))
        progress()
    return found


def _cell(subject: Subject, variants: dict[str, Precision]) -> dict[str, Any]:
    """Return predictions, memory and additions of a network at every precision."""
    from eskin.snn.train import predicted_classes

    data = subject.experiment.data()
    counts = data.values[data.first_scans(subject.images)]
    said = predicted_classes(subject.weights.network, data, subject.images).tolist()
    answers: dict[str, Any] = {FLOAT: {"predicted": said}}
    for name, precision in variants.items():
        made = quantise(subject.weights, precision).network
        evidence, rate = made.run_counts(counts)
        config = made.config
        answers[name] = {
            "predicted": evidence.argmax(1).tolist(),
            "memory_bits": config.memory_bits,
            "membrane_bits": config.membrane_bits,
            "threshold": config.threshold,
            "operations_hz": _operations_hz(made, counts, rate, data.step_s),
        }
    return {
        "hidden": int(subject.weights.network.get_parameter("w_rec").shape[0]),
        "labels": data.image_labels[subject.images].tolist(),
        "answers": answers,
    }


def _operations_hz(made: IntegerNetwork, counts: NDArray[Any], rate: float, bin_s: float) -> float:
    """Return the additions per second for the events of scans, shape (scans, bins, inputs)."""
    events = counts.sum() / (counts.shape[0] * counts.shape[1])
    return float(made.config.additions(events, rate * made.config.hidden, 1) / bin_s)


def points_of(cells: Cells) -> list[dict[str, Any]]:
    """Return accuracy, intervals, cost and predictions for every network and precision.

    ``within`` is the part of the images that have the answer of the float network; ``predicted`` has a word for each
    of the ``tests_of`` the network. Only images that were tested with every seed count.
    """
    answers = [
        cell | one | {"variant": variant, "float": cell["answers"][FLOAT]["predicted"]}
        for cell in cells
        for variant, one in cell["answers"].items()
    ]
    found = []
    for case, parts in by_case(answers, "network", "variant"):
        right = right_by_image(parts)
        right = right[~np.isnan(right).any(1)]
        if not len(right):
            raise InputError(f"the seeds of {case['network']} have no common test image; train complete folds")
        same = np.concatenate([np.equal(cell["predicted"], cell["float"]) for cell in parts])
        found.append(
            {
                **case,
                "hidden": parts[0]["hidden"],
                **scored(right),
                "within": float(same.mean()),
                "seeds": right.shape[1],
                **{name: max(cell[name] for cell in parts) for name in COSTS if name in parts[0]},
                "predicted": [as_word(cell["predicted"]) for cell in parts],
            }
        )
    return found


def tests_of(cells: Cells) -> dict[str, list[dict[str, Any]]]:
    """Return the test images of each network's trainings, by network."""
    return {
        case["network"]: [
            {name: cell[name] for name in ("fold", "seed", "images")} | {"labels": as_word(cell["labels"])}
            for cell in parts
        ]
        for case, parts in by_case(cells, "network")
    }


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
