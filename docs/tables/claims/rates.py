"""What the pages of event rates, of arbiters under load and of speed claim."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import Any

from docs.tables.claims import claim
from docs.tables.rates import rates
from docs.tables.written import read


@claim("docs/results/event_rates.md")
def quantised() -> Iterator[str]:
    """What the bits of a sample change."""
    apart = {
        encoding: max(
            abs(100 * (p["here_hz"] / p["float_samples_hz"] - 1)) for p in rates() if p["encoding"] == encoding
        )
        for encoding in ("lcs", "nlcs")
    }
    bound = ceil(100 * apart["lcs"]) / 100
    yield (
        f"W = 12 changes the rates of LCS above by less than {bound:.2f} %, those of N-LCS by at most "
        f"{apart['nlcs']:.2f} %"
    )


def waits(load: str, asked: float, arbiter: str) -> dict[str, Any]:
    """Return the line of an arbiter under a load."""
    lines = read("benchmarks/results/load.json")["results"]
    (line,) = (
        one for one in lines if (one["load"], one["asked"]) == (load, asked) and one["arbiter"].startswith(arbiter)
    )
    return dict(line)


@claim("docs/results/load.md")
def loads() -> Iterator[str]:
    """Bound, worst case and fairness."""
    kept = read("benchmarks/results/load.json")
    ours = [line for line in kept["results"] if line["arbiter"].endswith("(ours)")]
    flat = [line for line in kept["results"] if line["arbiter"] == "flat round robin"]
    longest, of_flat = (max(line["worst_wait"] for line in lines) for lines in (ours, flat))
    assert longest <= kept["bound"]
    assert longest == waits("all at once", 1.2, "rows")["worst_wait"]
    yield (
        f"(rows + 1) columns events and 2 clocks, is {kept['bound']} here; the longest wait measured is {longest}, "
        "with "
        f"every taxel asking all the time. A flat round robin waits {of_flat} then, since it knows no bursts: up to "
        f"{100 * (longest / of_flat - 1):.0f} % is the price"
    )
    pairs = [
        [waits(load, asked, name)["worst_wait"] for name in ("binary", "rows")]
        for load, asked in (("uniform", 0.9), ("hot spot", 1.2))
    ]
    yield (
        f"a longer tail: {pairs[0][0]} clocks against {pairs[0][1]} at uniform load, {pairs[1][0]} against "
        f"{pairs[1][1]} at the hot spot"
    )
    met = {f"{line['jain']:.3f}" for line in ours if line["asked"] < 1}
    assert len(met) == 1
    yield f"Jain's index is {met.pop()} wherever demand can be met"
    last = round(waits("all at once", 0.9, "rows")["by_address"][1])
    yield (
        f"the time stamp of the last address is {last} clocks late, always. At 1.28 MHz these are {last / 1280:.1f} ms"
    )


@claim("docs/results/speed.md")
def layer() -> Iterator[str]:
    """How often hidden neurons fire in the benchmark, and the encoder's time."""
    few, many = (100 * one["spikes_per_step"] for one in read("benchmarks/results/network.json")["results"])
    yield f"The hidden neurons fire in {few:.0f} % of the steps in the first column, in {many:.0f} % in the second"
    (lcs,) = (one for one in read("benchmarks/results/encoder.json")["results"] if one["name"] == "lcs")
    yield f"reads, checks and encodes in {lcs['times_the_copy']['median']:.1f} times the time of the copy"
    kept = read("benchmarks/results/encoder.json")
    yield f"{kept['signals']:,} signals of {kept['samples']:,} samples"


def rounding() -> float:
    """Return by how much the rounded leak is off at most, in per cent, where the reference has enough bits."""
    kept = read("benchmarks/results/leak.json")
    return max(
        float(worst)
        for one in kept["results"]
        for fraction, worst in one["fractions"].items()
        if int(fraction) >= one["resolution"] + 14 - kept["sample_bits"]
    )


@claim("docs/reference/encoders.md")
def leak() -> Iterator[str]:
    """What the leak of N-LCS in integers costs."""
    yield f"The rounding of the leak costs less than {ceil(10 * rounding()) / 10:.1f} % for every constant input"
    moving = max(abs(one["moving"]) for one in read("benchmarks/results/leak.json")["results"])
    yield f"the difference is below {ceil(10 * moving) / 10:.1f} %"


@claim("docs/specification.md")
def specified() -> Iterator[str]:
    """What the specification says of rates."""
    yield f"the event rate is within {ceil(10 * rounding()) / 10:.1f} % of the float model"
    (high,) = (p for p in rates() if (p["encoding"], p["resolution"]) == ("lcs", 8))
    apart = high["here_hz"] / high["published_hz"] - 1
    yield f"published as {high['published_hz']:,.0f}, is known to come out {100 * apart:.1f} % high"
