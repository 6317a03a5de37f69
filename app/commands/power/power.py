"""The commands power and explore (docs/guide/power.md)."""

import dataclasses
import json
import sys
from collections.abc import Iterable
from typing import Any

from eskin.app.commands import common
from eskin.app.options import command, opt, with_fields
from eskin.app.tables import new_table, print_report, print_table, show
from eskin.base.errors import InputError
from eskin.base.progress import bar
from eskin.base.units import with_unit
from eskin.power import study
from eskin.power.build import MEASURED, build_model, chosen_corrections, rate_table
from eskin.power.equations import CORRECTIONS, PowerModel, RateSource
from eskin.power.explore import GivenRates, explore_data
from eskin.power.figures.plots import plot_explore
from eskin.power.parameters import PowerParameters
from eskin.power.readouts import READOUT_NAMES, READOUTS
from eskin.power.study import RESOLUTIONS, TAUS_S

SENSOR = ("rows", "columns", "signal_bandwidth_hz", "supply_v", "pads_voltage_v", "pads_toggle")
"""Parameters of the power model with an option; ``--set`` changes the other parameters."""


@command(
    "Power and data rate",
    fuzz="",
    idle={
        "--parameters": "--mode --resolution --noise --tau --correct "
        "--without --crossover --synthesis --dataset --preset --rates",
        "--crossover": "--resolution --noise --tau",
    },
)
def power(
    mode: str | None = opt(None, "paper|consistent", "published model, or with all corrections [paper]"),
    resolution: int = opt(6, "N", "LSB = 2**-N of full scale, 1..10"),
    noise: float = opt(1e-3, "V", "AFE output noise, rms, for 1 V full scale"),
    tau: float = opt(0.2, "SECONDS", "time constant of N-LCS"),
    correct: str | None = opt(None, "NAME,...", "apply only these corrections"),
    without: str | None = opt(None, "NAME,...", "apply all corrections except these"),
    crossover: bool = opt(False, "--crossover", "AFE noise at which spikes need less power than frames, N = 1..10"),
    parameters: bool = opt(False, "--parameters", "list all parameters and corrections"),
    settings: common.Settings = None,
    synthesis: common.Synthesis = None,
    dataset: common.Dataset = None,
    preset_name: str | None = opt(None, "--preset", "paper|physical", "texture scan of the event rates [paper]"),
    rates: common.Rates = None,
    as_json: common.Json = False,
) -> None:
    """Print the power of the three readouts: LCS, N-LCS and frames."""
    if parameters:
        _print_parameters(PowerParameters().with_settings(settings or []), as_json)
        return
    corrections = chosen_corrections(mode, correct, without)
    given = {"--rates": rates, "--dataset": dataset, "--preset": preset_name}
    if idle := [name for name, value in given.items() if value is not None and not corrections & MEASURED]:
        raise InputError(
            f"{idle[0]} has no effect on the published rates; add --mode consistent or --correct event_rates"
        )
    # Bad numbers are refused before anything is measured.
    PowerModel().breakdown("frame", resolution, noise, tau)
    wanted = (list(RESOLUTIONS), list(TAUS_S)) if crossover else ([resolution], [tau])
    model = build_model(
        corrections, settings, synthesis, lambda: rate_table(dataset, preset_name or "paper", rates, *wanted, watch=bar)
    )
    if crossover:
        print_report(
            study.crossovers(model),
            as_json,
            lambda data: _print_crossovers(data, study.crossovers(model, "spikes_win"), model),
        )
        return
    title = f"N = {resolution}, noise {noise * 1e3:g} mV rms, tau {tau:g} s"
    found = study.breakdowns(model, resolution, noise, tau)
    print_report(found, as_json, lambda data: _print_breakdown(data, model, title))


def _mode_text(model: PowerModel) -> str:
    if not model.corrections:
        return "paper"
    if model.corrections == frozenset(CORRECTIONS):
        return "consistent"
    return "corrected: " + ", ".join(name for name in CORRECTIONS if name in model.corrections)


