"""Tables of the slides of a BioTac over 20 materials."""

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from docs.tables.claims import Claim, compared, counted
from docs.tables.tasks import point_name
from docs.tables.write import Rows, only, read
from eskin.snn.experiments.pairs import Answers, right_of

LEVELS = {"fixed": "kept", "first": "removed"}
ENCODERS = ("lcs", "cw-lcs", "nlcs-bipolar", "frame")


def biotac() -> dict[str, Any]:
    """Return the stored results."""
    return dict(read("docs/data/biotac.json"))


def biotac_points() -> Rows:
    """Yield data rate and accuracy of every readout, with and without the level."""
    levels = biotac()["levels"]
    order = sorted({point["budget"] for point in levels["fixed"]["points"]})
    for budget in order:
        for baseline, level in LEVELS.items():
            for point in (one for one in levels[baseline]["points"] if one["budget"] == budget):
                yield point | {"level": level, "name": point_name(point)}


@cache
def biotac_claims() -> dict[tuple[str, str, int], Claim]:
    """Return the gains of N-LCS with its level over each other readout with it, and over N-LCS without."""
    report, answers = biotac(), {}
    words = {
        (baseline, point["kind"], point["budget"]): point["predicted"]
        for baseline in LEVELS
        for point in report["levels"][baseline]["points"]
    }
    for budget in sorted({budget for *_, budget in words}):
        own = words["fixed", "nlcs", budget]
        for baseline, kind in [*(("fixed", kind) for kind in ENCODERS), ("first", "nlcs")]:
            answers[baseline, kind, budget] = Answers(report["labels"], words[baseline, kind, budget], own)
    return compared(answers)


def biotac_pairs() -> Iterable[dict[str, Any]]:
    """Yield a row for each comparison."""
    levels = biotac()["levels"]
    for (baseline, kind, budget), claim in biotac_claims().items():
        a = only(levels[baseline]["points"], kind=kind, budget=budget)
        b = only(levels["fixed"]["points"], kind="nlcs", budget=budget)
        yield {
            "a": point_name(a) + (", level removed" if baseline == "first" else ""),
            "b": point_name(b),
            "gain": 100 * claim.difference,
            "p": claim.p,
        }


def biotac_verdicts(kind: str) -> str:
    """Return how many comparisons N-LCS with its level wins and loses significantly, as text."""
    own = [claim for (of, name, _), claim in biotac_claims().items() if (of, name) == ("fixed", kind)]
    return "{more} of {of} comparisons (less accurate in {less})".format(**counted(own))


def biotac_references() -> dict[str, float]:
    """Return the accuracy of plain classifiers of the signals in percent, by name."""
    report = biotac()
    names = {"signals": "logistic", "forest": "forest"}
    return {
        text: 100 * float(np.mean(right_of(report["labels"], [report["references"][name]])))
        for name, text in names.items()
    }
