"""Tables of the recordings of a robot finger: accuracy, data rate and energy of events and frames."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.tables.energy import at_rates
from docs.tables.write import Rows, filled, only, read
from eskin.snn.experiments.pairs import right_of
from eskin.snn.reference import score

REPETITION = "repetition 1"

KINDS = {"repetition": "repetition 1", "mean of six speeds": "mm/s", "mean of five pressures": "pressure"}
"""Groups of folds, and a text in the names of their folds."""

TARGETS = {
    "repetition, at least 99 %": ("repetition", 0.99),
    "one speed left out, at least 95 % on average": ("mean of six speeds", 0.95),
    "one pressure left out, above 84.8 % on average": ("mean of five pressures", 0.848),
}


def finger_report() -> dict[str, Any]:
    """Return the stored comparison."""
    return dict(read("docs/data/finger.json"))


def accuracies(report: dict[str, Any], predicted: Sequence[dict[str, str]]) -> dict[str, float]:
    """Return the accuracy by fold, and by group of folds if no fold is missing; means over the seeds.

    ``predicted`` has one text of predicted classes for every fold, in one dictionary for every seed.
    """
    folds = [one for one in report["folds"] if any(one["fold"] in of_seed for of_seed in predicted)]
    return _grouped(report, {one["fold"]: float(right_of(*_words([one], predicted)).mean()) for one in folds})


def _words(folds: Sequence[dict[str, Any]], predicted: Sequence[dict[str, str]]) -> tuple[str, list[str]]:
    """Return the labels of folds as one text, and the predictions of each seed that has all of them."""
    names = [one["fold"] for one in folds]
    whole = [of_seed for of_seed in predicted if set(names) <= set(of_seed)]
    return "".join(one["labels"] for one in folds), ["".join(map(of_seed.get, names)) for of_seed in whole]


def _grouped(report: dict[str, Any], found: dict[str, float]) -> dict[str, float]:
    """Return accuracies by fold, and their means over the groups of folds that are complete."""
    means = {}
    for kind, part in KINDS.items():
        names = [one["fold"] for one in report["folds"] if part in one["fold"]]
        if set(names) <= set(found):
            means[kind] = float(np.mean([found[name] for name in names]))
    return found | means


def name_of(point: dict[str, Any]) -> str:
    """Return readout and resolution of a point as text."""
    frames = point["readout"] == "frame"
    return filled("frames {rate_hz:.1f} Hz {bits} b" if frames else "{readout:E} {bits} b", point)


def finger_reached() -> dict[str, dict[str, float]]:
    """Return percentages by group of folds, and data rates, of each point for sentences."""
    report, short = finger_report(), ("repetition", "speeds", "pressures")
    found = {}
    for point in report["points"]:
        reached = accuracies(report, point["network"])
        percent = {name: 100 * reached[kind] for name, kind in zip(short, KINDS, strict=True) if kind in reached}
        percent |= {"events": point["events_per_s"], "kbps": 1e-3 * point["bits_per_s"]}
        found[re.sub(r"\W", "_", point["point"])] = percent
    return found


def finger_rates() -> Rows:
    """Yield data rate, power and energy of each readout beside its accuracy."""
    report = finger_report()
    for point in report["points"]:
        reached, events = accuracies(report, point["network"]), point["readout"] != "frame"
        labels, words = _words([only(report["folds"], fold=REPETITION)], point["network"])
        scores = [score(_classes(labels), _classes(word))["balanced_accuracy"] for word in words]
        watts = _classifier_w(report, point)["total"] if events and point["spikes_per_step"] else None
        more = {
            "name": name_of(point),
            "events": point["events_per_s"] if events else None,
            "watts": watts,
            "joules": None if watts is None else watts * report["seconds"] / report["recordings"],
            "balanced": np.mean(scores),
            "seeds": len(words),
            "others": min(len(_words([one], point["network"])[1]) for one in report["folds"]),
        }
        yield point | reached | more


def _classes(word: str) -> NDArray[np.int64]:
    """Return the classes of a text with one digit for each recording."""
    return np.array([int(digit) for digit in word])


def _classifier_w(report: dict[str, Any], point: dict[str, Any]) -> dict[str, float]:
    """Return the power of the digital chip for events, ends of bins and rest, and their sum, in watts."""
    return at_rates(
        encoder=point["readout"],
        events_hz=point["events_per_s"],
        bins_hz=1 / point["bin_s"],
        spikes=point["spikes_per_step"] * report["network"]["hidden"],
        clock_hz=report["rtl"]["clock_hz"],
        taxels=16,
    )


def _kinds(report: dict[str, Any]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the points of encoders, and those of frames."""
    frames = [point for point in report["points"] if point["readout"] == "frame"]
    return [point for point in report["points"] if point["readout"] != "frame"], frames


