"""What the report shows, as one plain dictionary for JSON (docs/guide/report.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from model.errors import InputError
from model.events.address import taxel_of
from model.events.recording import Recording
from model.files import read_json

if TYPE_CHECKING:
    from model.power.equations import PowerModel

Data = dict[str, Any]

GRID_NOISE_V = tuple(10 ** (-5 + k / 10) for k in range(41))
"""AFE noise in volts rms at which the page's slider stops: 10 uV to 100 mV, ten a decade."""

MOST_EVENTS = 50_000
"""Events of a recording that the page holds; of longer ones it shows the beginning, and says so."""

MODEL_TICKS = 1000
"""Sample ticks of the scan that stands in where there is no simulation: 50 ms."""

RATIO_MEANINGS = {
    "times_the_copy": "time, as a multiple of that of a plain copy of the samples: a shorter bar is faster",
    "of_bare_loop": "speed, as a multiple of that of a bare Verilator loop: a longer bar is faster",
    "times_the_limit": "time, as a multiple of that of the matrix products alone: a shorter bar is faster",
}
"""What a ratio of a benchmark means; others are named as in the file."""


# -- raster and match --------------------------------------------------------------------------------


def raster_data(folder: Path) -> tuple[list[Data], list[str]]:
    """Return the recordings of all runs of ``make sim`` in a folder, and what is not there, in sentences.

    Without any run, the model alone encodes the beginning of an embedded texture.

    Raises
    ------
    InputError
        If an event file is damaged, or the two of a run are of different readouts.
    """
    runs, missing = [], []
    for run in sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []:
        files = [run / "rtl.npz", run / "model.npz"]
        there = [file for file in files if file.is_file()]
        if len(there) == 2:
            runs.append(_match(run.name, *(Recording.load(file) for file in files)))
        elif there:
            gone = next(file for file in files if file not in there)
            missing.append(f"{run.name} has no {gone.name}, so it is not shown; run make sim to the end.")
    if runs:
        return runs, missing
    missing.append(
        "There are no event files of the RTL here, so the model is shown alone and nothing is compared; "
        "make sim writes them. Where it was given an OUT, make report takes the same."
    )
    return [_model_alone(encoding) for encoding in ("lcs", "nlcs")], missing


def _match(name: str, rtl: Recording, model: Recording) -> Data:
    """Return a run with the comparison of its two recordings."""
    from model.events.compare import first_difference, unmatched

    ours, theirs = rtl.config.to_dict(), model.config.to_dict()
    arrays = [f"{r.config.rows} x {r.config.columns}" for r in (rtl, model)]
    if arrays[0] != arrays[1]:
        raise InputError(
            f"{name}: rtl.npz is of a {arrays[0]} array, model.npz of {arrays[1]}; run make sim again for this array"
        )
    if differing := [field for field in ours if ours[field] != theirs[field]]:
        field = differing[0]
        raise InputError(
            f"{name}: rtl.npz has {field} {ours[field]}, model.npz {theirs[field]}; run make sim again for one of them"
        )
    difference = first_difference(model.events, rtl.events)
    if difference is None:
        verdict = f"RTL equals model: all {len(rtl.events):,} events, in clock, row, column and polarity"
    else:
        verdict = "RTL DIFFERS from model: " + difference.describe(("model", "RTL")).split("\n")[0]
    data = _run(name, rtl, [rtl, model]) | {"equal": difference is None, "verdict": verdict}
    if difference is not None:
        shown = [len(recording["t"]) for recording in data["recordings"]]
        for recording, alone, count in zip(data["recordings"], unmatched(rtl.events, model.events), shown, strict=True):
            recording["unmatched"] = np.flatnonzero(alone[:count]).tolist()
    else:
        data["recordings"][1] = {"label": "model", "same_as": 0}
    return data


