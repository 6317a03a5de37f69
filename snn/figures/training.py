"""Plot the result of a training: confusion matrix, and a page with a raster per class."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.files import atomic_write
from eskin.model.events.recording import Recording
from eskin.skin.recordings.quality import decode_recording
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.figures.confusion import plot_confusion

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ margin: 0 auto; max-width: 60rem; padding: 1rem; font: 16px/1.5 system-ui, sans-serif; }}
img {{ display: block; max-width: 100%; height: auto; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>{summary}</p>
{body}
</body>
</html>
"""


def draw_training(result: Mapping[str, Any], tested: list[str], out: Path) -> list[Path]:
    """Write ``confusion.png``, and ``training.html`` for a training on event files; return the files.

    Parameters
    ----------
    result : mapping
        Content of ``result.json``.
    tested : list of str
        Names of the test recordings, in the order of the result.
    out : Path
        Folder.
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
    """Return the confusion matrix of the test images."""
    classes = result["class_names"]
    confusion = np.zeros((len(classes), len(classes)), np.int64)
    np.add.at(confusion, (result["labels"], result["predicted"]), 1)
    point = {"label": "test", "accuracy": result["accuracy"], "class_names": classes, "confusion": confusion.tolist()}
    return {"reading": "last", "points": [point]}


def _page(result: Mapping[str, Any], folder: Path, tested: list[str], confusion: Path) -> str:
    """Return an HTML page with the confusion matrix, and signals and events of a test recording per class."""
    right = sum(a == b for a, b in zip(result["predicted"], result["labels"], strict=True))
    parts = [_embedded(confusion.read_bytes(), "Confusion matrix of the test recordings")]
    recordings = {recording.metadata["name"]: recording for recording in read_recordings(event_files([folder]))}
    for label, kind in enumerate(result["class_names"]):
        chosen = [name for name, own in zip(tested, result["labels"], strict=True) if own == label]
        if not chosen:
            continue
        name, recording = chosen[0], recordings[chosen[0]]
        said = result["class_names"][result["predicted"][tested.index(name)]]
        parts.append(f"<h2>{html.escape(kind)}</h2>\n<p>{html.escape(name)}: classified as {html.escape(said)}</p>")
        parts.append(_embedded(_drawn(partial(_raster, recording)), f"Raster of {name}"))
    first = next(iter(recordings.values()))
    title = f"Training on {html.escape(str(first.metadata.get('dataset', folder.name)))}"
    summary = f"{right} of {len(tested)} test recordings are classified as their class ({result['accuracy']:.1%})."
    return PAGE.format(title=title, summary=summary, body="\n".join(parts))


def _raster(recording: Recording, path: Path) -> None:
    """Draw the reconstructed signals of a recording above its events."""
    from eskin.skin.figures.raster import plot_signals

    signals = decode_recording(recording)
    plot_signals(recording.events, signals, recording.config, path, "", "reconstruction", recording.duration_clocks)


def _drawn(plot: Callable[[Path], None]) -> bytes:
    """Return the picture that a plot function writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        plot(path)
        return path.read_bytes()


def _embedded(picture: bytes, words: str) -> str:
    """Return a picture as HTML with embedded data."""
    return f'<img alt="{html.escape(words)}" src="data:image/png;base64,{base64.b64encode(picture).decode()}">'
