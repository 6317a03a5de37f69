"""The picture of the study of slow signals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from model.figures.style import READOUT_COLOURS, READOUT_MARKERS, dress, new_figure, save_figure


def plot_study(data: dict[str, Any], path: Path) -> None:
    """Draw SNR against data rate: a line for each encoder, and uniform sampling at the rates of LCS."""
    figure = new_figure(7.2, 4.4, f"Slow signals: {data['source']}, {data['rate_hz']:g} samples/s")
    panel = figure.subplots()
    dress(panel)
    names = {"lcs": "LCS", "cw-lcs": "CW-LCS", "nlcs": "N-LCS, tau 200 ms"}
    for encoding, name in names.items():
        line = [point for point in data["points"] if point["encoding"] == encoding and point["data_rate_bps"] > 0]
        panel.plot(
            [point["data_rate_bps"] for point in line],
            [point["snr_db"] for point in line],
            color=READOUT_COLOURS[encoding],
            marker=READOUT_MARKERS[encoding],
            lw=1.3,
            ms=5,
            label=name,
        )
        for point in line:
            if encoding == "lcs":
                panel.annotate(f"{point['resolution']} b", (point["data_rate_bps"], point["snr_db"]), xytext=(-4, 5),
                               textcoords="offset points", ha="right", fontsize=7.5,
                               color=READOUT_COLOURS[encoding])  # fmt: skip
    same = [(p["data_rate_bps"], p["uniform"]["snr_db"]) for p in data["points"] if p["uniform"]]
    panel.plot(
        *zip(*sorted(same), strict=True),
        color=READOUT_COLOURS["frame"],
        marker=READOUT_MARKERS["frame"],
        ms=3,
        lw=1.0,
        ls="--",
        label="uniform sampling, best bits for the rate",
    )
    panel.set_xscale("log")
    panel.set_xlabel("data rate (bit/s)", fontsize=8.5)
    panel.set_ylabel("reconstruction SNR (dB)", fontsize=8.5)
    panel.legend(fontsize=8, frameon=False, loc="upper left")
    save_figure(figure, path)
