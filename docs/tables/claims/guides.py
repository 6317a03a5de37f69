"""What the guides and the reference claim."""

from __future__ import annotations

from collections.abc import Iterator

from docs.tables.claims import claim
from docs.tables.fpga import routed
from docs.tables.rates import rates
from docs.tables.written import read


@claim("docs/guide/classifier.md")
def steps() -> Iterator[str]:
    """Events of a channel in a step of the network."""
    per_channel = {p["resolution"]: p["here_hz"] * 0.004 / 128 for p in rates() if p["encoding"] == "lcs"}
    yield f"At 8 b a channel has {per_channel[8]:.0f} events a step (`paper`, 4 ms), at 2 b {per_channel[2]:.2f};"


@claim("docs/reference/classifier.md")
def beside_others() -> Iterator[str]:
    """What the classifier alone takes of an FPGA."""
    kept = routed()["classifier-8b"]
    assert "MULT18X18D" not in {kind for kind, count in kept["used"].items() if count}
    yield f"{kept['block_rams']} block RAMs | {kept['luts']:,} LUT4, no multiplier"


@claim("docs/guide/recordings.md")
def slow() -> Iterator[str]:
    """What the encoders give on slow signals."""
    kept = read("docs/data/study.json")
    found = {(p["encoding"], p["resolution"]): p for p in kept["points"]}
    yield f"generated signals of {kept['rows'] * kept['columns']} taxels at {kept['rate_hz']:g} samples/s"

    def ahead(bits: int) -> float:
        return float(found["lcs", bits]["snr_db"] - found["lcs", bits]["uniform"]["snr_db"])

    gains = [found["lcs", bits + 1]["snr_db"] - found["lcs", bits]["snr_db"] for bits in range(2, 8)]
    even = [ahead(bits) for bits in range(2, 8)]
    yield (
        f"LCS gains about {sum(gains) / len(gains):.0f} dB for twice the data rate, and has {min(even):.0f} to "
        f"{max(even):.0f} dB more than uniform sampling up to 7 bit"
    )
    whole = min(p["data_rate_bps"] for p in found.values() if p["uniform"]["frame_rate_hz"] >= kept["rate_hz"])
    assert 13e3 < whole < 16e3
    levels = {f"{found['nlcs', bits]['snr_db']:.0f}" for bits in range(3, 11)}
    assert len(levels) == 1
    yield f"N-LCS stays at {levels.pop()} dB"
    six, eight = (found["cw-lcs", bits]["snr_db"] for bits in (6, 8))
    yield f"has {six:.0f} dB at 6 bit and {eight:.0f} dB at 8 bit"
