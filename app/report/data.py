"""Collect the data of the report (docs/guide/report.md)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.base.shapes import read_shaped
from eskin.base.units import with_unit
from eskin.model.events.recording import Recording

Data = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """Recordings of one readout from RTL and model, or from the model with its samples."""

    name: str  # folder of the run
    verdict: str  # result of the comparison, one sentence
    equal: bool | None  # whether RTL and model are equal; None without comparison
    model: Recording
    rtl: Recording | None = None
    samples: NDArray[np.float64] | None = None  # in full scale, shape (ticks, taxels)

    def to_dict(self) -> Data:
        """Return name, readout, length, event counts and verdict as a dictionary."""
        config = self.model.config
        return {
            "name": self.name,
            "readout": f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns}",
            "texture": str((self.rtl or self.model).metadata.get("name", "")),
            "duration": with_unit(self.model.duration_clocks / config.clock_hz, "s"),
            "events_rtl": None if self.rtl is None else len(self.rtl.events),
            "events_model": len(self.model.events),
            "equal": self.equal,
            "verdict": self.verdict,
        }


def load_runs(folder: Path) -> tuple[list[Run], list[str]]:
    """Return all runs of ``make sim`` in a folder, and sentences about missing files.

    Without runs, the model encodes the beginning of an embedded texture. Raises InputError if an event file is damaged,
    or the two of a run are of different readouts.
    """
    runs, missing = [], []
    for place in sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []:
        gone = [name for name in ("rtl.npz", "model.npz") if not (place / name).is_file()]
        if not gone:
            runs.append(_compared(place.name, *(Recording.load(place / name) for name in ("rtl.npz", "model.npz"))))
        elif len(gone) == 1:
            missing.append(f"{place.name} has no {gone[0]}, so it is not shown; run make sim to the end.")
    if runs:
        return runs, missing
    missing.append(
        "There are no event files of the RTL here, so the model is shown alone and nothing is compared; "
        "make sim writes them. If make sim was run with OUT, give make report the same OUT."
    )
    return [_model_alone(encoding) for encoding in ("lcs", "nlcs")], missing  # the encoders of the paper


def _compared(name: str, rtl: Recording, model: Recording) -> Run:
    from eskin.model.events.compare import first_difference

    ours, theirs = rtl.config.to_dict(), model.config.to_dict()
    arrays = [f"{r.config.rows} x {r.config.columns}" for r in (rtl, model)]
    if arrays[0] != arrays[1]:
        raise InputError(
            f"{name}: rtl.npz is of a {arrays[0]} array, model.npz of {arrays[1]}; run make sim again for this array"
        )
    if field := next((field for field in ours if ours[field] != theirs[field]), None):
        raise InputError(
            f"{name}: rtl.npz has {field} {ours[field]}, model.npz {theirs[field]}; run make sim again for one of them"
        )
    difference = first_difference(model.events, rtl.events)
    if difference is None:
        verdict = f"RTL equals model: all {len(rtl.events):,} events, in clock, row, column and polarity"
    else:
        verdict = "RTL DIFFERS from model: " + difference.describe(("model", "RTL")).split("\n")[0]
    return Run(name, verdict, difference is None, model, rtl)


def _model_alone(encoding: str) -> Run:
    from eskin.model.config import ReadoutConfig
    from eskin.model.readout import Stimulus, simulate
    from eskin.skin.textures.dataset import EMBEDDED, open_dataset
    from eskin.skin.textures.physical import PhysicalScan

    scan, texture = PhysicalScan(), open_dataset(EMBEDDED)[0]
    config = scan.configure(ReadoutConfig.from_dict({"rows": 8, "columns": 8, "encoding": encoding, "resolution": 6}))
    codes = scan.samples(config, texture.load())[0][:1000]  # 50 ms
    events = simulate(config, Stimulus.from_samples(config, codes))
    recording = Recording(events, config, len(codes) * config.clocks_per_sample, metadata={"name": texture.name})
    verdict = f"model alone, {len(events):,} events; nothing is compared"
    return Run(f"8x8-{encoding}-6b", verdict, None, recording, samples=codes / config.full_scale)


SUMMARY: Data = {
    "dataset": str,
    "preset": (str, None),
    "images": int,
    "clocks": int,
    "events": int,
    "mismatches": int,
    "configuration": {"rows": int, "columns": int, "encoding": str, "resolution": int},
}
"""Shape of the fields of a replay summary that the report reads."""


def load_replays(folder: Path) -> list[Data]:
    """Return the summaries of ``make replay`` in a folder."""
    found = []
    for file in sorted(folder.glob("*/summary.json")):
        summary = read_shaped(file, "the summary of make replay", SUMMARY, "delete it")
        readout = {key: summary["configuration"][key] for key in SUMMARY["configuration"]}
        found.append({key: summary[key] for key in SUMMARY if key != "configuration"} | readout)
    return found


def load_accuracy(path: Path) -> Data:
    """Return points of accuracy against data rate from a file (format: docs/guide/report.md)."""
    what = "the accuracy results"
    values = read_json(path, what, dict)
    points = values.get("points")
    if not isinstance(points, list) or not points:
        raise InputError(f"{what} {path} need a list of points; docs/guide/report.md shows one")
    found = [_accuracy_point(point, f"{what} {path}: point {number}") for number, point in enumerate(points)]
    return {"source": str(values.get("source", "")), "points": found}


def _accuracy_point(point: Any, where: str) -> Data:
    from eskin.power.readouts import READOUT_NAMES
    from eskin.skin.figures.readouts import LOOKS

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
    titles = {name: look.title for name, look in LOOKS.items()} | READOUT_NAMES
    label = titles.get(readout, readout) + (f" {resolution} b" if resolution is not None else "")
    drawn = {"readout": readout, "label": str(point.get("label", label)), "data_rate_bps": rate, "accuracy": accuracy}
    drawn |= {key: str(point[key]) for key in ("title", "detail", "preset") if point.get(key) is not None}
    return drawn if interval is None else drawn | {"interval": interval}


def load_benchmarks(folder: Path) -> tuple[list[Data], list[str]]:
    """Return the ratios of all benchmark results in a folder, and sentences about unusable files."""
    files = sorted(folder.glob("*.json"))
    ratios = {file.name: list(_ratios(file.stem, read_json(file, "the benchmark result"))) for file in files}
    found = [ratio for of_file in ratios.values() for ratio in of_file]
    missing = [f"{name} has no ratios, so it is not shown." for name, of_file in ratios.items() if not of_file]
    if not found:
        missing.append("There are no benchmark results with ratios here; make bench writes them.")
    return found, missing


def _ratios(benchmark: str, values: Any) -> Iterator[Data]:
    """Yield name, ratio, median, minimum and maximum of each benchmark result."""
    results = values.get("results") if isinstance(values, dict) else None
    for number, result in enumerate(results if isinstance(results, list) else [], 1):
        if not isinstance(result, dict):
            continue
        entries = {f"{benchmark}: {result.get('name', number)}": result}
        if isinstance(result.get("candidates"), dict):
            entries = {f"{benchmark} {number}: {label}": entry for label, entry in result["candidates"].items()}
        for name, entry in entries.items():
            for key, value in entry.items() if isinstance(entry, dict) else ():
                ends = value if isinstance(value, dict) else {"median": value}
                if key.startswith(("times_", "of_")) and "median" in ends:
                    kept = {end: ends[end] for end in ("median", "least", "most") if end in ends}
                    if all(_is_number(end) and end > 0 for end in kept.values()):
                        yield {"name": name, "ratio": key.replace("_", " ")} | kept


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def report_data(
    sim: Path, replay: Path, benchmarks: Path, accuracy: Path, synthesis: Sequence[Path]
) -> tuple[Data, list[Run]]:
    """Return all data of the report, and the recordings for its pictures.

    ``missing`` lists, by section, missing files and the commands that make them. ``accuracy`` is the file of Fig. 9.
    The consistent mode uses the synthesis reports.
    """
    from eskin.model import __version__
    from eskin.power.build import both_modes, rate_table
    from eskin.power.explore import explore_data
    from eskin.power.rates import TAUS_S, load_tables
    from eskin.power.study import FIG_TAU_S, RESOLUTIONS, fig6_data, fig7_data, sensitivity_data, sensitivity_models
    from eskin.power.synthesis import load_reports

    gates = load_reports(list(synthesis))  # refused before anything long is done
    missing: dict[str, list[str]] = {}
    ratios, missing["benchmarks"] = load_benchmarks(benchmarks)
    fig9 = load_accuracy(accuracy) if accuracy.is_file() else None
    if fig9 is None:
        missing["fig9"] = [
            "The accuracy results are not there, so Fig. 9 is not drawn. Make them with eskin sweep and "
            "eskin fig9 --data-out docs/data, or give a file with --accuracy (format: docs/guide/report.md)."
        ]
    if not gates:
        missing["synthesis"] = [
            "No synthesis report was given, so consistent mode uses the published 435 fJ an event for the logic. "
            "Give reports with --synthesis FILE, once for each readout (format: docs/guide/power.md)."
        ]
    replays = load_replays(replay)
    if not replays:
        missing["replay"] = ["No whole dataset was replayed here; make replay does it."]
    runs, missing["raster"] = load_runs(sim)
    models = both_modes(None, synthesis, lambda: rate_table(None, "paper", None, list(RESOLUTIONS), list(TAUS_S)))
    consistent = models["consistent"]
    used = (consistent.measured.dataset, consistent.measured.preset)  # type: ignore[union-attr]
    others = {f"{t.dataset} {t.preset} scan": t for t in load_tables() if (t.dataset, t.preset) != used}
    data = {
        "version": __version__,
        "raster": [run.to_dict() for run in runs],
        "replay": replays,
        "explore": explore_data(consistent, 1e-3, FIG_TAU_S),
        "fig6": fig6_data(models),
        "fig7": fig7_data(models),
        "sensitivity": sensitivity_data(sensitivity_models(consistent, others)),
        "fig9": fig9,
        "benchmarks": ratios,
        "synthesis": [asdict(report) for report in gates.values()],
        "missing": {section: sentences for section, sentences in missing.items() if sentences},
    }
    return data, runs