def _model_alone(encoding: str) -> Data:
    """Return what the model makes of the beginning of the first embedded texture."""
    from model.config import ReadoutConfig
    from model.readout import Stimulus, simulate
    from model.textures.dataset import EMBEDDED, open_dataset
    from model.textures.physical import PhysicalScan

    scan, texture = PhysicalScan(), open_dataset(EMBEDDED)[0]
    config = scan.configure(ReadoutConfig.from_dict({"rows": 8, "columns": 8, "encoding": encoding, "resolution": 6}))
    samples = scan.samples(config, texture.load())[0][:MODEL_TICKS]
    events = simulate(config, Stimulus.from_samples(config, samples))
    recording = Recording(
        events, config, len(samples) * config.clocks_per_sample, metadata={"name": texture.name, "source": "model"}
    )
    verdict = f"model alone, {len(events):,} events; nothing is compared"
    return _run(f"8x8-{encoding}-6b", recording, [recording]) | {"equal": None, "verdict": verdict}


def _run(name: str, first: Recording, recordings: Sequence[Recording]) -> Data:
    """Return what the page draws of some recordings of one readout."""
    config = first.config
    duration = max(recording.duration_clocks for recording in recordings)
    longest = max(recordings, key=lambda recording: len(recording.events)).events
    shown = duration if len(longest) <= MOST_EVENTS else int(longest["t"][MOST_EVENTS])
    drawn = []
    for recording, label in zip(recordings, ("RTL", "model") if len(recordings) == 2 else ("model",), strict=True):
        events = recording.events[recording.events["t"] < shown]
        columns: Data = {
            "label": label,
            "events": len(recording.events),
            "t": events["t"].tolist(),
            "taxel": taxel_of(events, config).tolist(),
        }
        if config.has_polarity:
            columns["on"] = events["p"].astype(np.int64).tolist()
        drawn.append(columns)
    return {
        "name": name,
        "texture": str(first.metadata.get("name", "")),
        "encoding": config.encoding,
        "resolution": config.resolution,
        "rows": config.rows,
        "columns": config.columns,
        "clock_hz": config.clock_hz,
        "duration_clocks": duration,
        "shown_clocks": shown,
        "recordings": drawn,
    }


def replay_data(folder: Path) -> list[Data]:
    """Return the summaries that ``make replay`` left in a folder."""
    found = []
    for file in sorted(folder.glob("*/summary.json")):
        summary = read_json(file, "the summary of make replay")
        try:
            config = summary["configuration"]
            found.append(
                {key: summary[key] for key in ("dataset", "preset", "images", "clocks", "events", "mismatches")}
                | {key: config[key] for key in ("rows", "columns", "encoding", "resolution")}
            )
        except (KeyError, TypeError) as error:
            raise InputError(f"{file} is not a summary of make replay: it has no usable {error}; delete it") from None
    return found


# -- power -------------------------------------------------------------------------------------------


def power_grid(models: Mapping[str, PowerModel]) -> Data:
    """Return the power of all readouts at every stop of the page's sliders, in watts.

    The noise is in the AFE only, so the other parts have one number for each resolution.
    """
    from model.power.rates import TAUS_S
    from model.power.study import RESOLUTIONS, tau_key

    bits = np.array(RESOLUTIONS)[:, None]
    noise = np.array(GRID_NOISE_V)[None, :]

    def entry(model: PowerModel, readout: Any, tau_s: float = 0.2) -> Data:
        found = model.breakdown(readout, bits, noise, tau_s)
        return {
            "afe": found.afe.tolist(),
            "converter": found.converter[:, 0].tolist(),
            "converter_parts": {name: part[:, 0].tolist() for name, part in found.converter_parts.items()},
            "io": found.io[:, 0].tolist(),
            "total": found.total.tolist(),
        }

    return {
        "resolution": list(RESOLUTIONS),
        "noise_v_rms": list(GRID_NOISE_V),
        "tau_s": list(TAUS_S),
        "unit": "W",
        "modes": {
            mode: {
                "nlcs": {tau_key(tau): entry(model, "nlcs", tau) for tau in TAUS_S},
                "lcs": entry(model, "lcs"),
                "frame": entry(model, "frame"),
            }
            for mode, model in models.items()
        },
    }


def tau_text(tau_s: float) -> str:
    """Return a time constant as 2 s or 200 ms."""
    return f"{tau_s:g} s" if tau_s >= 1 else f"{tau_s * 1e3:g} ms"


