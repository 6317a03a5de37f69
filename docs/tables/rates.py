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


@table
def other_rates() -> str:
    """Rates of the other scans and textures, from those of their taxels that the power model reads."""
    tables = {(t["dataset"], t["preset"]): t for t in read("model/power/event_rates.json")["tables"]}
    chosen = [("kylberg", "physical"), ("embedded", "paper"), ("embedded", "physical")]
    rows = []
    for encoding, resolution in (("lcs", 2), ("lcs", 4), ("lcs", 6), ("nlcs", 4), ("nlcs", 8)):
        cells = []
        for kept in (tables[key] for key in chosen):
            of_resolution = kept["lcs_hz"] if encoding == "lcs" else kept["nlcs_hz"][kept["taus_s"].index(0.2)]
            cells.append(f"{sum(of_resolution[kept['resolutions'].index(resolution)]):,.0f}")
        rows.append([f"{ENCODERS[encoding]} {resolution} b", *cells])
    return markdown(["readout", *(f"{dataset.capitalize()}, `{preset}`" for dataset, preset in chosen)], rows)
