"""Read and write the points of a sweep in ``sweep.json``."""

from __future__ import annotations

import dataclasses
import math
import string
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import origin, read_json, write_json
from eskin.model.encoders import registry
from eskin.skin.textures.presets import PRESETS

READOUTS = (*registry.NAMES, "frame")

LATER = ("labels", "predictions", "coded_bps")
"""Fields that older files do not have."""

DIGITS = string.digits + string.ascii_letters
"""Digits of the classes in a text of predictions."""

READINGS = {"last": "last epoch", "selected": "epoch selected by inner validation"}


@dataclass(frozen=True)
class Result:
    """Accuracy results of a sweep point over its completed seeds."""

    accuracy: float
    sd_over_folds: float | None
    sd_over_seeds: float | None
    sd_over_cells: float | None
    """Standard deviations; None for a single value."""
    wilson_95: Sequence[float]
    bootstrap_95: Sequence[float]
    images: int
    accuracy_of_seeds: Sequence[float]
    confusion: Sequence[Sequence[int]]
    """Rows are the classes, columns the predictions."""
    predictions: Sequence[str] | None = None
    """One word per seed: the class of every image as a digit of DIGITS, ``.`` for images outside the test; None in
    older files."""


@dataclass(frozen=True)
class Cells:
    """Numbers of finished trainings, of all trainings, and of completed seeds."""

    done: int
    of: int
    whole_seeds: int


@dataclass(frozen=True)
class PointSummary:
    """Summary of one sweep point: readout, rates and accuracies."""

    name: str
    readout: str
    """One of READOUTS."""
    resolution: int
    """Bits: N of the encoder, or bits of a frame's sample."""
    preset: str | None
    """Preset; None for event files of a user."""
    rate_hz: float | None
    """Events per second, or values of frames; None before the scans are made."""
    bits_per_event: int
    data_rate_bps: float | None
    normalised_rate: float | None
    """Data rate in units of 640 kb/s."""
    class_names: Sequence[str] | None
    cells: Cells
    last: Result | None
    selected: Result | None
    """Results for the two epochs to evaluate; None before the first seed is complete."""
    labels: str | None = None
    """The true class of every image, as in ``Result.predictions``."""
    coded_bps: dict[str, float] | None = None
    """Bits per second after lossless coding, by form (``eskin.snn.data.coding``)."""

    @property
    def measured(self) -> bool:
        """True if the point has results for at least one completed seed."""
        return self.last is not None

    @property
    def partial(self) -> bool:
        """True if trainings of the point are missing."""
        return self.cells.done < self.cells.of

    def result(self, reading: str) -> Result:
        """Return the results for the last epoch or for the selected epoch."""
        found = self.last if reading == "last" else self.selected
        assert found is not None
        return found

    @classmethod
    def from_dict(cls, fields: Any, where: str) -> PointSummary:
        """Return the sweep point for a dictionary; raise an error that starts with ``where`` for invalid fields."""
        _need(isinstance(fields, dict), where, "the fields of a point", fields)
        get = fields.get
        _need(isinstance(get("name"), str), where, "a name", get("name"))
        where += f" ({get('name')})"
        _need(get("readout") in READOUTS, where, f"readout, one of {', '.join(READOUTS)}", get("readout"))
        _need(get("preset") in (*PRESETS, None), where, f"preset, one of {', '.join(PRESETS)}", get("preset"))
        for key in ("resolution", "bits_per_event"):
            _need(type(get(key)) is int and get(key) >= 0, where, f"{key}, a whole number", get(key))
        measured = get("last") is not None or get("selected") is not None
        made = {field.name: get(field.name) for field in dataclasses.fields(cls)}
        made["cells"] = _cells(get("cells"), measured, where)
        if measured:
            for key in ("data_rate_bps", "normalised_rate"):
                _need(_number(get(key), 0) and 0 < get(key) < math.inf, where, f"{key}, a positive number", get(key))
            made |= {reading: _result(get(reading), READINGS[reading], where) for reading in READINGS}
            names, classes = get("class_names"), len(made["selected"].confusion)
            good = isinstance(names, list) and len(names) == classes and all(isinstance(name, str) for name in names)
            _need(good, where, f"class_names, {classes} names", names)
            coded = get("coded_bps")
            good = coded is None or (isinstance(coded, dict) and all(_number(value, 0) for value in coded.values()))
            _need(good, where, "coded_bps, numbers by name", coded)
            labels, images = get("labels"), made["last"].images
            _need(labels is None or _word(labels, images), where, f"labels, a digit for each image ({images})", labels)
        return cls(**made)


