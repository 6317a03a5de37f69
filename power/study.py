"""Data of Fig. 6, Fig. 7 and the sensitivity study, as dictionaries for JSON (docs/results/power.md)."""

from typing import Any

from eskin.power.equations import PowerModel
from eskin.power.parameters import MAX_RESOLUTION, MIN_RESOLUTION
from eskin.power.rates import TAUS_S
from eskin.power.readouts import READOUTS

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
