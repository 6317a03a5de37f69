"""Sentences of the documents that give results: each is written here from the data, and must stand in its page."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from docs.tables.written import ROOT, read

CLAIMS: dict[str, tuple[str, Callable[[], str]]] = {}
"""Name of a claim: its page, and what makes its words."""

CODE = re.compile(r"`[^`]*`|<!-- table .*?<!-- end -->", re.DOTALL)
LINK = re.compile(r"\]\([^)]*\)")
NUMBER = re.compile(r"(?<![\w.,-])\d[\d.,]*\d|(?<![\w.,-])\d")


def claim(page: str) -> Callable[[Callable[[], str]], Callable[[], str]]:
    """Register a claim of a page, by its path from the top of the project."""

    def register(build: Callable[[], str]) -> Callable[[], str]:
        CLAIMS[build.__name__] = page, build
        return build

    return register


def plain(text: str) -> str:
    """Return what a page says, with one blank between two words."""
    return " ".join(text.split())


def unbound(page: str, free: set[str]) -> list[str]:
    """Return the numbers of a page that neither a table nor a claim nor the list of what is no result accounts for.

    Parameters
    ----------
    page : str
        Its path from the top of the project.
    free : set of str
        Words with numbers that are no results: sizes, settings, names.

    Raises
    ------
    ValueError
        If one of these words is not in the page.
    """
    text = plain(LINK.sub("]", CODE.sub("", (ROOT / page).read_text())))
    claims = [plain(LINK.sub("]", CODE.sub("", build()))) for where, build in CLAIMS.values() if where == page]
    for words in sorted([*claims, *free], key=len, reverse=True):
        if words not in text:
            raise ValueError(f"{page} does not say {words!r}")
        text = text.replace(words, "")
    return NUMBER.findall(text)


def _pair(first: str, second: str) -> dict[str, Any]:
    pairs = read("docs/data/fig9_rates.json")["pairs"]
    (found,) = (pair for pair in pairs if (pair["first"], pair["second"]) == (first, second))
    return dict(found)


def _points(pair: dict[str, Any]) -> tuple[float, float, float, float]:
    """Accuracies of first and second, and the interval of their difference without its sign, in per cent."""
    first, second = (100 * sum(values) / len(values) for values in (pair["accuracy_first"], pair["accuracy_second"]))
    low, high = sorted(abs(100 * bound) for bound in pair["interval"])
    return first, second, low, high


@claim("README.md")
def simulated() -> str:
    """The last line of ``make sim``."""
    return str(read("docs/data/verification/sim.json")["result"])


@claim("README.md")
def replayed() -> str:
    """Events of all images and encoders."""
    runs = read("docs/data/verification/replay.json")["runs"]
    images = {run["images"] for run in runs}
    assert len(images) == 1
    assert len(runs) == 3
    return (
        f"every event of {images.pop()} texture scans and three encoders, {sum(run['events'] for run in runs):,} in all"
    )


@claim("README.md")
def highest_rate() -> str:
    """The rate that does not come out."""
    rates = read("docs/data/event_rates.json")["points"]
    (point,) = (p for p in rates if (p["encoding"], p["resolution"]) == ("lcs", 8))
    return f"The 8 b LCS rate comes out {100 * (point['here_hz'] / point['published_hz'] - 1):.1f} % high"


@claim("README.md")
def spikes_win() -> str:
    """Where spikes take less power, and where not."""
    rows = {row["case"]: row for row in read("docs/data/sensitivity.json")["rows"]}
    published, corrected = rows["none (paper)"], rows["all (consistent)"]
    millivolts = {round(1e3 * published["crossover"][name]["noise_v_rms"], 1) for name in ("lcs", "nlcs")}
    assert min(min(ratios) for ratios in corrected["ratio"].values()) > 1
    corrections = {7: "seven"}[len(corrected["corrections"])]
    return f"from {min(millivolts)} mV of noise on, but with {corrections} corrections, each a switch, they do not"


@claim("README.md")
def frames_win() -> str:
    """Frames against spikes at a fifth of the published data rate."""
    first, second, low, high = _points(_pair("rates-cnn:lcs-4", "rates-cnn:frame-diff-250-8"))
    return (
        f"At a fifth of 640 kb/s frames win with convolutions ({second:.1f} against {first:.1f} %, difference "
        f"{low:.1f} to {high:.1f} points over images)"
    )


@claim("README.md")
def spikes_win_small() -> str:
    """Spikes against frames at the same rate, with the paper's network."""
    first, second, low, high = _points(_pair("rates-paper:lcs-4", "rates-paper:frame-onoff-250-8"))
    return f"LCS with the paper's network ({first:.1f} against {second:.1f} %, {low:.1f} to {high:.1f})"


@claim("README.md")
def spikes_ahead() -> str:
    """At a fortieth."""
    pairs = [
        _pair("rates-paper:lcs-2", "rates-paper:frame-onoff-31.25-8"),
        _pair("rates-cnn:lcs-2", "rates-cnn:frame-diff-31.25-8"),
    ]
    points = [f"{abs(100 * pair['difference']):.0f}" for pair in pairs]
    return f"At a fortieth LCS is ahead with both, by {points[0]} and {points[1]} points"


@claim("README.md")
def times_known() -> str:
    """How well events tell a time."""
    (row,) = (row for row in read("docs/data/classifier/merits.json")["timing"] if row["known_from"] == "events")
    return f"events know times to {1e6 * row['median_s']:.0f} us"


@claim("README.md")
def laid_out() -> str:
    """The layout in the picture."""
    kept = read("docs/data/layout/lcs-digital-2x2-6b.json")
    rows, columns = (kept["configuration"][side] for side in ("rows", "columns"))
    assert not kept["rules"]["violations"]
    return f"{rows} x {columns} taxels in SkyWater 130 nm rules, {kept['width_um']:.0f} x {kept['height_um']:.0f} um"