def as_word(classes: Iterable[int]) -> str:
    """Return the classes of images as a text with one digit for each image.

    A point stands for an image without class. The text is empty if a class has no digit.
    """
    found = [int(number) for number in classes]
    return "".join(DIGITS[n] if n >= 0 else "." for n in found) if max(found) < len(DIGITS) else ""


def _word(value: Any, images: int) -> bool:
    """Return True if a value is a text of one class digit per image, or empty."""
    return isinstance(value, str) and len(value) in (0, images) and set(value) <= {*DIGITS, "."}


def _number(value: Any, low: float, high: float = math.inf) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def _need(good: bool, where: str, what: str, value: Any) -> None:
    if not good:
        raise InputError(f"{where} needs {what}, not {value!r}; run the sweep again")


def _cells(cells: Any, measured: bool, where: str) -> Cells:
    _need(isinstance(cells, dict), where, "cells, their numbers", cells)
    for key, low in {"done": 0, "of": 1, "whole_seeds": int(measured)}.items():
        good = type(cells.get(key)) is int and cells[key] >= low
        _need(good, where, f"cells.{key}, at least {low}", cells.get(key))
    return Cells(cells["done"], cells["of"], cells["whole_seeds"])


def _result(found: Any, reading: str, where: str) -> Result:
    _need(isinstance(found, dict), where, f"the results of the {reading}", found)
    _need(_number(found.get("accuracy"), 0, 1), where, "accuracy in 0..1", found.get("accuracy"))
    for key in ("wilson_95", "bootstrap_95"):
        ends = found.get(key)
        good = isinstance(ends, list) and len(ends) == 2 and all(_number(end, 0, 1) for end in ends)
        _need(good, where, f"{key}, [low, high] in 0..1", ends)
    for key in ("sd_over_folds", "sd_over_seeds", "sd_over_cells"):
        _need(found.get(key) is None or _number(found[key], 0), where, f"{key}, a number", found.get(key))
    _need(_number(found.get("images"), 1), where, "images, their number", found.get("images"))
    rows = found.get("confusion")
    square = isinstance(rows, list) and bool(rows) and all(
        isinstance(row, list) and len(row) == len(rows) and all(_number(n, 0) for n in row) for row in rows
    )  # fmt: skip
    _need(square, where, "confusion, a square table of numbers", rows)
    words = found.get("predictions")
    good = words is None or (isinstance(words, list) and all(_word(word, found["images"]) for word in words))
    _need(good, where, f"predictions, a digit for each image ({found['images']}) and seed", words)
    return Result(**{field.name: found.get(field.name) for field in dataclasses.fields(Result)})


@dataclass(frozen=True)
class Sweep:
    """Content of a file written by ``eskin sweep``."""

    name: str
    """Name of the folder, or of a stored file."""
    command: str
    """Command that made the sweep."""
    points: list[PointSummary]


def write_sweep(path: Path, command: str | None, points: Sequence[PointSummary]) -> None:
    """Write ``sweep.json``, without fields of unknown value."""
    said: dict[str, Any] = {"command": command, **(origin(command) if command else {})}
    write_json(path, said | {"points": [_without_unknown(dataclasses.asdict(point)) for point in points]})


def _without_unknown(fields: dict[str, Any]) -> dict[str, Any]:
    found = {name: value for name, value in fields.items() if value is not None or name not in LATER}
    return {name: _without_unknown(value) if name in READINGS and value else value for name, value in found.items()}


def load_sweep(path: Path) -> Sweep:
    """Return the sweep from a file, or from ``sweep.json`` in a folder.

    Raise InputError if the file cannot be read, or a point lacks values for the figures.
    """
    file = path / "sweep.json" if path.is_dir() else path
    content = read_json(file, "the sweep")
    points = content.get("points") if isinstance(content, dict) else None
    if not isinstance(points, list) or not points:
        raise InputError(f"{file} contains no points of a sweep; make it with eskin sweep")
    read = [PointSummary.from_dict(point, f"{file}: point {number}") for number, point in enumerate(points)]
    name = file.resolve().parent.name if file.name == "sweep.json" else file.stem
    return Sweep(name, str(content.get("command", "")), read)
