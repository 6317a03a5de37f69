"""Plot the study of slow signals."""

from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.model.encoders import registry
from eskin.skin.figures.readouts import FRAME, look
from eskin.skin.recordings.fitting import TAU_S


def plot_study(data: dict[str, Any], path: Path) -> None:
    """Plot SNR against data rate: one line for each encoder and one for uniform sampling."""
    figure = new_figure(7.2, 4.4, f"Slow signals: {data['source']}, {data['rate_hz']:g} samples/s")
    panel = figure.subplots()
    dress(panel, "", "data rate (bit/s)", "reconstruction SNR (dB)")
    for encoder in registry.ENCODERS:
        line = [p for p in data["points"] if p["encoding"] == encoder.name and p["data_rate_bps"] > 0]
        places = [(point["data_rate_bps"], point["snr_db"]) for point in line]
        label = encoder.title + (f", tau {1e3 * TAU_S:g} ms" if encoder.leaks else "")
        style: dict[str, Any] = {"color": encoder.colour, "marker": encoder.marker, "lw": 1.3, "ms": 5}
        panel.plot(*np.reshape(places, (-1, 2)).T, label=label, **style)
        if encoder is registry.ENCODERS[0]:  # the lines are alike: labels at one line are enough
            for point, place in zip(line, places, strict=True):
                panel.annotate(f"{point['resolution']} b", place, xytext=(-4, 5), textcoords="offset points",
                               ha="right", fontsize=7.5, color=encoder.colour)  # fmt: skip
    same = sorted((p["data_rate_bps"], p["uniform"]["snr_db"]) for p in data["points"] if p["uniform"])
    frame, label = look(FRAME), "uniform sampling, best bits for the rate"
    panel.plot(*zip(*same, strict=True), color=frame.colour, marker=frame.marker, ms=3, lw=1.0, ls="--", label=label)
    panel.set_xscale("log")
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    save_figure(figure, path)
