"""Compute the data of Fig. 9 from sweeps; ``eskin.snn.figures.fig9_plot`` draws it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.power.readouts import READOUTS
from eskin.skin.figures.readouts import LOOKS, look
from eskin.snn.experiments.points import READINGS, Point, Sweep, load_sweep, measured, partial

Data = dict[str, Any]

PUBLISHED = Path(__file__).with_name("published_fig9.json")
"""The points of the paper's Fig. 9."""

KEPT = Path(__file__).with_name("sweeps")
"""Folder of the project's sweeps: renamed copies of ``sweep.json``."""

LATEST = Path("out/sweep/sweep.json")
"""Default output of ``eskin sweep``."""

NAMES = {readout: look(readout).title for readout in dict.fromkeys((*READOUTS, *LOOKS))}
"""Names of all readouts in the order of the legend: first the readouts of the paper."""

TITLES = {
    "paper-network": "the paper's network",
    "reference-frames": "networks on frames",
    "tuned": "leaky network, bins of 4 ms",
    "tuned-2ms": "leaky network, bins of 2 ms",
}
"""Titles of the project's sweeps in figures; a sweep of a user keeps its name."""

FRAME_NETWORKS = {"rnn": "ReLU units", "cnn": "convolutions", "gru": "gated units"}
"""Titles of networks on frames, by the recipe, with which a point's name begins."""

RECEIVED = {"diff": "differences ", "onoff": "ON/OFF "}
"""Frames after preprocessing in the receiver, by the second word of a point's name (``eskin.snn.data.frame_steps``)."""

RATES = "rates-"
"""Beginning of the names of the frontier's sweeps."""

PUBLISHED_NAME = "published"


def load_sweeps(paths: Sequence[Path]) -> list[Sweep]:
    """Return the sweeps from files or folders; by default the project's sweeps and the latest sweep."""
    files = list(paths) or kept_sweeps() + ([LATEST] if LATEST.is_file() else [])
    if not files:
        raise InputError(f"there is no sweep in {KEPT}, nor {LATEST}; make one with eskin sweep")
    sweeps = [load_sweep(path) for path in files]
    names = [sweep.name for sweep in sweeps]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"two sweeps are called {twice[0]}; rename one of them")
    return sweeps


def kept_sweeps() -> list[Path]:
    """Return the paths of the project's sweeps, without the sweeps of the frontier."""
    return [path for path in sorted(KEPT.glob("*.json")) if not path.name.startswith(RATES)]


def fig9_data(sweeps: Sequence[Sweep], reading: str) -> Data:
    """Return the published points and the points of sweeps.

    Points without results are left out, and named in ``left_out``.
    """
    published = read_json(PUBLISHED, "the published points")
    points = [
        point
        | {
            "readout": f"{point['readout']}, {PUBLISHED_NAME}",
            "label": _label(point["readout"], detail(point), PUBLISHED_NAME),
            "detail": detail(point),
            "sweep": PUBLISHED_NAME,
            "title": PUBLISHED_NAME,
            "preset": published["preset"],
            "classes": published["classes"],
            "data_rate_bps": point["normalised_rate"] * published["reference_bps"],
        }
        for point in published["points"]
    ]
    left_out = []
    for sweep in sweeps:
        for point in sweep.points:
            if measured(point):
                points.append(own_point(sweep, point, reading))
            else:
                left_out.append(f"{sweep.name}: {point['name']}")
    named: dict[str, list[str]] = {}
    for sweep in sweeps:
        named.setdefault(_protocol(sweep, reading), []).append(title(sweep.name))
    words = "; ".join(f"{', '.join(names)}: {protocol}" for protocol, names in named.items())
    return {
        "source": f"Published: {published['source']}. Here: {words}; intervals are of 95 %, over images and seeds.",
        "commands": {sweep.name: sweep.command for sweep in sweeps},
        "reading": reading,
        "protocol": list(named),
        "reference_bps": published["reference_bps"],
        "left_out": left_out,
        "points": points,
    }


def own_point(sweep: Sweep, point: Point, reading: str) -> Data:
    """Return a sweep point for figures, with its interval over images and seeds."""
    found, preset = point[reading], point["preset"]
    label = _label(point["readout"], detail(point), title(sweep.name))
    if preset not in (None, "paper") and preset not in sweep.name:
        label += f", {preset} scan"
    if partial(point):
        label += f", {point['cells']['done']} of {point['cells']['of']} cells"
    own = ("readout", "name", "preset", "resolution", "cells", "data_rate_bps", "normalised_rate")
    of_result = ("accuracy", "wilson_95", "sd_over_cells", "sd_over_folds", "sd_over_seeds", "images")
    return {
        **{name: point[name] for name in own},
        **{name: found[name] for name in of_result},
        "label": label,
        "detail": detail(point),
        "sweep": sweep.name,
        "title": title(sweep.name),
        "classes": len(found["confusion"]),
        "interval": found["bootstrap_95"],
    }


def title(sweep: str) -> str:
    return TITLES.get(sweep, sweep)


def detail(point: Data) -> str:
    """Return the label of a point: resolution, network, or rate and bits."""
    words = str(point.get("name", "")).removeprefix("frame").strip("-").split("-")
    if not point["readout"].startswith("frame") or words == [""]:
        return f"{point['resolution']} b"
    if words[0] in FRAME_NETWORKS:
        return FRAME_NETWORKS[words[0]]
    kind = RECEIVED.get(words[0])
    rate, bits, *levels = [*words[kind is not None :], "", ""][:3]
    if not bits:
        return " ".join(words)
    return f"{kind or ''}{rate} Hz {bits} b{f', levels of {levels[0]} b' if levels[0] else ''}"


def _label(readout: str, point_detail: str, sweep: str) -> str:
    return f"{NAMES[readout]}{',' if readout == 'frame' else ''} {point_detail}, {sweep}"


def _protocol(sweep: Sweep, reading: str) -> str:
    """Return a text with images, folds, seeds and epoch of the finished points."""
    found = []
    for point in sweep.points:
        if measured(point) and not partial(point):
            of, seeds = point["cells"]["of"], point["cells"]["whole_seeds"]
            found.append(f"{point[reading]['images']} images, {of // seeds} folds x {seeds} seeds")
    return f"{' or '.join(dict.fromkeys(found)) or 'no point is finished'}, {READINGS[reading]}"
