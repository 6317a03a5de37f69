"""Tables of the two generated tasks of the INTUITIVE chip."""

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from docs.tables.claims import Claim, compared, counted
from docs.tables.write import Rows, filled, only, read
from eskin.snn.experiments.pairs import Answers, right_of

PAIRS = (("lcs", "cwlcs"), ("lcs", "nlcs"), ("lcs", "nlcs-bipolar"), ("nlcs", "frame"))
PLAIN = {"spectrum": "logistic regression on the spectrum", "signals": "logistic regression on statistics"}
PLAIN |= {"forest": "forest on statistics", "most frequent class": "always the same class"}


def tasks() -> dict[str, Any]:
    """Return the stored results by task."""
    return dict(read("docs/data/tasks.json")["tasks"])


def point_name(point: dict[str, Any]) -> str:
    """Return the readout of a point as text."""
    _, *numbers = point["readout"].split(":")
    text = "frames {rate} Hz {bits} b" if point["kind"] == "frame" else "{kind:E} {bits} b"
    return filled(text, point | {"rate": numbers[0], "bits": numbers[-1]})


def task_points() -> Rows:
    """Yield data rate and accuracy of every readout."""
    for name, task in tasks().items():
        for point in sorted(task["points"], key=lambda one: (one["budget"], one["kind"] == "frame")):
            yield point | {"task": name, "name": point_name(point)}


@cache
def task_claims() -> dict[tuple[str, int, str, str], Claim]:
    """Return the comparisons of both tasks at equal data rate; Holm's correction is for all of them."""
    answers = {}
    for name, task in tasks().items():
        for budget in sorted({point["budget"] for point in task["points"]}):
            words = {point["kind"]: point["predicted"] for point in task["points"] if point["budget"] == budget}
            for first, second in PAIRS:
                if {first, second} <= set(words):  # an encoder may have no resolution with this data rate
                    answers[name, budget, first, second] = Answers(task["labels"], words[first], words[second])
    return compared(answers)


def task_pairs() -> Rows:
    """Yield a row for each comparison."""
    for (name, budget, *pair), claim in task_claims().items():
        a, b = (only(tasks()[name]["points"], budget=budget, kind=kind) for kind in pair)
        yield {"task": name, "a": point_name(a), "b": point_name(b), "gain": 100 * claim.difference, "p": claim.p}


def task_verdicts(task: str, second: str, first: str = "lcs") -> str:
    """Return how many comparisons of a task the second readout wins and loses significantly, as text."""
    own = [claim for (name, _, *pair), claim in task_claims().items() if name == task and pair == [first, second]]
    return "{more} of {of} comparisons (less accurate in {less})".format(**counted(own))


def task_references() -> Rows:
    """Yield the accuracy of each plain classifier of the signals, for both tasks."""
    for name, text in PLAIN.items():
        right = [100 * right_of(task["labels"], [task["references"][name]]).mean() for task in tasks().values()]
        yield {"name": text, "flutter": float(np.mean(right[0])), "indentation": float(np.mean(right[1]))}


def task_chips() -> Iterable[dict[str, Any]]:
    """Yield the networks that the RTL chip played."""
    for name, task in tasks().items():
        for readout, chip in task["chips"].items():
            point = only(task["points"], readout=readout)
            yield chip | {"task": name, "name": point_name(point)}


def task_loss() -> dict[str, Any]:
    """Return how many of the played networks are at most half a point below float, and the largest loss in points."""
    losses = [100 * (chip["right_float"] - chip["right"]) / chip["images"] for chip in task_chips()]
    return {"met": sum(loss <= 0.5 for loss in losses), "of": len(losses), "most": max(losses)}