def finger_targets() -> Rows:
    """Yield each target with the best encoder, and with the best frames."""
    report = finger_report()
    encoders, frames = _kinds(report)
    tuned = report["tuned"]
    for text, (kind, wanted) in TARGETS.items():
        cells = []
        for points in ([*encoders, tuned], frames):
            found = [(accuracies(report, point["network"]), name_of(point)) for point in points]
            reached = [(of_folds[kind], name) for of_folds, name in found if kind in of_folds]
            best, name = max(reached)
            cells.append(f"{'met' if best >= wanted else 'missed'}: {100 * best:.1f} % ({name})")
        yield [text, *cells]


def _tuned_on() -> dict[str, list[dict[str, Any]]]:
    """Return the trainings of the inner validation by setting; the first one is the default."""
    found: dict[str, list[dict[str, Any]]] = {}
    for one in finger_report()["tuned"]["candidates"]:
        found.setdefault(one["settings"], []).append(one)
    return found


def finger_tuning_values() -> dict[str, Any]:
    """Return values for the sentences about the choice for the other repetition."""
    report = finger_report()
    tuned, labels = report["tuned"], only(report["folds"], fold=REPETITION)["labels"]
    right = right_of(labels, [of_seed[REPETITION] for of_seed in tuned["network"]])
    found = _tuned_on()
    means = {}
    second = next(runs for settings, runs in found.items() if settings.startswith(f"{tuned['chosen']}, "))
    for name, runs in (("default", next(iter(found.values()))), ("best", found[tuned["chosen"]]), ("other", second)):
        seeds = len({run["seed"] for run in runs})
        means[name] = sum(run["right"] for run in runs) / seeds
    votes = dict.fromkeys(found, 0)
    for one in tuned["candidate_votes"]:
        votes[one["settings"]] += one["right"]
    return (
        tuned
        | means
        | {
            "name": name_of(tuned),
            "reached": 100 * right.mean(),
            "of": len(labels),
            "settings": len(found),
            "never": int((~right).all(0).sum()),
            "sometimes": int((~right).any(0).sum()),
            "default_votes": votes[next(iter(found))],
            "best_votes": votes[tuned["chosen"]],
            "kbps": 1e-3 * tuned["bits_per_s"],
            "samples_kbps": 1e-3 * 16 * 12 / report["points"][0]["bin_s"],
            "coarse": report["integer"]["right_float"],
            "met": "met" if right.mean() >= 0.99 else "missed",
        }
    )


def finger_played() -> dict[str, Any]:
    """Return values for sentences about the network that the RTL played."""
    report = finger_report()
    rtl, network = report["rtl"], report["integer"]
    missing = (rtl["right_float"] - rtl["right"]) / rtl["labelled"]
    return rtl | {
        "name": filled("{readout:E} {resolution} b", network),
        "float": rtl["right_float"] / rtl["float_known"],
        "chip": rtl["right"] / rtl["labelled"],
        "balanced": network["balanced"],
        "missing": 100 * missing,
        "met": "met" if missing <= 0.01 else "missed",
        "events_per_s": rtl["events"] / (rtl["bins"] * rtl["bin_s"]),
        "train": network["command"],
    }
