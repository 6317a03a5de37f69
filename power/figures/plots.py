"""Plots of the power model from stored data."""

from pathlib import Path
from typing import Any

from eskin.base.figures.style import GREY, dress, legend_below, new_figure, save_figure
from eskin.power.readouts import READOUT_NAMES, READOUTS
from eskin.skin.figures.readouts import look

Data = dict[str, Any]


def plot_explore(data: Data, path: Path) -> None:
    """Plot the total power of the readouts against the resolution."""
    table = data["table"]
    resolutions = [row["resolution"] for row in table]
    sensor = data["sensor"]
    title = f"{sensor['rows']} x {sensor['columns']} taxels, {sensor['bandwidth_hz']:g} Hz, "
    figure = new_figure(6.4, 4.0, title + f"{sensor['noise_v_rms'] * 1e3:g} mV")
    panel = figure.subplots()
    dress(panel, "", "resolution N (bit)", "power (W)")
    for readout in READOUTS:
        totals, (_, colour, marker) = [row[readout]["total"] for row in table], look(readout)
        panel.plot(resolutions, totals, color=colour, marker=marker, lw=1.3, ms=5, label=READOUT_NAMES[readout])
    best = data["cheapest"]
    panel.plot(best["resolution"], best["total"], "o", ms=14, mfc="none", mec=GREY, mew=1.2)
    finest = data["noise_resolution"]
    if finest < resolutions[-1]:
        panel.axvspan(finest + 0.5, resolutions[-1] + 0.5, color="#eeeeee", zorder=0)
        panel.text(finest + 0.6, 0.02, "below the noise", fontsize=8, color=GREY, va="bottom",
                   transform=panel.get_xaxis_transform())  # fmt: skip
    panel.set_yscale("log")
    panel.set_xticks(resolutions)
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    save_figure(figure, path)
