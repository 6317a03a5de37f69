"""What the README claims."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docs.tables.claims import claim
from docs.tables.written import read


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
def simulated() -> Iterator[str]:
    """The last line of ``make sim``."""
    yield str(read("docs/data/verification/sim.json")["result"])


@claim("README.md")
def replayed() -> Iterator[str]:
    """Events of all images and encoders."""
    runs = read("docs/data/verification/replay.json")["runs"]
    images = {run["images"] for run in runs}
    assert len(images) == 1
    assert len(runs) == 3
    yield (
        f"every event of {images.pop()} texture scans and three encoders, {sum(run['events'] for run in runs):,} in all"
    )


@claim("README.md")
def highest_rate() -> Iterator[str]:
    """The rate that does not come out."""
    rates = read("docs/data/event_rates.json")["points"]
    (point,) = (p for p in rates if (p["encoding"], p["resolution"]) == ("lcs", 8))
    yield f"The 8 b LCS rate comes out {100 * (point['here_hz'] / point['published_hz'] - 1):.1f} % high"


@claim("README.md")
def spikes_win() -> Iterator[str]:
    """Where spikes take less power, and where not."""
    rows = {row["case"]: row for row in read("docs/data/sensitivity.json")["rows"]}
    published, corrected = rows["none (paper)"], rows["all (consistent)"]
    millivolts = {round(1e3 * published["crossover"][name]["noise_v_rms"], 1) for name in ("lcs", "nlcs")}
    assert min(min(ratios) for ratios in corrected["ratio"].values()) > 1
    corrections = {7: "seven"}[len(corrected["corrections"])]
    yield f"from {min(millivolts)} mV of noise on, but with {corrections} corrections, each a switch, they do not"


@claim("README.md")
def frames_win() -> Iterator[str]:
    """Frames against spikes at a fifth of the published data rate."""
    first, second, low, high = _points(_pair("rates-cnn:lcs-4", "rates-cnn:frame-diff-250-8"))
    yield (
        f"At a fifth of 640 kb/s frames win with convolutions ({second:.1f} against {first:.1f} %, difference "
        f"{low:.1f} to {high:.1f} points over images)"
    )


@claim("README.md")
def spikes_win_small() -> Iterator[str]:
    """Spikes against frames at the same rate, with the paper's network."""
    first, second, low, high = _points(_pair("rates-paper:lcs-4", "rates-paper:frame-onoff-250-8"))
    yield f"LCS with the paper's network ({first:.1f} against {second:.1f} %, {low:.1f} to {high:.1f})"


@claim("README.md")
def spikes_ahead() -> Iterator[str]:
    """At a fortieth."""
    pairs = [
        _pair("rates-paper:lcs-2", "rates-paper:frame-onoff-31.25-8"),
        _pair("rates-cnn:lcs-2", "rates-cnn:frame-diff-31.25-8"),
    ]
    points = [f"{abs(100 * pair['difference']):.0f}" for pair in pairs]
    yield f"At a fortieth LCS is ahead with both, by {points[0]} and {points[1]} points"


@claim("README.md")
def times_known() -> Iterator[str]:
    """How well events tell a time."""
    (row,) = (row for row in read("docs/data/classifier/merits.json")["timing"] if row["known_from"] == "events")
    yield f"events know times to {1e6 * row['median_s']:.0f} us"


@claim("README.md")
def laid_out() -> Iterator[str]:
    """The layout in the picture."""
    kept = read("docs/data/layout/lcs-digital-2x2-6b.json")
    rows, columns = (kept["configuration"][side] for side in ("rows", "columns"))
    assert not kept["rules"]["violations"]
    yield f"{rows} x {columns} taxels in SkyWater 130 nm rules, {kept['width_um']:.0f} x {kept['height_um']:.0f} um"
