"""The command explore (docs/guide/power.md)."""

from __future__ import annotations

import sys
from typing import Any

from eskin.app.cli import asked_for, echo
from eskin.app.commands import options as common
from eskin.app.options import opt, with_fields
from eskin.app.tables import new_table, print_report, show
from eskin.base.errors import InputError
from eskin.base.figures.files import DEFAULT_OUT, write_results
from eskin.base.progress import bar
from eskin.power.build import build_model, rate_table
from eskin.power.equations import CORRECTIONS, PowerModel, RateSource
from eskin.power.explore import GivenRates, explore_data
from eskin.power.parameters import PowerParameters
from eskin.power.readouts import READOUT_NAMES, READOUTS
from eskin.power.study import RESOLUTIONS

SENSOR = ("rows", "columns", "signal_bandwidth_hz", "supply_v", "pads_voltage_v", "pads_toggle")
"""Parameters of the power model with an option; ``--set`` changes the other parameters."""


STORED_RATES = (
    "event rates: those of textures in the {} scan, which come with the project; --event-rate gives your sensor's own"
)


@with_fields(PowerParameters, SENSOR, "sensor", {"signal_bandwidth_hz": "that of the textures"})
def explore(
    sensor: dict[str, Any],
    noise: float = opt(1e-3, "V", "AFE output noise, rms, for 1 V full scale"),
    tau: float = opt(0.2, "SECONDS", "time constant of N-LCS"),
    event_rate: float | None = opt(None, "HZ", "events/s of the whole array, instead of textures"),
    nlcs_event_rate: float | None = opt(None, "HZ", "events/s of N-LCS [value of --event-rate]"),
    rate_resolution: int = opt(6, "N", "resolution of these rates"),
    min_resolution: int | None = opt(None, "N", "resolution needed [the finest that the noise allows]"),
    dataset: common.Dataset = None,
    preset_name: common.Preset = "physical",
    rates: common.Rates = None,
    synthesis: common.Synthesis = None,
    settings: common.Settings = None,
    out: common.Out = DEFAULT_OUT,
    as_json: common.Json = False,
) -> None:
    """Find the readout and resolution with the least power for your sensor."""
    from eskin.power.figures.plots import plot_explore

    own = list(settings or [])
    if (bandwidth := sensor.get("signal_bandwidth_hz")) is not None:  # given by the user, not measured on textures
        own.insert(0, f"signal_bandwidth_hz={bandwidth!r}")
    parameters = PowerParameters().replace(**sensor)
    PowerModel().breakdown("frame", rate_resolution, noise, tau)  # refuses bad numbers before anything is measured

    array = (parameters.rows, parameters.columns)

    def source() -> RateSource:
        if event_rate is None and nlcs_event_rate is None:
            return rate_table(dataset, preset_name, rates, list(RESOLUTIONS), [tau], array, watch=bar)
        if dataset is not None or rates is not None:
            raise InputError("--event-rate replaces --dataset and --rates; give one of them")
        if event_rate is None:
            raise InputError("--nlcs-event-rate needs --event-rate, the rate of LCS; give both")
        return GivenRates(event_rate, event_rate if nlcs_event_rate is None else nlcs_event_rate, rate_resolution)

    model = build_model(frozenset(CORRECTIONS), own, synthesis, source, parameters)
    data = explore_data(model, noise, tau, min_resolution)
    written = write_results(out, "explore", data, plot_explore, command=asked_for())
    if event_rate is dataset is rates is None:
        print(STORED_RATES.format(preset_name), file=sys.stderr if as_json else sys.stdout)
    if not as_json:
        echo(written)
    print_report(data, as_json, _print)


def _print(data: dict[str, Any]) -> None:
    """Print the power of all readouts as a table, with the cheapest readout marked at every resolution."""
    from rich.text import Text

    from eskin.base.units import with_unit

    sensor = data["sensor"]
    title = (
        f"{sensor['rows']} x {sensor['columns']} taxels, {sensor['bandwidth_hz']:g} Hz, "
        f"noise {sensor['noise_v_rms'] * 1e3:g} mV rms, pads {sensor['pads_voltage_v']:g} V"
    )
    names = [READOUT_NAMES[readout] for readout in READOUTS]
    table = new_table(("N", *names, "cheapest", ""), title, left=(len(names) + 1, len(names) + 2))
    for row in data["table"]:
        cells = []
        for readout in READOUTS:
            best = readout == row["cheapest"]
            cells.append(Text(with_unit(row[readout]["total"], "W"), style="bold" if best else ""))
        remark = "below the noise" if row["resolution"] > data["noise_resolution"] else ""
        table.add_row(str(row["resolution"]), *cells, READOUT_NAMES[row["cheapest"]], remark)
    show(table)
    best = data["cheapest"]
    print(
        f"cheapest with at least {data['least_resolution']} bit: {READOUT_NAMES[best['readout']]} at "
        f"{best['resolution']} bit, {with_unit(best['total'], 'W')}"
    )
