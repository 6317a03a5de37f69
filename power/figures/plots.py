"""Plots of the power model from stored data."""

import math
from pathlib import Path
from typing import Any

from eskin.base.figures.style import GREY, PALETTE, PART_COLOURS, dress, legend_below, new_figure, save_figure
from eskin.base.units import with_unit
from eskin.power.readouts import READOUT_NAMES, READOUTS, SPIKING
from eskin.skin.figures.readouts import look

Data = dict[str, Any]

PART_NAMES = {"afe": "AFE", "converter": "converter", "io": "I/O"}


def plot_fig6(data: Data, path: Path) -> None:
    """Plot the power of AFE, converter and I/O, and their sum, at each noise target, one panel per mode.

    Not stacked: on a logarithmic axis the parts of a stack have heights that say nothing.
    """
    modes = data["modes"]
    title = f"Power of the readouts, N = {data['resolution']}, {data['rows']} x {data['columns']} taxels"
    figure = new_figure(5.6 * len(modes), 4.0, title)
    panels = figure.subplots(1, len(modes), sharey=True, squeeze=False)[0]
    powers = [
        e[r][part] for mode in modes.values() for e in mode for r in READOUTS for part in (*PART_COLOURS, "total")
    ]
    floor = 10 ** math.floor(math.log10(min(power for power in powers if power > 0)))
    for panel, (mode, entries) in zip(panels, modes.items(), strict=True):
        dress(panel, f"{mode} mode")
        positions, names = [], []
        for group, (noise, entry) in enumerate(zip(data["noise_v_rms"], entries, strict=True)):
            for k, readout in enumerate(READOUTS):
                x = 3.7 * group + k
                positions.append(x)
                names.append(READOUT_NAMES[readout])
                for place, (part, colour) in zip((-0.28, 0.0, 0.28), PART_COLOURS.items(), strict=True):
                    panel.bar(x + place, entry[readout][part], width=0.26, color=colour, label=PART_NAMES[part])
                total = entry[readout]["total"]
                panel.plot([x - 0.41, x + 0.41], [total, total], color=PALETTE["black"], lw=1.4, label="sum")
                panel.text(x, total * 1.15, with_unit(total, "W"), ha="center", va="bottom", fontsize=6.3, color=GREY)
            panel.text(3.7 * group + 1, -0.15, f"noise {noise * 1e3:.3g} mV rms", ha="center", va="top", fontsize=8.5,
                       transform=panel.get_xaxis_transform())  # fmt: skip
        panel.set_yscale("log")
        panel.set_ylim(floor, max(powers) * 6)
        panel.set_xticks(positions, names, fontsize=7, rotation=35, ha="right", rotation_mode="anchor")
    panels[0].set_ylabel("power (W)", fontsize=8.5)
    handles, labels = panels[0].get_legend_handles_labels()
    shown = dict(zip(labels, handles, strict=True))
    legend_below(figure, (shown.values(), shown), 4)
    save_figure(figure, path)


def plot_fig7(data: Data, path: Path) -> None:
    """Plot the crossover noise and the power ratio against the resolution.

    Lines end where there is no crossover. A mode in which there is none at all gets no panel, but a sentence.
    """
    modes = data["modes"]
    crossing = {
        mode: entry for mode, entry in modes.items() if any(_found(data, v) for v in _values(entry["crossover"]))
    }
    notes = [_without_crossover(data, mode, entry) for mode, entry in modes.items() if mode not in crossing]
    figure = new_figure(4.8 * (len(crossing) + 1), 3.9, "AFE noise at which spikes cost what frames cost")
    panels = figure.subplots(1, len(crossing) + 1, sharex=True, squeeze=False)[0]
    for panel, (mode, entry) in zip(panels[:-1], crossing.items(), strict=True):
        dress(panel, f"{mode} mode", "resolution N (bit)", "AFE output noise (mV rms)")
        panel.sharey(panels[0])
        for (label, style), values in zip(_lines(entry["crossover"]), _values(entry["crossover"]), strict=True):
            if found := _found(data, values):
                panel.plot(*zip(*found, strict=True), label=label, **style)
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter(lambda volts, _: f"{1e3 * volts:g}")
    mode, entry = list(modes.items())[-1]
    title = f"{mode} mode, {data['ratio_noise_v_rms'] * 1e3:.3g} mV"
    dress(panels[-1], title, "resolution N (bit)", "power of spikes / power of frames")
    for (label, style), ratios in zip(_lines(entry["ratio"]), _values(entry["ratio"]), strict=True):
        panels[-1].plot(data["resolution"], ratios, label=label, **style)
    panels[-1].axhline(1.0, color=PALETTE["black"], lw=0.8)
    panels[-1].set_yscale("log")
    panels[-1].yaxis.set_major_formatter(lambda ratio, _: f"{ratio:g}")
    for panel in panels:
        panel.set_xticks(data["resolution"])
    keys = panels[-1].get_legend_handles_labels()
    legend_below(figure, keys, 4, "\n".join(notes), handlelength=3, title_fontsize=7.5)
    save_figure(figure, path)


