"""Sensitivity: the effect of each correction of the power model on the ratio of spiking to frame power."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

from eskin.base.figures.style import PALETTE, dress, legend_below, new_figure, save_figure
from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.rates import RateTable, load_tables
from eskin.power.readouts import READOUT_NAMES, SPIKING
from eskin.power.study import FIG_RESOLUTION, FIG_TAU_S
from eskin.skin.figures.readouts import look
from studies.fig6 import NOISE_V, both_modes, origin_of
from studies.study import Data, Result, run

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


def compute() -> Data:
    """Return power ratios and crossovers of every case."""
    model = both_modes()["consistent"]
    used = (model.measured.dataset, model.measured.preset)  # type: ignore[union-attr]
    others = {f"{t.dataset} {t.preset} scan": t for t in load_tables() if (t.dataset, t.preset) != used}
    return sensitivity_data(sensitivity_models(model, others))


def sensitivity_models(model: PowerModel, other_rates: Mapping[str, RateTable]) -> dict[str, tuple[str, PowerModel]]:
    """Return the models of the sensitivity study by name, each with its group.

    ``model`` has measured rates; its corrections are replaced. ``other_rates`` are rates and bandwidths to put in place
    of the model's, by the name of the case.
    """
    everything = frozenset(CORRECTIONS)

    def change(corrections: frozenset[str], **parameters: float) -> PowerModel:
        changed = model.parameters.replace(**parameters)
        return dataclasses.replace(model, corrections=corrections, parameters=changed)

    cases = {"none (paper)": ("alone", change(frozenset()))}
    cases |= {name: ("alone", change(frozenset({name}))) for name in CORRECTIONS}
    cases |= {"all (consistent)": ("together", change(everything))}
    cases |= {f"all but {name}": ("together", change(everything - {name})) for name in CORRECTIONS}
    for volts in (5.0, 3.3, 1.8):
        for toggle in (1.0, 0.5):
            name = f"all, pads {volts:g} V, toggle {toggle:g}"
            cases[name] = ("variants", change(everything, pads_voltage_v=volts, pads_toggle=toggle))
    for factor in (1.2, 6.0):
        cases[f"all, NEF {factor:g}"] = ("variants", change(everything, noise_efficiency=factor))
    cases["all, shared AFE settles"] = ("variants", change(everything, shared_afe_bandwidth=settling_bandwidth(model)))
    for name, table in other_rates.items():
        varied = change(everything, signal_bandwidth_hz=table.bandwidth_hz)
        cases[f"all, {name}"] = ("variants", dataclasses.replace(varied, measured=table))
    return cases


def settling_bandwidth(model: PowerModel) -> float:
    """Return the AFE bandwidth, relative to M BW, that settles to half an LSB at 6 b in a tenth of a sample."""
    p = model.parameters
    time_constants = -math.log(p.settling_error_lsb * 2.0**-FIG_RESOLUTION)
    return 2 * time_constants / (2 * math.pi * p.settling_share)


def sensitivity_data(cases: Mapping[str, tuple[str, PowerModel]]) -> Data:
    """Return the power ratio at each noise target of Fig. 6 and the crossover of every case."""
    rows = []
    for name, (group, model) in cases.items():
        frame = model.breakdown("frame", FIG_RESOLUTION, NOISE_V).total
        ratios = {s: model.breakdown(s, FIG_RESOLUTION, NOISE_V, FIG_TAU_S).total / frame for s in SPIKING}
        rows.append(
            {
                "case": name,
                "group": group,
                "corrections": [c for c in CORRECTIONS if c in model.corrections],
                "ratio": {s: ratio.tolist() for s, ratio in ratios.items()},
                "crossover": {s: dataclasses.asdict(model.crossover(s, FIG_RESOLUTION, FIG_TAU_S)) for s in SPIKING},
            }
        )
    return {
        **origin_of(model for _, model in cases.values()),
        "resolution": FIG_RESOLUTION,
        "tau_s": FIG_TAU_S,
        "noise_v_rms": list(NOISE_V),
        "ratio": "spiking power / frame power",
        "rows": rows,
    }


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


def in_words(case: str) -> str:
    """Return the label of a case of the sensitivity study.

    Examples
    --------
    >>> in_words("all but afe_nef")
    'all but noise efficiency of the AFE'
    """
    before, _, last = case.rpartition(" ")
    return f"{before} {CORRECTIONS_IN_WORDS.get(last, last)}".strip()


RESULT = Result("sensitivity", compute, plot_sensitivity)

if __name__ == "__main__":
    run("sensitivity", RESULT)
