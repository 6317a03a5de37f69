"""Trained networks under disturbances."""

from __future__ import annotations

from typing import Any

from docs.tables.written import markdown, read, table


def disturbed() -> dict[tuple[str, float], dict[str, dict[str, Any]]]:
    """Return the points by disturbance and strength, then by network."""
    found: dict[tuple[str, float], dict[str, dict[str, Any]]] = {}
    for point in read("docs/data/classifier/robustness.json")["points"]:
        found.setdefault((point["disturbance"], point["strength"]), {})[point["network"]] = point
    return found


@table
def robustness() -> str:
    """Accuracy of both networks under every disturbance, in per cent."""
    rows = []
    for (name, strength), networks in disturbed().items():
        cells = []
        for network in ("clean", "robust"):
            low, high = (100 * end for end in networks[network]["bootstrap_95"])
            cells.append(f"{100 * networks[network]['accuracy']:.1f} ({low:.0f} to {high:.0f})")
        what = name if name == "clean" else f"{name} {strength:g}"
        rows.append([what, *cells, f"{networks['clean']['rate_hz']:,.0f}"])
    return markdown(["disturbance", "clean", "robust", "events/s"], rows)
