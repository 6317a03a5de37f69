"""Fig. 6 in both modes: power of the readouts at three noise targets; also with measured digital logic."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from eskin.base.figures.style import GREY, PALETTE, PART_COLOURS, dress, legend_below, new_figure, save_figure
from eskin.base.units import with_unit
from eskin.power.build import build_model
from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.rates import RateTable, stored_table
from eskin.power.readouts import READOUT_NAMES, READOUTS
from eskin.power.study import FIG_RESOLUTION, FIG_TAU_S, breakdowns
from studies.study import DATA, Data, Result, run

NOISE_V = (1e-4, 10 ** (-4 + 2 * 14 / 29), 1e-2)
"""Noise targets in volts rms: 0.1, 0.924 and 10 mV; 0.924 mV is the original's grid point for 1 mV."""

LIBRARIES = ("ihp", "osu")
"""Cell libraries on whose netlists the power of the digital logic was measured (docs/results/asic.md)."""

PART_NAMES = {"afe": "AFE", "converter": "converter", "io": "I/O"}


def compute(library: str | None = None) -> Data:
    """Return a power breakdown for every mode and noise target; of a library, with the measured logic."""
    names = ("lcs-analog-8x8", "nlcs-analog-8x8", "frame-8x8") if library else ()
    return fig6_data(both_modes([DATA / "asic" / f"{name}-{library}.json" for name in names]))


def both_modes(synthesis: Sequence[Path] = ()) -> dict[str, PowerModel]:
    """Return the power models of both modes, by mode name; ``synthesis`` are reports of the digital parts."""
    return {
        "paper": build_model(frozenset(), (), None, stored_table),
        "consistent": build_model(frozenset(CORRECTIONS), (), synthesis, stored_table),
    }


def origin_of(models: Iterable[PowerModel]) -> Data:
    """Return the array size of several models, and the first measured event rates among them."""
    data: Data = {}
    for model in models:
        data |= {"rows": model.parameters.rows, "columns": model.parameters.columns}
        if isinstance(table := model.measured, RateTable):
            return data | {"event_rates": f"{table.dataset}, {table.preset} scan, {table.images} images"}
    return data


def fig6_data(models: Mapping[str, PowerModel]) -> Data:
    """Return the data of Fig. 6: a power breakdown for every mode and noise target."""
    return {
        **origin_of(models.values()),
        "resolution": FIG_RESOLUTION,
        "tau_s": FIG_TAU_S,
        "noise_v_rms": list(NOISE_V),
        "unit": "W",
        "modes": {
            mode: [breakdowns(model, FIG_RESOLUTION, noise, FIG_TAU_S) for noise in NOISE_V]
            for mode, model in models.items()
        },
    }


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


RESULTS = (
    Result("fig6", compute, plot_fig6),
    *(Result(f"asic/{name}/fig6", partial(compute, name)) for name in LIBRARIES),
)

if __name__ == "__main__":
    run("fig6", *RESULTS)