def _print_breakdown(data: dict[str, Any], model: PowerModel, title: str) -> None:
    table = new_table(("power", *(READOUT_NAMES[readout] for readout in READOUTS)), f"{title}, {_mode_text(model)}")

    def add(name: str, values: Iterable[float | None], style: str = "") -> None:
        table.add_row(name, *("" if value is None else with_unit(value, "W") for value in values), style=style)

    add("AFE", [data[r]["afe"] for r in READOUTS])
    add("converter", [data[r]["converter"] for r in READOUTS])
    for part in dict.fromkeys(part for r in READOUTS for part in data[r]["converter_parts"]):
        add(f"  {part.replace('_', ' ')}", [data[r]["converter_parts"].get(part) for r in READOUTS], "dim")
    add("I/O", [data[r]["io"] for r in READOUTS])
    table.add_section()
    add("total", [data[r]["total"] for r in READOUTS], "bold")
    frame = data["frame"]["total"]
    table.add_row("total / frame", *(f"{data[r]['total'] / frame:.3g}" for r in READOUTS))
    show(table)


def _print_crossovers(data: dict[str, Any], sides: dict[str, Any], model: PowerModel) -> None:
    lines = [(f"N-LCS {float(tau):g} s", data["nlcs"][tau], sides["nlcs"][tau]) for tau in data["nlcs"]]
    lines.append(("LCS", data["lcs"], sides["lcs"]))
    title = f"AFE noise (mV rms) where spikes and frames need equal power, {_mode_text(model)}"
    table = new_table(("N", *(name for name, _, _ in lines)), title, left=())
    for i, n in enumerate(RESOLUTIONS):
        table.add_row(str(n), *(_side_text(values[i], side[i]) for _, values, side in lines))
    table.caption = "spikes need less power above (>) or below (<) this noise, at any noise, or at none"
    table.caption_justify = "left"
    show(table)


def _side_text(noise_v_rms: float | None, side: str) -> str:
    """Return a crossover in mV with a sign for the cheaper side, or "any" or "none"."""
    if noise_v_rms is None:
        return {"always": "any", "never": "none"}[side]
    return f"{'>' if side == 'above' else '<'} {noise_v_rms * 1e3:.4g}"


def _print_parameters(parameters: PowerParameters, as_json: bool) -> None:
    shown = ("unit", "source", "meaning")
    fields = dataclasses.fields(parameters)
    if as_json:
        listed = {
            f.name: {"value": getattr(parameters, f.name), **{key: f.metadata[key] for key in shown}} for f in fields
        }
        print(json.dumps({"parameters": listed, "corrections": CORRECTIONS}))
        return
    rows = [f.metadata | {"name": f.name, "value": getattr(parameters, f.name)} for f in fields]
    heads = "parameter | value | unit | meaning | source"
    print_table(heads, rows, "{name} | {value:g} | {unit} | {meaning} | {source}", left=(0, 2, 3, 4))
    print_table(("correction", "meaning"), CORRECTIONS.items(), left=(0, 1))


@command(
    "Power and data rate",
    fuzz="-o new",
    idle={
        "no --event-rate": "--rate-resolution",
        "--event-rate": "--preset",
    },
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
    out: common.Out = common.DEFAULT_OUT,
    as_json: common.Json = False,
) -> None:
    """Find the readout and resolution with the least power for your sensor."""
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
    if event_rate is dataset is rates is None:
        stored = f"event rates: those of textures in the {preset_name} scan, which come with the project"
        print(f"{stored}; --event-rate gives your sensor's own", file=sys.stderr if as_json else sys.stdout)
    common.store(out, "explore", data, plot_explore, quiet=as_json)
    print_report(data, as_json, _print_explored)


def _print_explored(data: dict[str, Any]) -> None:
    """Print the power of all readouts as a table, with the cheapest readout marked at every resolution."""
    from rich.text import Text

    sensor = data["sensor"]
    title = (
        f"{sensor['rows']} x {sensor['columns']} taxels, {sensor['bandwidth_hz']:g} Hz, "
        f"noise {sensor['noise_v_rms'] * 1e3:g} mV rms, pads {sensor['pads_voltage_v']:g} V"
    )
    names = [READOUT_NAMES[readout] for readout in READOUTS]
    table = new_table(("N", *names, "cheapest", ""), title, left=(len(names) + 1, len(names) + 2))
    for row in data["table"]:
        cells = [Text(with_unit(row[r]["total"], "W"), "bold" if r == row["cheapest"] else "") for r in READOUTS]
        remark = "below the noise" if row["resolution"] > data["noise_resolution"] else ""
        table.add_row(str(row["resolution"]), *cells, READOUT_NAMES[row["cheapest"]], remark)
    show(table)
    best = data["cheapest"]
    print(
        f"cheapest with at least {data['least_resolution']} bit: {READOUT_NAMES[best['readout']]} at "
        f"{best['resolution']} bit, {with_unit(best['total'], 'W')}"
    )
