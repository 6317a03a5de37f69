"""Data of Fig. 6, Fig. 7 and the sensitivity study, as dictionaries for JSON (docs/results/power.md)."""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.parameters import MAX_RESOLUTION, MIN_RESOLUTION
from eskin.power.rates import TAUS_S, RateTable
from eskin.power.readouts import READOUTS, SPIKING

FIG6_NOISE_V = (1e-4, 10 ** (-4 + 2 * 14 / 29), 1e-2)
"""Noise targets of Fig. 6 in volts rms: 0.1, 0.924 and 10 mV; 0.924 mV is the original's grid point for 1 mV."""

FIG7_NOISE_V = 1e-3
"""Noise in volts rms for the power ratios of Fig. 7."""

FIG_RESOLUTION = 6
FIG_TAU_S = 0.2
RESOLUTIONS = range(MIN_RESOLUTION, MAX_RESOLUTION + 1)

Data = dict[str, Any]


def breakdowns(model: PowerModel, resolution: int, noise_v_rms: float, tau_s: float) -> Data:
    """Return the power breakdown of the three readouts in watts, by readout."""
    return {name: model.breakdown(name, resolution, noise_v_rms, tau_s).to_dict() for name in READOUTS}


def crossovers(model: PowerModel, what: str = "noise_v_rms") -> Data:
    """Return the crossover noise in volts for N = 1..10, None without one; or another field of ``Crossover``."""

    def line(readout: Any, tau_s: float) -> list[Any]:
        return [getattr(model.crossover(readout, n, tau_s), what) for n in RESOLUTIONS]

    return {"lcs": line("lcs", FIG_TAU_S), "nlcs": {str(tau): line("nlcs", tau) for tau in TAUS_S}}


def _origin(models: Iterable[PowerModel]) -> Data:
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
        **_origin(models.values()),
        "resolution": FIG_RESOLUTION,
        "tau_s": FIG_TAU_S,
        "noise_v_rms": list(FIG6_NOISE_V),
        "unit": "W",
        "modes": {
            mode: [breakdowns(model, FIG_RESOLUTION, noise, FIG_TAU_S) for noise in FIG6_NOISE_V]
            for mode, model in models.items()
        },
    }


def fig7_data(models: Mapping[str, PowerModel]) -> Data:
    """Return the data of Fig. 7 by mode: crossover noise, cheaper side, and power ratio at 1 mV."""
    return {
        **_origin(models.values()),
        "resolution": list(RESOLUTIONS),
        "unit": "V",
        "ratio_noise_v_rms": FIG7_NOISE_V,
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
    frame = model.breakdown("frame", bits, FIG7_NOISE_V).total
    ratio = {str(tau): (model.breakdown("nlcs", bits, FIG7_NOISE_V, tau).total / frame).tolist() for tau in TAUS_S}
    return {"lcs": (model.breakdown("lcs", bits, FIG7_NOISE_V).total / frame).tolist(), "nlcs": ratio}


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
        frame = model.breakdown("frame", FIG_RESOLUTION, FIG6_NOISE_V).total
        ratios = {s: model.breakdown(s, FIG_RESOLUTION, FIG6_NOISE_V, FIG_TAU_S).total / frame for s in SPIKING}
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
        **_origin(model for _, model in cases.values()),
        "resolution": FIG_RESOLUTION,
        "tau_s": FIG_TAU_S,
        "noise_v_rms": list(FIG6_NOISE_V),
        "ratio": "spiking power / frame power",
        "rows": rows,
    }


def crossover_text(crossover: dict[str, Any]) -> str:
    """Return a crossover as text: ``above 0.54 mV``, ``never``."""
    value = crossover["noise_v_rms"]
    side = str(crossover["spikes_win"])
    return side if value is None else f"{side} {value * 1e3:.3g} mV"
