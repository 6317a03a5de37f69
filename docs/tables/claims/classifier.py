"""What the page of the classifier's accuracy claims."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import cache
from typing import Any

from docs.tables.accuracy import frame_points, published, rate, sweep
from docs.tables.claims import claim
from docs.tables.written import ROOT, digits, read
from snn.experiments.pairs import find_point
from snn.experiments.pairs import pair as compare

PAGE = "docs/results/classifier.md"
NLCS = "docs/data/classifier/nlcs"


def point(readout: str, bits: int, name: str = "paper-network") -> dict[str, Any]:
    """Return a point of a sweep."""
    (found,) = (p for p in sweep(name) if (p["readout"], p["resolution"]) == (readout, bits))
    return found


def alone(name: str) -> dict[str, Any]:
    """Return the point of a sweep of N-LCS with another constant."""
    (found,) = read(f"{NLCS}/{name}.json")["points"]
    return dict(found)


def accuracy(found: dict[str, Any]) -> float:
    """Return the accuracy of a point in the last epoch, in per cent."""
    return 100 * float(found["last"]["accuracy"])


@cache
def pair(first: str, second: str, reading: str = "last") -> dict[str, Any]:
    """Return what ``python -m snn pair`` says of two points, the second minus the first in points."""
    kept = ROOT / "snn/figures/sweeps"
    points = [
        find_point(one if one[0].isalpha() and "/" not in one else f"{ROOT}/{one}", kept) for one in (first, second)
    ]
    found = dataclasses.asdict(compare(points[0], points[1], reading))
    return found | {"low": 100 * found["interval"][0], "high": 100 * found["interval"][1]}


def points(found: dict[str, Any]) -> str:
    """Return a difference of a pair with its interval, without its sign."""
    ends = sorted(abs(found[end]) for end in ("low", "high"))
    return f"{abs(100 * found['difference']):.1f} points ({ends[0]:.1f} to {ends[1]:.1f}"


@claim(PAGE)
def paper() -> Iterator[str]:
    """The paper's network on the paper's scans."""
    outside, ours = published("nlcs", 8)["accuracy"], point("nlcs", 8)["last"]["bootstrap_95"]
    assert not ours[0] <= outside <= ours[1]
    yield f"but at 8 b, where {100 * outside:.2f} % is outside our interval"
    yield f"the published {100 * outside:.2f} % lies between our last epoch and our best test epoch"
    lcs = point("lcs", 6)["last"]
    yield f"single trainings at LCS 6 b is {100 * lcs['sd_over_cells']:.1f} points"
    (plain,) = read("docs/data/classifier/ablation/uncalibrated.json")["points"]
    without, them = ([100 * one for one in last["accuracy_of_seeds"]] for last in (plain["last"], lcs))
    ends = [100 * end for end in plain["last"]["bootstrap_95"]]
    yield (
        f"{without[0]:.1f}, {without[1]:.1f} and {without[2]:.1f} % in its three seeds, {accuracy(plain):.1f} % "
        f"({ends[0]:.1f} to {ends[1]:.1f}) in all. With them: {them[0]:.1f}, {them[1]:.1f} and {them[2]:.1f} %"
    )


@claim(PAGE)
def explained() -> Iterator[str]:
    """What the constants of N-LCS are worth."""
    short, bipolar, start, on = (alone(name) for name in ("tau-0.02", "bipolar-0.2", "start", "on"))
    nlcs, lcs = point("nlcs", 6), point("lcs", 6)
    gain = accuracy(short) - accuracy(nlcs)
    yield f"With 20 ms in place of 200 N-LCS 6 b gains {gain:.0f} points ({accuracy(short):.1f} %), and sends"
    yield f"LCS 4 b, which has {accuracy(point('lcs', 4)):.0f} % at a fifth of that"
    yield f"LCS 6 b with {accuracy(on):.1f} % of {accuracy(lcs):.1f}"
    yield f"it has {accuracy(bipolar):.1f} % at half the rate of N-LCS 8 b ({accuracy(point('nlcs', 8)):.1f} %)"
    won = pair(f"{NLCS}/tau-0.02.json:nlcs-6", f"{NLCS}/bipolar-0.2.json:nlcs-4-bipolar")
    assert won["p"][0] < 0.001
    yield f"at a fifth of its rate ({points(won).replace(' points (', ' points, ')}, McNemar p < 0.001)"
    yield f"N-LCS 6 b has {accuracy(start):.1f} % at {rate(start)}, six points more"
    more = pair(f"{NLCS}/start.json:nlcs-6", f"{NLCS}/bipolar-0.2.json:nlcs-4-bipolar")
    assert more["p"][0] < 0.001
    yield (
        f"the bipolar one ({rate(bipolar)}) is {points(more).replace(' points', ' points ahead')}, "
        f"{more['only_second'][0]} images against {more['only_first'][0]}, p < 0.001)"
    )
    even = pair("rates-paper:lcs-4", f"{NLCS}/bipolar-0.2.json:nlcs-4-bipolar")
    yield (
        f"at the same rate ({rate(bipolar)} against {rate(point('lcs', 4))}) LCS 4 b has "
        f"{100 * even['accuracy_first'][0]:.1f} % in the same seed, {even['only_second'][0]} images are right with the "
        f"one alone and {even['only_first'][0]} with the other (p {even['p'][0]:.0f})"
    )


@claim(PAGE)
def frames() -> Iterator[str]:
    """Frames beside events on the same scans."""
    lcs = point("lcs", 4)
    assert accuracy(lcs) > max(accuracy(p) for p in frame_points().values())
    yield f"the paper's network on LCS 4 b ({accuracy(lcs):.1f} %, a twentieth of the data rate)"
    yield f"The {accuracy(frame_points()['cnn']):.1f} % of convolutions on frames at a rate of 5"


@claim(PAGE)
def equal_rates() -> Iterator[str]:
    """Where frames win, and where events do."""
    fifth, seconds = pair("rates-cnn:lcs-4", "rates-cnn:frame-diff-250-8"), 100
    first, second = (seconds * sum(fifth[of]) / len(fifth[of]) for of in ("accuracy_first", "accuracy_second"))
    yield (
        f"differences of frames {second:.1f} %, LCS 4 b {first:.1f} %. Frames are ahead by {points(fifth)} over images"
    )
    certain = [p for p in fifth["p"] if p < 0.05]
    assert len(certain) == 1
    yield f"of single seeds one tells the two apart, p {digits(certain[0], 1)}); in the epochs"
    chosen = pair("rates-cnn:lcs-4", "rates-cnn:frame-diff-250-8", "selected")
    yield (
        f"selected by inner validation by {points(chosen)}, p {digits(min(chosen['p']), 1)} to "
        f"{digits(max(chosen['p']), 2)})"
    )
    paper = pair("rates-paper:lcs-4", "rates-paper:frame-onoff-250-8")
    lcs, onoff = (seconds * sum(paper[of]) / len(paper[of]) for of in ("accuracy_first", "accuracy_second"))
    certain = [p for p in paper["p"] if p < 0.05]
    assert len(certain) == 1
    yield (
        f"LCS 4 b {lcs:.1f} %, the same frames as ON/OFF counts {onoff:.1f} %. LCS is ahead by {points(paper)}; of "
        f"single seeds one tells the two apart, p {digits(certain[0], 2)})"
    )
    small = pair("rates-paper:lcs-2", "rates-paper:frame-onoff-31.25-8")
    assert max(small["p"]) < 0.01
    yield f"LCS 2 b is ahead by {points(small)}) with the paper's network, three seeds, p below 0.01 in each"
    least = pair("rates-cnn:lcs-2", "rates-cnn:frame-diff-31.25-8")
    yield f"and by {points(least)}) with convolutions, one seed"
    twice = pair("rates-cnn:lcs-2", "rates-cnn:frame-diff-62.5-8")
    yield (
        f"({100 * twice['accuracy_second'][0]:.1f} against {100 * twice['accuracy_first'][0]:.1f} %, "
        f"p {digits(twice['p'][0], 2)})"
    )
    half = pair("rates-cnn:frame-diff-250-8", "rates-cnn:frame-diff-125-8")
    quarter = pair("rates-cnn:frame-diff-250-8", "rates-cnn:frame-diff-62.5-8")
    yield (
        f"half of the fifth, lose {points(half)}, p {digits(half['p'][0], 2)}, seed 0), at a quarter "
        f"{-100 * quarter['difference']:.1f}"
    )
    coded = {
        p["name"]: p["coded_rate"] for p in read("docs/data/fig9_rates.json")["points"] if p["sweep"] == "rates-cnn"
    }
    yield f"frames at 250 Hz need {coded['frame-diff-250-8']:.3f}, LCS 4 b {coded['lcs-4']:.3f}"
