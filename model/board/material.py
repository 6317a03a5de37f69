"""What is played to a board: a texture's scan, one of a user's recordings, or a file of codes."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.classifier.file import IntegerWeights
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.samples import fit_array, read_samples
from model.textures.dataset import EMBEDDED, open_dataset
from model.textures.physical import PhysicalScan
from model.textures.presets import preset

EVERY_FIELD = frozenset(field.name for field in dataclasses.fields(ReadoutConfig))
"""Of the readout of own recordings: none follows the recordings."""


def codes_of(path: Path, readout: ReadoutConfig) -> NDArray[Any]:
    """Return the codes in a file of samples, shape (ticks, taxels)."""
    values = read_samples(path).values
    if values.dtype.kind == "f":
        raise InputError(f"{path} holds floats, a board takes codes; encode them first, or give --data for recordings")
    codes, _, _ = fit_array(values, readout.rows, readout.columns, size_given=True)
    if codes.min() < -readout.full_scale or codes.max() >= readout.full_scale:
        raise InputError(
            f"{path} must be in {-readout.full_scale}..{readout.full_scale - 1} ({readout.sample_bits} bits), not "
            f"{codes.min()}..{codes.max()}"
        )
    return codes


def scan_of(
    weights: IntegerWeights, readout: ReadoutConfig, dataset: str, name: str | None
) -> tuple[str, NDArray[Any]]:
    """Return the name and the codes of a texture's scan, as the network was trained on them.

    Without a name it is the first that the network has not learned.
    """
    training = weights.notes["training"]
    if training["preset"] is None:
        raise InputError("these weights were trained on recordings; play some with --data")
    data = open_dataset(dataset)
    names = [texture.name for texture in data]
    unseen = [one for one in names if one in training["tested"]] if training["dataset"] == data.name else names
    chosen = name or (unseen or names)[0]
    if chosen not in names:
        raise InputError(f"{data.name} has no {chosen!r}; one of them is {names[0]}")
    image = data[names.index(chosen)].load()
    image = large_enough(image, readout) if data.name == EMBEDDED else image
    return chosen, preset(training["preset"]).samples(readout, image, 0.0)[0]


def recording_of(
    weights: IntegerWeights, readout: ReadoutConfig, place: Path, name: str | None
) -> tuple[str, NDArray[Any]]:
    """Return the name and the codes of one of a user's recordings, prepared as those of the training were."""
    from model.recordings.folder import read_set
    from model.recordings.options import Preparation

    said = weights.notes["training"]["recordings"]
    if said is None:
        raise InputError("these weights were trained on textures; leave --data out, or train on recordings")
    found = read_set(place, Preparation(**said["prepared"], scale=repr(said["scale"])), readout, EVERY_FIELD)
    names = [source.name for source in found.sources]
    chosen = name or names[0]
    if chosen not in names:
        raise InputError(f"{place} has no {chosen!r}; one of them is {names[0]}")
    return chosen, found.codes[names.index(chosen)]


def large_enough(image: NDArray[np.uint8], config: ReadoutConfig) -> NDArray[np.uint8]:
    """Return an embedded texture, repeated where the array is larger than it: half its width is left for the scan."""
    pitch = PhysicalScan().taxel_pitch_px
    height = math.ceil(config.rows * pitch) + 1
    width = math.ceil(config.columns * pitch) + image.shape[1] // 2
    repeats = (-(-height // image.shape[0]), -(-width // image.shape[1]))
    return np.tile(image, repeats)
