"""Fig. 7 in both modes: the AFE noise at which spikes and frames need equal power, by resolution."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eskin.base.figures.style import PALETTE, dress, legend_below, new_figure, save_figure
from eskin.power.equations import PowerModel
from eskin.power.rates import TAUS_S
from eskin.power.study import RESOLUTIONS, crossovers
from eskin.skin.figures.readouts import look
from studies.fig6 import both_modes, origin_of
from studies.study import Data, Result, run

NOISE_V = 1e-3
"""Noise in volts rms for the power ratios."""


def compute() -> Data:
    """Return crossover noise, cheaper side and power ratio by mode."""
    return fig7_data(both_modes())


def fig7_data(models: Mapping[str, PowerModel]) -> Data:
    """Return the data of Fig. 7 by mode: crossover noise, cheaper side, and power ratio at 1 mV."""
    return {
        **origin_of(models.values()),
        "resolution": list(RESOLUTIONS),
        "unit": "V",
        "ratio_noise_v_rms": NOISE_V,
        "modes": {
            mode: {
                "crossover": crossovers(model),
                "spikes_win": crossovers(model, "spikes_win"),
                "ratio": _ratios(model),
            }
            for mode, model in models.items()
        },
    }


def _ratios(model: PowerModel) -> Data:
    """Return spiking / frame power at 1 mV for N = 1..10, by readout and time constant."""
    bits = list(RESOLUTIONS)
    frame = model.breakdown("frame", bits, NOISE_V).total
    ratio = {str(tau): (model.breakdown("nlcs", bits, NOISE_V, tau).total / frame).tolist() for tau in TAUS_S}
    return {"lcs": (model.breakdown("lcs", bits, NOISE_V).total / frame).tolist(), "nlcs": ratio}


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


RESULT = Result("fig7", compute, plot_fig7)

if __name__ == "__main__":
    run("fig7", RESULT)
