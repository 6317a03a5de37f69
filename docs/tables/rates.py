"""Event rates beside the published ones."""

from __future__ import annotations

from typing import Any

from docs.tables.written import ENCODERS, markdown, read, table


def rates() -> list[dict[str, Any]]:
    """Return the rates that the paper gives, beside ours: Kylberg, ``paper``, N-LCS with 200 ms."""
    return list(read("docs/data/event_rates.json")["points"])


def stored_hz(encoding: str, resolution: int) -> float:
    """Return the same rate of the array from the rates of its taxels that the power model reads."""
    stored = read("model/power/event_rates.json")["tables"][0]
    assert (stored["dataset"], stored["preset"]) == ("kylberg", "paper")
    of_resolution = stored["lcs_hz"] if encoding == "lcs" else stored["nlcs_hz"][stored["taus_s"].index(0.2)]
    return float(sum(of_resolution[stored["resolutions"].index(resolution)]))


@table
def event_rates() -> str:
    """Published rates, those of float samples, and ours."""
    rows = [
        [f"{ENCODERS[point['encoding']]} {point['resolution']} b"]
        + [f"{point[name]:,.1f}" for name in ("published_hz", "float_samples_hz", "here_hz")]
        + [f"{100 * (point['here_hz'] / point['published_hz'] - 1):+.2f} %"]
        for point in rates()
    ]
    return markdown(["readout", "published", "float samples", "here (integer)", "difference"], rows)
