"""Read and write the points of a sweep in ``sweep.json``."""

import string
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import origin, read_json, write_json
from eskin.base.shapes import misfit
from eskin.model.encoders import registry
from eskin.skin.textures.presets import PRESETS

Point = dict[str, Any]
"""A sweep point: the fields of POINT, of MEASURED if a seed is complete, and of LATER."""

READOUTS = (*registry.NAMES, "frame")

POINT = {
    "name": str,
    "readout": str,  # one of READOUTS
    "resolution": int,  # bits: N of the encoder, or bits of a frame's sample
    "preset": (str, None),  # None for event files of a user
    "rate_hz": (float, None),  # events per second, or values of frames; None before the scans are made
    "bits_per_event": int,
    "cells": {"done": int, "of": int, "whole_seeds": int},  # finished trainings, all trainings, completed seeds
}

RESULT = {
    "accuracy": float,
    "sd_over_folds": (float, None),  # standard deviations; None for a single value
    "sd_over_seeds": (float, None),
    "sd_over_cells": (float, None),
    "wilson_95": [float],
    "bootstrap_95": [float],
    "images": int,
    "confusion": [[int]],  # rows are the classes, columns the predictions
}
"""Accuracy of a point over its completed seeds.

``predictions`` has a word per seed: the class of every image as a digit of DIGITS, ``.`` for images outside the test.
Older files lack this field.
"""

MEASURED = {
    "data_rate_bps": float,
    "normalised_rate": float,  # data rate in units of 640 kb/s
    "class_names": [str],
    "last": RESULT,
    "selected": RESULT,
}

LATER = {"labels": (str, None), "coded_bps": (dict, None)}
"""Fields that older files lack: the true class of every image, in the form of ``predictions``; and the bits per second
after lossless coding, by form (``eskin.snn.data.coding``)."""

DIGITS = string.digits + string.ascii_letters
"""Digits of the classes in a text of predictions."""

READINGS = {"last": "last epoch", "selected": "epoch selected by inner validation"}


def as_word(classes: Iterable[int]) -> str:
    """Return the classes of images as a text with one digit for each image.

    A point stands for an image without class. The text is empty if a class has no digit.
    """
    found = [int(number) for number in classes]
    return "".join(DIGITS[n] if n >= 0 else "." for n in found) if max(found) < len(DIGITS) else ""


def measured(point: Point) -> bool:
    """Return True if a point has results for at least one completed seed."""
    return point["last"] is not None


def unfinished(point: Point) -> bool:
    """Return True if trainings of a point are missing; published points have no trainings."""
    return "cells" in point and bool(point["cells"]["done"] < point["cells"]["of"])


def _flaw(point: Any) -> str:
    """Return a description of the first error in a point of a file, or an empty string."""
    known = isinstance(point, dict) and any(point.get(reading) for reading in READINGS)
    if wrong := misfit(point, POINT | (MEASURED if known else {"last": None, "selected": None})):
        return wrong
    for name, choices in (("readout", READOUTS), ("preset", (*PRESETS, None))):
        if point[name] not in choices:
            return f"{name} is {point[name]!r}, not one of {', '.join(map(str, choices))}"
    if not known:
        return ""
    cells = point["cells"]
    if not min(point["normalised_rate"], point["data_rate_bps"], cells["of"], cells["whole_seeds"]) > 0:
        return "normalised_rate, data_rate_bps, cells.of and cells.whole_seeds of a result must be above 0"
    if wrong := misfit({name: point.get(name) for name in LATER}, LATER):
        return wrong
    classes, labels = len(point["class_names"]), point.get("labels")
    return next(filter(None, (_flaw_of(point[reading], classes, labels) for reading in READINGS)), "")


def _flaw_of(result: dict[str, Any], classes: int, labels: str | None) -> str:
    """Return a description of the first error in the values of a result, or an empty string."""
    if not (classes and result["images"]):
        return "a result needs class_names and images"
    ends = [result["wilson_95"], result["bootstrap_95"]]
    if [len(pair) for pair in ends] != [2, 2] or not all(0 <= x <= 1 for x in (result["accuracy"], *ends[0], *ends[1])):
        return "accuracy and both ends of its intervals must be in 0..1"
    if {classes} != {len(row) for row in (result["confusion"], *result["confusion"])}:
        return f"confusion must have a row and a column for each of {classes} class_names"
    words = result.get("predictions")
    if wrong := misfit([] if words is None else words, [str], "predictions"):
        return wrong
    for word in (labels or "", *(words or ())):
        if len(word) not in (0, result["images"]) or not set(word) <= {*DIGITS, "."}:
            return f"labels and predictions must have a digit for each image ({result['images']})"
    return ""


@dataclass(frozen=True)
class Sweep:
    """Content of a file written by ``eskin sweep``."""

    name: str
    """Name of the folder, or of a stored file."""
    command: str
    """Command that made the sweep."""
    points: list[Point]


def write_sweep(path: Path, command: str | None, points: Sequence[Point]) -> None:
    """Write ``sweep.json``."""
    write_json(path, {"command": command, **(origin(command) if command else {}), "points": list(points)})


def load_sweep(path: Path) -> Sweep:
    """Return the sweep from a file, or from ``sweep.json`` in a folder.

    Raise InputError if the file cannot be read, or a point lacks values for the figures.
    """
    file = path / "sweep.json" if path.is_dir() else path
    content = read_json(file, "the sweep")
    points = content.get("points") if isinstance(content, dict) else None
    if not isinstance(points, list) or not points:
        raise InputError(f"{file} contains no points of a sweep; make it with eskin sweep")
    for number, point in enumerate(points):
        if wrong := _flaw(point):
            raise InputError(f"{file} is damaged: point {number}: {wrong}; run the sweep again")
    name = file.resolve().parent.name if file.name == "sweep.json" else file.stem
    return Sweep(name, str(content.get("command", "")), points)
