"""Which readout, at which resolution, costs least for a given sensor; the command ``explore`` (docs/power.md)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from model.errors import InputError
from model.figures.results import DEFAULT_OUT, OutOption, write_results
from model.power import (
    CORRECTIONS,
    READOUT_NAMES,
    READOUTS,
    FloatArray,
    PowerModel,
    RateSource,
    Readout,
    TaxelRates,
)
from model.power_options import (
    DatasetOption,
    JsonOption,
    PresetOption,
    RatesOption,
    SettingsOption,
    SynthesisOption,
    rate_table,
)
from model.power_parameters import MAX_RESOLUTION, MIN_RESOLUTION, PowerParameters
from model.power_study import RESOLUTIONS, breakdowns


@dataclass(frozen=True)
class GivenRates:
    """Event rates that a user knows at one resolution; they double with every bit. A ``RateSource``.

    Attributes
    ----------
    lcs_hz, nlcs_hz : float
        Events/s of the whole array, all taxels alike.
    resolution : int
        N to which they belong.
    """

    lcs_hz: float
    nlcs_hz: float
    resolution: int

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the rates of a spiking readout, whatever the time constant; see ``RateSource``."""
        rate = (self.lcs_hz if readout == "lcs" else self.nlcs_hz) * 2.0 ** (resolution - self.resolution)
        return TaxelRates.uniform(rate + 0 * tau_s, taxels)


def noise_resolution(parameters: PowerParameters, noise_v_rms: float) -> int:
    """Return the finest N, 1..10, whose quantisation noise LSB / sqrt 12 is not below the AFE's noise."""
    finest = math.floor(math.log2(parameters.swing_v / (math.sqrt(12) * noise_v_rms)))
    return min(max(finest, MIN_RESOLUTION), MAX_RESOLUTION)


def explore_data(model: PowerModel, noise_v_rms: float, tau_s: float, least_resolution: int | None = None) -> Any:
    """Return the power of all readouts at all resolutions, and the cheapest.

    Parameters
    ----------
    model : PowerModel
    noise_v_rms, tau_s : float
    least_resolution : int, optional
        The cheapest has at least this resolution; by default the finest that the noise allows.
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


def explore(
    rows: Annotated[int, typer.Option(metavar="N", help="rows of taxels")] = 8,
    columns: Annotated[int, typer.Option(metavar="N", help="columns of taxels")] = 8,
    bandwidth: Annotated[float | None, typer.Option(metavar="HZ", help="of the signal [that of the textures]")] = None,
    noise: Annotated[float, typer.Option(metavar="V", help="AFE output noise, rms, for 1 V full scale")] = 1e-3,
    supply: Annotated[float | None, typer.Option(metavar="V", help="supply of the core [1]")] = None,
    pads_voltage: Annotated[float | None, typer.Option(metavar="V", help="supply of the pads [1.8]")] = None,
    pads_toggle: Annotated[float | None, typer.Option(metavar="SHARE", help="share of data bits charged [0.5]")] = None,
    tau: Annotated[float, typer.Option(metavar="SECONDS", help="time constant of N-LCS")] = 0.2,
    event_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="events/s of the whole array, instead of textures")
    ] = None,
    nlcs_event_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="the same of N-LCS [that of --event-rate]")
    ] = None,
    rate_resolution: Annotated[int, typer.Option(metavar="N", help="resolution to which these rates belong")] = 6,
    min_resolution: Annotated[
        int | None, typer.Option(metavar="N", help="resolution needed [the finest that the noise allows]")
    ] = None,
    dataset: DatasetOption = None,
    preset_name: PresetOption = "physical",
    rates: RatesOption = None,
    synthesis: SynthesisOption = None,
    settings: SettingsOption = None,
    out: OutOption = DEFAULT_OUT,
    as_json: JsonOption = False,
) -> None:
    """Show which readout and resolution cost least for your sensor."""
    from model.power_plots import plot_explore
    from model.synthesis import load_reports

    changes = {
        "rows": rows,
        "columns": columns,
        "signal_bandwidth_hz": bandwidth,
        "supply_v": supply,
        "pads_voltage_v": pads_voltage,
        "pads_toggle": pads_toggle,
    }
    parameters = PowerParameters().replace(**{k: v for k, v in changes.items() if v is not None})
    parameters = parameters.with_settings(settings or [])
    gates = load_reports(synthesis or [])
    PowerModel().breakdown("frame", rate_resolution, noise, tau)  # refuses bad numbers before anything is measured
    measured: RateSource
    if event_rate is not None or nlcs_event_rate is not None:
        if dataset is not None or rates is not None:
            raise InputError("--event-rate stands in place of --dataset and --rates; give one of them")
        if event_rate is None:
            raise InputError("--nlcs-event-rate goes with --event-rate, the rate of LCS; give both")
        rates_hz = (event_rate, event_rate if nlcs_event_rate is None else nlcs_event_rate)
        for rate in rates_hz:
            if not (math.isfinite(rate) and rate >= 0):
                raise InputError(f"event rate must be a number of events/s from 0, not {rate:g}")
        measured = GivenRates(*rates_hz, rate_resolution)
    else:
        table = rate_table(dataset, preset_name, rates, list(RESOLUTIONS), [tau], (rows, columns))
        measured = table
        if bandwidth is None and not any(s.startswith("signal_bandwidth_hz=") for s in settings or []):
            parameters = parameters.replace(signal_bandwidth_hz=table.bandwidth_hz)
    model = PowerModel(parameters=parameters, corrections=frozenset(CORRECTIONS), measured=measured, gates=gates)
    data = explore_data(model, noise, tau, min_resolution)
    write_results(out, "explore", data, plot_explore, quiet=as_json)
    if as_json:
        print(json.dumps(data))
    else:
        _print(data)


def _print(data: dict[str, Any]) -> None:
    """Print the study as a table, the cheapest of every resolution marked, and the answer."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from model.power_plots import watts

    sensor = data["sensor"]
    title = (
        f"{sensor['rows']} x {sensor['columns']} taxels, {sensor['bandwidth_hz']:g} Hz, "
        f"noise {sensor['noise_v_rms'] * 1e3:g} mV rms, pads {sensor['pads_voltage_v']:g} V"
    )
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    for heading in ("N", *(READOUT_NAMES[r] for r in READOUTS), "cheapest", ""):
        table.add_column(heading, justify="left" if heading in ("", "cheapest") else "right")
    for row in data["table"]:
        cells = []
        for readout in READOUTS:
            best = readout == row["cheapest"]
            cells.append(Text(watts(row[readout]["total"]), style="bold" if best else ""))
        remark = "below the noise" if row["resolution"] > data["noise_resolution"] else ""
        table.add_row(str(row["resolution"]), *cells, READOUT_NAMES[row["cheapest"]], remark)
    Console().print(table)
    best = data["cheapest"]
    print(
        f"cheapest with at least {data['least_resolution']} bit: {READOUT_NAMES[best['readout']]} at "
        f"{best['resolution']} bit, {watts(best['total'])}"
    )