def _found(data: Data, values: list[Any]) -> list[tuple[int, float]]:
    return [(n, value) for n, value in zip(data["resolution"], values, strict=True) if value is not None]


def _without_crossover(data: Data, mode: str, entry: Data) -> str:
    """Return a text that names the cheaper readout in a mode without a crossover."""
    lines = zip(_lines(entry["crossover"]), _values(entry["spikes_win"]), strict=True)
    sides: dict[str, list[str]] = {}
    for (label, _), line in lines:
        sides.setdefault(_ranges(data["resolution"], line), []).append(label)
    words = [f"{', '.join(labels)}: {ranges}" for ranges, labels in sides.items()]
    return "\n".join([f"In {mode} mode there is no crossover; at any noise less power is drawn by", *words])


def _lines(entry: Data) -> list[tuple[str, dict[str, Any]]]:
    """Return label and style of the lines of Fig. 7: N-LCS by time constant, then LCS."""
    lines = []
    nlcs = look("nlcs").colour
    for tau, line, marker, size in zip(entry["nlcs"], ("-", "--", ":"), "^sD", (9, 6, 4), strict=True):
        style = {"color": nlcs, "ls": line, "marker": marker, "ms": size, "mfc": nlcs if size == 9 else "white"}
        lines.append((f"N-LCS, tau {float(tau) * 1e3:g} ms", style | {"lw": 1.2}))
    lines.append(("LCS", {"color": look("lcs").colour, "marker": look("lcs").marker, "ms": 4, "lw": 1.2}))
    return lines


def _values(entry: Data) -> list[list[Any]]:
    """Return the values of the lines of Fig. 7, in the order of their labels."""
    return [*entry["nlcs"].values(), entry["lcs"]]


def _ranges(resolutions: list[int], sides: list[str]) -> str:
    """Return the cheaper readout at each resolution as text: ``spikes N = 1..4, frames N = 5..10``."""
    texts = []
    for side, name in (("always", "spikes"), ("never", "frames")):
        found = [n for n, s in zip(resolutions, sides, strict=True) if s == side]
        if found:
            texts.append(f"{name} N = {found[0]}" + (f"..{found[-1]}" if len(found) > 1 else ""))
    return ", ".join(texts)


def plot_sensitivity(data: Data, path: Path) -> None:
    """Plot the power of spikes relative to frames in every case, one panel per noise target."""
    rows = data["rows"]
    figure = new_figure(11, 0.235 * len(rows) + 1.3, f"Spiking power / frame power, N = {data['resolution']}")
    panels = figure.subplots(1, len(data["noise_v_rms"]), sharey=True, sharex=True, squeeze=False)[0]
    heights = list(range(len(rows)))
    for k, (panel, noise) in enumerate(zip(panels, data["noise_v_rms"], strict=True)):
        dress(panel, f"{noise * 1e3:.3g} mV rms")
        panel.axvline(1.0, color=PALETTE["black"], lw=0.8)
        for readout in SPIKING:
            ratios, (_, colour, marker) = [row["ratio"][readout][k] for row in rows], look(readout)
            panel.plot(ratios, heights, ls="", marker=marker, ms=6, color=colour, label=READOUT_NAMES[readout])
        for y in heights[1:]:
            if rows[y]["group"] != rows[y - 1]["group"]:
                panel.axhline(y - 0.5, color="#999999", lw=0.6, ls=":")
        panel.set_xscale("log")
        panel.xaxis.set_major_formatter(lambda ratio, _: f"{ratio:g}")
        panel.set_xlabel("power of spikes / power of frames\nleft of 1: spikes cost less", fontsize=8)
    panels[0].set_yticks(heights, [in_words(row["case"]) for row in rows], fontsize=8)
    panels[0].invert_yaxis()
    legend_below(figure, panels[0].get_legend_handles_labels(), 2)
    save_figure(figure, path)


CORRECTIONS_IN_WORDS = {
    "afe_settling": "settling of the AFE",
    "event_rates": "measured event rates",
    "comparators": "comparators at their own rate",
    "bandwidth": "bandwidth of the textures",
    "pads": "1.8 V pads",
    "afe_nef": "noise efficiency of the AFE",
    "digital": "synthesised logic",
}
"""Corrections of the power model in figures, by their names."""


def in_words(case: str) -> str:
    """Return the label of a case of the sensitivity study.

    Examples
    --------
    >>> in_words("all but afe_nef")
    'all but noise efficiency of the AFE'
    """
    before, _, last = case.rpartition(" ")
    return f"{before} {CORRECTIONS_IN_WORDS.get(last, last)}".strip()


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
