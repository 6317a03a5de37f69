"""Tables of the recordings of a robot finger: accuracy, data rate and energy of events and frames."""

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.tables.claims import compared
from docs.tables.energy import at_rates
from docs.tables.write import Rows, filled, only, read
from eskin.snn.experiments.pairs import Answers, Pair, compare, right_of
from eskin.snn.reference import score

REPETITION = "repetition 1"

KINDS = {"repetition": "repetition 1", "mean of six speeds": "mm/s", "mean of five pressures": "pressure"}
"""Groups of folds, and a text in the names of their folds."""

TARGETS = {
    "repetition, at least 99.5 %": ("repetition", 0.995),
    "one speed left out, at least 99 % on average": ("mean of six speeds", 0.99),
    "one pressure left out, at least 90 % on average": ("mean of five pressures", 0.9),
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


def finger_targets() -> Rows:
    """Yield each target with the best encoder, and with the best frames."""
    report = finger_report()
    points = [*report["points"], *report["level"]["points"]]
    for text, (kind, wanted) in TARGETS.items():
        cells = []
        for frames in (False, True):
            some = [point for point in points if (point["readout"] == "frame") == frames]
            found = [(accuracies(report, point["network"]), name_of(point)) for point in some]
            found += [] if frames else [(trained_means(report), "N-LCS 4 b, settings of the table above")]
            best, name = max((of_folds[kind], name) for of_folds, name in found if kind in of_folds)
            cells.append(f"{'met' if best >= wanted else 'missed'}: {100 * best:.1f} % ({name})")
        yield [text, *cells]


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


def default_trainings() -> Rows:
    """Yield the trainings of docs/data/trainings.json by kind of test, each beside its references.

    p is McNemar's against the better reference, median over the seeds, after Holm's correction for all rows.
    """
    runs = read("docs/data/trainings.json")["runs"]
    found, answers = {}, {}
    for test in dict.fromkeys(run["test"] for run in runs):
        some = [run for run in runs if run["test"] == test]
        labels, references = some[0]["labels"], some[0]["references"]
        plain = {name: references[name]["right"] for name in ("signals", "forest")}
        words = [run["predicted"] for run in some]
        best = references[max(plain, key=plain.__getitem__)]["predicted"]
        answers[test] = Answers(labels, [best] * len(some), words)
        found[test] = {
            "test": test,
            "readout": readout_of(some[0]),
            "right": ", ".join(str(run["right"]) for run in some),
            "of": len(labels),
            "percent": 100 * float(right_of(labels, words).mean()),
            "most": references["most frequent class"]["right"],
        } | plain
    for test, claim in compared(answers).items():
        yield found[test] | {"p": claim.p}


def trainings_played() -> Rows:
    """Yield the networks of docs/data/trainings.json that the RTL played."""
    yield from read("docs/data/trainings.json")["played"]


def trained_means(report: dict[str, Any]) -> dict[str, float]:
    """Return the accuracies of docs/data/trainings.json by fold, and by group of folds if no fold is missing."""
    found = dict[str, list[float]]()
    for run in read("docs/data/trainings.json")["runs"]:
        fold = run["test"].removeprefix("finger, ").removesuffix(", given").replace("mm/s", "mm/s, both ways")
        found.setdefault(fold, []).append(run["right"] / len(run["labels"]))
    return _grouped(report, {fold: float(np.mean(of_seeds)) for fold, of_seeds in found.items()})


def unseen_pressures() -> Rows:
    """Yield the remedies for an unseen pressure with the right answers at the lowest and the highest pressure."""
    report = finger_report()
    labels = [only(report["folds"], fold=f"pressure {force}")["labels"] for force in (120, 250)]
    for one in read("docs/data/trainings.json")["remedies"]:
        a, b = (int(right_of(wanted, [word]).sum()) for wanted, word in zip(labels, one["predicted"], strict=True))
        yield {"remedy": one["remedy"], "a": a, "b": b}


def readout_of(run: dict[str, Any]) -> str:
    """Return encoder, resolution, baseline, gains and time bin of a training as text."""
    gains = f", gains {', '.join(map('{:g}'.format, run['gains']))}" if run.get("gains") else ""
    return filled(f"{{encoding:E}} {{resolution}} b, `{{baseline}}`{gains}, bins of {{bin_s:1e3*#2}} ms", run)


def _level(point: str) -> dict[str, Any]:
    """Return the point of a readout that keeps the level."""
    return only(finger_report()["level"]["points"], point=point)


def finger_levels() -> Rows:
    """Yield data rate and accuracy of each readout that keeps the level, and of the best ones that do not."""
    report = finger_report()
    for kept, points in (("kept", report["level"]["points"]), ("removed", report["points"])):
        for point in points:
            reached = accuracies(report, point["network"])
            seeds = [len(_words([one], point["network"])[1]) for one in report["folds"]]
            rest = min((number for number in seeds[1:] if number), default=0)
            percent = {kind: f"{100 * reached[kind]:.1f} %" if kind in reached else "-" for kind in KINDS}
            yield point | percent | {
                "name": name_of(point), "level": kept, "seeds": f"{seeds[0]}, {rest or '-'}"
            }  # fmt: skip


LEVEL_PAIRS = [
    ("level", first, "level", second)
    for second in ("nlcs:4", "nlcs-bipolar:4")
    for first in ("lcs:7", "cw-lcs:6", "frame:12.22:9")
] + [("points", "nlcs:7", "level", "nlcs:4"), ("points", "nlcs-bipolar:5", "level", "nlcs-bipolar:4")]
"""Comparisons on the other repetition; Holm's correction is for all of them."""


@cache  # each takes seconds, and several documents need them
def level_pairs() -> list[tuple[dict[str, Any], dict[str, Any], Pair, float]]:
    """Return both points of each comparison, the comparison over their common seeds, and the corrected p value."""
    report = finger_report()
    labels = only(report["folds"], fold=REPETITION)["labels"]
    places = {"level": report["level"]["points"], "points": report["points"]}
    found, answers = [], {}
    for names in LEVEL_PAIRS:
        place, first, other, second = names
        a, b = only(places[place], point=first), only(places[other], point=second)
        words = ([of_seed[REPETITION] for of_seed in one["network"] if REPETITION in of_seed] for one in (a, b))
        answers[names] = Answers(labels, *words)
        found.append((a, b, compare(*answers[names])))
    return [(*one, claim.p) for one, claim in zip(found, compared(answers).values(), strict=True)]


def finger_level_pairs() -> Rows:
    """Yield a row for each comparison."""
    for number, (a, b, pair, p) in enumerate(level_pairs()):
        without = " without level" if LEVEL_PAIRS[number][0] == "points" else ""
        row = {"difference": pair.difference, "interval": pair.interval}
        yield {
            "a": name_of(a) + without, "b": name_of(b), "a_kbps": 1e-3 * a["bits_per_s"], "p": p, "gain": row,
            "b_kbps": 1e-3 * b["bits_per_s"], "seeds": len(pair.p),
        }  # fmt: skip


def finger_level_values() -> dict[str, Any]:
    """Return values for the sentences about the level: percentages, data rates and the comparison with LCS."""
    report, found = finger_report(), {}
    for name in ("nlcs:4", "nlcs-bipolar:4", "lcs:7", "frame:12.22:9"):
        point = _level(name)
        reached = accuracies(report, point["network"])
        short = re.sub(r"\W", "_", name)
        found[short] = {kind: 100 * reached[kind] for kind in KINDS if kind in reached} | {
            "kbps": 1e-3 * point["bits_per_s"]
        }
        found[short]["repetition_seeds"] = len(_words([only(report["folds"], fold=REPETITION)], point["network"])[1])
    against = {(a["point"], b["point"]): (pair, p) for a, b, pair, p in level_pairs()}
    pair, p = against["lcs:7", "nlcs:4"]
    found["gain"] = {"difference": pair.difference, "interval": pair.interval, "p": p}
    return found | {"integer": report["level"]["integer"]}
