"""Precision: the accuracy of integer networks with few bits.

The integer network is the golden model of the RTL, with every rounding and every saturation, so these are results of
the hardware (docs/results/classifier.md#integer-weights). The study tests the networks in
``out/train*/NETWORK/TRAINING``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, plain_numbers, save_figure
from eskin.base.progress import bar
from eskin.base.workers.engine import Pool
from eskin.model.classifier.network import IntegerNetwork
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.experiments.intervals import scored
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.sweep import NEEDS
from studies.drawing import MARKERS, draw_accuracies, family
from studies.networks import Cells, Subject, by_case, right_by_image, tested, trained_networks
from studies.study import Data, Result, run, work_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FLOAT = "float"
"""Name of the float network among the variants."""

COSTS = ("memory_bits", "membrane_bits", "threshold", "operations_hz")
"""Fields of an integer network in the result."""

VARIANTS = ("8", "7", "6", "5", "4", "3", "2", "8:t6", "8:t4", "4:t6", "4:t4", "4:m16", "4:m13", "4:m11")
"""Bits of weights, of the threshold and of a hidden potential; see ``precision_of``."""

BITS = ("2", "4", "8")
"""Bits that are written beside their points."""
LEAST = 50.0
"""Lower end of the panels, in percent accuracy; networks of two bits are often below."""


def precision_of(variant: str) -> Precision:
    """Return the precision of a variant.

    A variant gives the bits of all weights, the least bits of the threshold (t), and the bits of a hidden potential
    (m), such as ``4:t6`` or ``4:m12``.
    """
    bits, *others = variant.split(":")
    names = {"t": "threshold_bits", "m": "membrane_bits"}
    fields: dict[str, Any] = dict.fromkeys(("in_bits", "rec_bits", "out_bits"), int(bits))
    return Precision(**fields | {names[other[0]]: int(other[1:]) for other in others})


def compute(pool: Pool) -> Data:
    """Return accuracy, cost and answers of every network at every precision."""
    subjects = trained_networks()
    with bar("networks", len(subjects)) as step:
        jobs = [([subject], {"variants": list(VARIANTS)}) for subject in subjects]
        cells = tested(pool, work_of("precision", NEEDS), answers, jobs, step)
    return {"tests": tests_of(cells), "points": points_of(cells)}


def answers(subjects: Sequence[Subject], case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the answers of networks at every precision."""
    return [_cell(subject, case["variants"]) for subject in subjects]


def _cell(subject: Subject, variants: Sequence[str]) -> dict[str, Any]:
    """Return predictions, memory and additions of a network at every precision."""
    from eskin.snn.train import predicted_classes

    data = subject.experiment.data()
    counts = data.values[data.first_scans(subject.images)]
    said = predicted_classes(subject.weights.network, data, subject.images).tolist()
    answers: dict[str, Any] = {FLOAT: {"predicted": said}}
    for name in variants:
        made = quantise(subject.weights, precision_of(name)).network
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


def plot_precision(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against memory and additions, one line per network; labels give the weight bits.

    Networks whose names differ only from the number of their neurons on share a column of panels. The more neurons,
    the darker the line; lines of networks that were trained with few bits are dashed.
    """
    points = data["points"]
    families: dict[str, list[str]] = {}
    for point in points:
        own = families.setdefault(family(point["network"])[0], [])
        if point["network"] not in own:
            own.append(point["network"])
    labels = sorted(
        {family(p["network"])[1] for p in points},
        key=lambda text: (int("0" + text.split()[0]) if text[0].isdigit() else 0, text),
    )
    styles = _styles(labels)
    figure = new_figure(max(3.6 * len(families), 7), 7, "Accuracy of integer networks by the bits of their weights")
    axes = figure.subplots(2, len(families), sharey=True, sharex="row", squeeze=False)
    for column, (title, networks) in enumerate(families.items()):
        dress(axes[0, column], title, "memory of the network (kB)")
        dress(axes[1, column], "", "additions (millions per second)")
        for network in networks:
            own_points = [p for p in points if p["network"] == network and p["variant"].isdigit()]
            label = family(network)[1]
            for axis, key, unit in (
                (axes[0, column], "memory_bits", 1 / 8000),
                (axes[1, column], "operations_hz", 1e-6),
            ):
                x = [point[key] * unit for point in own_points]
                draw_accuracies(axis, x, own_points, styles[label], markersize=4, linewidth=1, label=label)
            _bits(axes[0, column], own_points, styles[label]["color"])
        for axis in axes[:, column]:
            axis.set_xscale("log")
            plain_numbers(axis)
            axis.set_ylim(LEAST, 100)
            axis.axhline(90, color=GREY, linestyle=":", linewidth=0.8)
    for axis in axes[:, 0]:
        axis.set_ylabel("accuracy (%)", fontsize=8.5)
    known: dict[str, Any] = {}
    for axis in axes[0]:
        known |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    shown = [label for label in labels if label in known]
    words = f"numbers: weights of {', '.join(BITS)} bits, others between them; bars: 95 % interval; dotted: 90 %"
    legend_below(figure, ([known[label] for label in shown], shown), 3, words)
    save_figure(figure, path)


def _styles(labels: Sequence[str]) -> dict[str, dict[str, Any]]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    sizes = list(dict.fromkeys(label.partition(",")[0] for label in labels))
    found = {}
    for label in labels:
        number = sizes.index(label.partition(",")[0])
        colour = to_hex(colormaps["Blues"](0.45 + 0.5 * number / max(len(sizes) - 1, 1)))
        few = "," in label
        found[label] = {
            "color": colour,
            "marker": MARKERS[number % len(MARKERS)],
            "linestyle": "--" if few else "-",
            "markerfacecolor": "white" if few else colour,
        }
    return found


def _bits(axis: Axes, points: Sequence[dict[str, Any]], colour: str) -> None:
    for point in points:
        if (y := 100 * point["accuracy"]) >= LEAST and point["variant"] in BITS:
            at = point["memory_bits"] / 8000, y
            axis.annotate(point["variant"], at, (3, 3), textcoords="offset points", fontsize=6, color=colour)


RESULT = Result("classifier/precision", compute, plot_precision, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("precision", RESULT)
