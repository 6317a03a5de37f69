"""Find the readout and resolution with the least power for a sensor (docs/guide/power.md)."""

import math
from dataclasses import dataclass
from typing import Any

from eskin.base.errors import InputError
from eskin.power.equations import FloatArray, PowerModel, TaxelRates
from eskin.power.parameters import LARGEST, MAX_RESOLUTION, MIN_RESOLUTION, PowerParameters
from eskin.power.readouts import READOUTS, Readout, published
from eskin.power.study import RESOLUTIONS, breakdowns


@dataclass(frozen=True)
class GivenRates:
    """Event rates given by a user at one resolution, doubled for every further bit."""

    # lcs_hz, nlcs_hz: events/s of the whole array, all taxels alike
    lcs_hz: float
    nlcs_hz: float
    resolution: int  # N of the rates

    def __post_init__(self) -> None:
        for rate in (self.lcs_hz, self.nlcs_hz):
            if not (math.isfinite(rate) and 0 <= rate <= LARGEST):
                raise InputError(f"event rate must be a number of events/s from 0, not {rate:g}")

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the event rates of a spiking readout, independent of tau; see ``RateSource``."""
        rate = published(readout, lcs=self.lcs_hz, nlcs=self.nlcs_hz) * 2.0 ** (resolution - self.resolution)
        return TaxelRates.uniform(rate + 0 * tau_s, taxels)


def noise_resolution(parameters: PowerParameters, noise_v_rms: float) -> int:
    """Return the finest N in 1..10 whose quantisation noise LSB / sqrt 12 is at least the AFE noise."""
    finest = math.floor(math.log2(parameters.swing_v / (math.sqrt(12) * noise_v_rms)))
    return min(max(finest, MIN_RESOLUTION), MAX_RESOLUTION)


def explore_data(model: PowerModel, noise_v_rms: float, tau_s: float, least_resolution: int | None = None) -> Any:
    """Return the power of all readouts at all resolutions, and the cheapest choice.

    ``least_resolution``: least resolution of the cheapest choice; by default the finest that the noise allows.
    """
    table = []
    for n in RESOLUTIONS:
        row: dict[str, Any] = {"resolution": n, **breakdowns(model, n, noise_v_rms, tau_s)}
        row["cheapest"] = min(READOUTS, key=lambda r: row[r]["total"])
        table.append(row)
    finest = noise_resolution(model.parameters, noise_v_rms)
    if least_resolution is None:
        least_resolution = finest
    if not MIN_RESOLUTION <= least_resolution <= MAX_RESOLUTION:
        raise InputError(f"min-resolution must be in {MIN_RESOLUTION}..{MAX_RESOLUTION}, not {least_resolution}")
    allowed = [(row[r]["total"], row["resolution"], r) for row in table[least_resolution - 1 :] for r in READOUTS]
    total, resolution, readout = min(allowed)
    return {
        "sensor": {
            "rows": model.parameters.rows,
            "columns": model.parameters.columns,
            "bandwidth_hz": model.bandwidth_hz,
            "noise_v_rms": noise_v_rms,
            "supply_v": model.parameters.supply_v,
            "pads_voltage_v": model.parameters.pads_voltage_v,
            "pads_toggle": model.parameters.pads_toggle,
            "tau_s": tau_s,
        },
        "unit": "W",
        "noise_resolution": finest,
        "least_resolution": least_resolution,
        "cheapest": {"readout": readout, "resolution": resolution, "total": total},
        "table": table,
    }