def fig7_notes(fig7: Data) -> dict[str, list[str]]:
    """Return in words, for every mode, who wins at any noise where a line of Fig. 7 has no point."""
    notes: dict[str, list[str]] = {}
    for mode, entry in fig7["modes"].items():
        sides = entry["spikes_win"]
        lines = {f"N-LCS, tau {tau_text(float(tau))}": line for tau, line in sides["nlcs"].items()}
        notes[mode] = []
        for name, line in (lines | {"LCS": sides["lcs"]}).items():
            texts = []
            for side, winner in (("always", "spikes"), ("never", "frames")):
                found = [n for n, value in zip(fig7["resolution"], line, strict=True) if value == side]
                if found:
                    texts.append(f"{winner} for N = {found[0]}" + (f" to {found[-1]}" if len(found) > 1 else ""))
            if texts:
                notes[mode].append(f"{name}: {', '.join(texts)}")
    return notes


# -- accuracy, benchmarks ----------------------------------------------------------------------------


def fig9_data(path: Path) -> Data:
    """Return accuracy against data rate from a file of points (format: docs/guide/report.md).

    Raises
    ------
    InputError
        If the file cannot be read, or a point has no usable accuracy and data rate.
    """
    what = "the accuracy results"
    values = read_json(path, what, dict)
    points = values.get("points")
    if not isinstance(points, list) or not points:
        raise InputError(f"{what} {path} need a list of points; docs/guide/report.md shows one")
    found = [_fig9_point(point, f"{what} {path}: point {number}") for number, point in enumerate(points)]
    return {"source": str(values.get("source", "")), "points": found}


def _fig9_point(point: Any, where: str) -> Data:
    """Return what the page draws of a point, as ``python -m snn fig9`` wrote it."""
    from model.power.equations import READOUT_NAMES

    if not isinstance(point, dict):
        raise InputError(f"{where} is not an object")
    rate, accuracy, interval = (point.get(key) for key in ("data_rate_bps", "accuracy", "interval"))
    if not _is_number(rate) or rate <= 0:
        raise InputError(f"{where} needs data_rate_bps, a positive number of bit/s, not {rate!r}")
    if not _is_number(accuracy) or not 0 <= accuracy <= 1:
        raise InputError(f"{where} needs accuracy, a number in 0..1, not {accuracy!r}")
    if interval is not None and not (
        isinstance(interval, list) and len(interval) == 2 and all(_is_number(end) for end in interval)
    ):
        raise InputError(f"{where} has an interval that is not [low, high]: {interval!r}")
    readout, resolution = str(point.get("readout", "")), point.get("resolution")
    label = READOUT_NAMES.get(readout, readout) + (f" {resolution} b" if resolution is not None else "")
    drawn = {"readout": readout, "label": str(point.get("label", label)), "data_rate_bps": rate, "accuracy": accuracy}
    drawn |= {key: str(point[key]) for key in ("title", "detail", "preset") if point.get(key) is not None}
    return drawn if interval is None else drawn | {"interval": interval}


def benchmark_data(folder: Path) -> tuple[list[Data], list[str]]:
    """Return the ratios of all benchmark results in a folder, and what has none, in sentences."""
    found: list[Data] = []
    missing: list[str] = []
    for file in sorted(folder.glob("*.json")):
        values = read_json(file, "the benchmark result")
        results = values.get("results") if isinstance(values, dict) else None
        charts = _ratio_charts(file.stem, values) if isinstance(results, list) else []
        found += charts
        if not charts:
            missing.append(f"{file.name} has no ratios, so it is not drawn.")
    if not found:
        missing.append("There are no benchmark results with ratios here; make bench writes them.")
    return found, missing


