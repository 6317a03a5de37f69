"""Tables of the recordings of a robot finger: accuracy and data rate of events and frames."""

import re
from collections.abc import Collection, Sequence
from functools import cache
from typing import Any

import numpy as np

from docs.tables.claims import compared
from docs.tables.write import Rows, filled, only, read
from eskin.snn.experiments.pairs import Answers, Pair, compare, right_of

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


def finger_targets() -> Rows:
    """Yield each target with the default training, the best encoder, and the best frames."""
    report = finger_report()
    points = [*report["points"], *report["level"]["points"]]
    default, given = trained_means(report, given=False), trained_means(report, given=True)
    for text, (kind, wanted) in TARGETS.items():
        cells = [_met(default[kind], wanted)]
        for frames in (False, True):
            some = [point for point in points if (point["readout"] == "frame") == frames]
            found = [(accuracies(report, point["network"]), name_of(point)) for point in some]
            found += [] if frames else [(given, "N-LCS 4 b, gains given")]
            best, name = max((of_folds[kind], name) for of_folds, name in found if kind in of_folds)
            cells.append(f"{_met(best, wanted)} ({name})")
        yield [text, *cells]


def _met(reached: float, wanted: float) -> str:
    """Return whether an accuracy meets a target, and the accuracy."""
    return f"{'met' if reached >= wanted else 'missed'}: {100 * reached:.1f} %"


SPEEDS = "finger, one speed left out (six)"
"""Name of the trainings at all speeds together; the names of their tests end with the unit."""


@cache  # it compares all trainings, and several tables show some of them
def trainings() -> dict[str, dict[str, Any]]:
    """Return the trainings of docs/data/trainings.json by test, each beside its references; six speeds are one test.

    p is McNemar's against the better reference, median over the seeds, after Holm's correction for all tests.
    """
    tests = dict[str, dict[int, list[dict[str, Any]]]]()
    for run in read("docs/data/trainings.json")["runs"]:
        name = SPEEDS if run["test"].endswith("mm/s") else run["test"]
        tests.setdefault(name, {}).setdefault(run["seed"], []).append(run)
    found, answers = {}, {}
    for test, seeds in tests.items():
        runs = seeds[0]
        labels, words = _joined(runs, "labels"), [_joined(some, "predicted") for some in seeds.values()]
        plain = {name: sum(run["references"][name]["right"] for run in runs) for name in PLAIN}
        best = max(("signals", "forest"), key=plain.__getitem__)
        reference = "".join(run["references"][best]["predicted"] for run in runs)
        answers[test] = Answers(labels, [reference] * len(words), words)
        found[test] = {
            "test": test,
            "readout": "; ".join(dict.fromkeys(readout_of(run) for some in seeds.values() for run in some)),
            "right": ", ".join(map(str, right_of(labels, words).sum(1))),
            "of": len(labels),
            "most": plain["most frequent class"],
            "rtl": _played([run["test"] for run in runs]),
        } | plain
    return {test: found[test] | {"p": claim.p} for test, claim in compared(answers).items()}


PLAIN = ("signals", "forest", "most frequent class")
"""References on the signals of recordings."""


def _joined(runs: Sequence[dict[str, Any]], name: str) -> str:
    """Return the labels or predictions of trainings as one text."""
    return "".join(run[name] for run in runs)


def default_trainings() -> Rows:
    """Yield the trainings with default options; ``trainings_at_pressures`` yields those at pressures."""
    yield from (row for test, row in trainings().items() if "pressure" not in test)


def trainings_at_pressures() -> Rows:
    """Yield each pressure with the default training, and with the training of given settings."""
    for test, row in trainings().items():
        if f"{test}, given" in trainings():
            given = trainings()[f"{test}, given"]
            yield row | {"pressure": test.split()[-1], "given": given["right"], "given_p": given["p"]}


def misled_choice() -> dict[str, Any]:
    """Return the scores of the chosen and of the most accurate settings at pressure 150."""
    run = only(read("docs/data/trainings.json")["runs"], test="finger, pressure 150", seed=0)
    last = [score for score in run["choice"] if score["updates"] == run["choice"][-1]["updates"]]
    (chosen,) = (score for score in last if all(score[name] == run[name] for name in ("encoding", "resolution")))
    return {"chosen": chosen, "best": max(last, key=lambda score: score["right"])}


def means_at_pressures() -> dict[str, float]:
    """Return the mean accuracies over the pressures of the default network and of both references, in percent."""
    rows = list(trainings_at_pressures())
    means = {name: 100 * float(np.mean([row[name] / row["of"] for row in rows])) for name in ("signals", "forest")}
    return means | {"network": 100 * trained_means(finger_report(), given=False)["mean of five pressures"]}


def _played(tests: Collection[str]) -> str:
    """Return the right recordings of the RTL with the networks of seed 0, if it played all tests, as text."""
    played = [one for one in read("docs/data/trainings.json")["played"] if one["test"] in tests]
    assert not any(one["mismatches"] for one in played)
    return str(sum(one["right"] for one in played)) if len(played) == len(tests) else "-"


def trained_means(report: dict[str, Any], given: bool) -> dict[str, float]:
    """Return the accuracies of trainings with default or given settings by fold, and by group of complete folds."""
    found = dict[str, list[float]]()
    for run in read("docs/data/trainings.json")["runs"]:
        fold = run["test"].removeprefix("finger, ").removesuffix(", given").replace("mm/s", "mm/s, both ways")
        if run["test"].endswith(", given") == given:
            found.setdefault(fold, []).append(run["right"] / len(run["labels"]))
    return _grouped(report, {fold: float(np.mean(of_seeds)) for fold, of_seeds in found.items()})


def readout_of(run: dict[str, Any]) -> str:
    """Return encoder, resolution, baseline and gains of a training as text."""
    return filled(f"{{encoding:E}} {{resolution}} b, `{{baseline}}`{', gains' if run.get('gains') else ''}", run)


def _level(point: str) -> dict[str, Any]:
    """Return the point of a readout that keeps the level."""
    return only(finger_report()["level"]["points"], point=point)


def finger_levels() -> Rows:
    """Yield data rate and accuracy of each readout that keeps the level."""
    report = finger_report()
    for point in report["level"]["points"]:
        reached = accuracies(report, point["network"])
        seeds = [len(_words([one], point["network"])[1]) for one in report["folds"]]
        rest = min((number for number in seeds[1:] if number), default=0)
        percent = {kind: f"{100 * reached[kind]:.1f} %" if kind in reached else "-" for kind in KINDS}
        yield point | percent | {"name": name_of(point), "seeds": f"{seeds[0]}, {rest or '-'}"}


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
