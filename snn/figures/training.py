"""Plot the result of a training: confusion matrix, and a page with a raster per class."""

import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.files import atomic_write
from eskin.base.pages import embedded, templates
from eskin.model.events.recording import Recording
from eskin.skin.recordings.quality import decode_recording
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.figures.confusion import plot_confusion

PAGES = templates(Path(__file__).parent)


def draw_training(result: Mapping[str, Any], tested: list[str], out: Path) -> list[Path]:
    """Write ``confusion.png``, and ``training.html`` for a training on event files; return the files.

    - ``result``: content of ``result.json``.
    - ``tested``: names of the test recordings, in the order of the result.
    """
    picture = out / "confusion.png"
    plot_confusion(_matrix(result), picture)
    folder = result["experiment"].get("events")
    if folder is None:
        return [picture]
    page = out / "training.html"
    with atomic_write(page) as file:
        file.write(_page(result, Path(folder), tested, picture).encode())
    return [picture, page]


def _matrix(result: Mapping[str, Any]) -> dict[str, Any]:
    classes = result["class_names"]
    confusion = np.zeros((len(classes), len(classes)), np.int64)
    np.add.at(confusion, (result["labels"], result["predicted"]), 1)
    point = {"label": "test", "accuracy": result["accuracy"], "class_names": classes, "confusion": confusion.tolist()}
    return {"reading": "last", "points": [point]}


def _page(result: Mapping[str, Any], folder: Path, tested: list[str], matrix: Path) -> str:
    """Return an HTML page with the confusion matrix, and signals and events of a test recording per class."""
    recordings = {recording.metadata["name"]: recording for recording in read_recordings(event_files([folder]))}
    shown = []
    for label, kind in enumerate(result["class_names"]):
        chosen = [name for name, own in zip(tested, result["labels"], strict=True) if own == label]
        if chosen:
            name = chosen[0]
            said = result["class_names"][result["predicted"][tested.index(name)]]
            raster = embedded(partial(_raster, recordings[name]), f"Raster of {name}")
            shown.append({"kind": kind, "name": name, "said": said, "raster": raster})
    first = next(iter(recordings.values()))
    return PAGES.get_template("training.html").render(
        dataset=first.metadata.get("dataset", folder.name),
        right=sum(a == b for a, b in zip(result["predicted"], result["labels"], strict=True)),
        tests=len(tested),
        accuracy=f"{result['accuracy']:.1%}",
        confusion=embedded(partial(shutil.copy, matrix), "Confusion matrix of the test recordings"),
        shown=shown,
    )


def _raster(recording: Recording, path: Path) -> None:
    """Draw the reconstructed signals of a recording above its events."""
    from eskin.skin.figures.raster import plot_signals

    signals = decode_recording(recording)
    plot_signals(recording.events, signals, recording.config, path, "", "reconstruction", recording.duration_clocks)