def _ratio_charts(name: str, values: Data) -> list[Data]:
    """Return the charts of one result file: one, or one for each result that compares candidates."""
    results = [result for result in values["results"] if isinstance(result, dict)]
    facts = {key: value for key, value in values.items() if _is_number(value)}
    groups = [("", facts, results)]
    groups += [
        (
            f" {number}",
            facts | {key: value for key, value in result.items() if _is_number(value)},
            [{"name": label} | entry for label, entry in result["candidates"].items() if isinstance(entry, dict)],
        )
        for number, result in enumerate(results, 1)
        if isinstance(result.get("candidates"), dict)
    ]
    charts = []
    for suffix, settings, entries in groups:
        keys = dict.fromkeys(key for entry in entries for key in entry if _ratio(key, entry[key]))
        for key in keys:
            bars = [
                {"name": str(entry.get("name", number))} | _ratio(key, entry[key])
                for number, entry in enumerate(entries)
                if key in entry and _ratio(key, entry[key])
            ]
            charts.append(
                {
                    "name": name + suffix,
                    "ratio": key,
                    "meaning": RATIO_MEANINGS.get(key, key.replace("_", " ")),
                    "settings": settings,
                    "bars": bars,
                }
            )
    return charts


def _ratio(key: str, value: Any) -> dict[str, float]:
    """Return median, least and most of a ratio; nothing if the value is none."""
    if not key.startswith(("times_", "of_")):
        return {}
    ends = {"median": value} if _is_number(value) else value
    if not isinstance(ends, dict) or not all(_is_number(end) and end > 0 for end in ends.values()):
        return {}
    return {end: ends[end] for end in ("median", "least", "most") if end in ends} if "median" in ends else {}


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


# -- everything --------------------------------------------------------------------------------------


def report_data(sim: Path, replay: Path, benchmarks: Path, accuracy: Path, synthesis: Sequence[Path]) -> Data:
    """Return everything that the page shows; ``missing`` says, by section, what is not there and how to make it.

    Parameters
    ----------
    sim, replay, benchmarks : Path
        Folders; what is not in them is left out.
    accuracy : Path
        File of Fig. 9; left out where there is none.
    synthesis : sequence of Path
        Synthesis reports, which ``consistent`` mode then uses.
    """
    from model import __version__
    from model.power.build import both_modes, rate_table
    from model.power.rates import TAUS_S, load_tables
    from model.power.study import RESOLUTIONS, fig6_data, fig7_data, sensitivity_data, sensitivity_models
    from model.power.synthesis import load_reports

    gates = load_reports(list(synthesis))  # refused before anything long is done
    missing: dict[str, list[str]] = {}
    ratios, missing["benchmarks"] = benchmark_data(benchmarks)
    fig9 = fig9_data(accuracy) if accuracy.is_file() else None
    if fig9 is None:
        missing["fig9"] = [
            "The accuracy results are not there, so Fig. 9 is not drawn. Make them with python -m snn sweep and "
            "python -m snn fig9 --data-out docs/data, or give a file with --accuracy (format: docs/guide/report.md)."
        ]
    if not gates:
        missing["synthesis"] = [
            "No synthesis report was given, so consistent mode uses the published 435 fJ an event for the logic. "
            "Give reports with --synthesis FILE, once for each readout (format: docs/guide/power.md)."
        ]
    replays = replay_data(replay)
    if not replays:
        missing["replay"] = ["No whole dataset was replayed here; make replay does it."]
    rasters, missing["raster"] = raster_data(sim)
    models = both_modes(None, synthesis, lambda: rate_table(None, "paper", None, list(RESOLUTIONS), list(TAUS_S)))
    consistent = models["consistent"]
    used = (consistent.measured.dataset, consistent.measured.preset)  # type: ignore[union-attr]
    others = {f"{t.dataset} {t.preset} scan": t for t in load_tables() if (t.dataset, t.preset) != used}
    fig7 = fig7_data(models)
    return {
        "version": __version__,
        "raster": rasters,
        "replay": replays,
        "grid": power_grid(models),
        "fig6": fig6_data(models),
        "fig7": fig7,
        "fig7_notes": fig7_notes(fig7),
        "sensitivity": sensitivity_data(sensitivity_models(consistent, others)),
        "fig9": fig9,
        "benchmarks": ratios,
        "synthesis": [asdict(report) for report in gates.values()],
        "missing": {section: sentences for section, sentences in missing.items() if sentences},
    }
