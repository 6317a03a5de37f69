"""Inputs of a board: a texture scan, a recording, or a file of codes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.columns import read_one
from eskin.skin.recordings.folder import RecordingSet, read_set
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.trained_on import EVERY_FIELD, TrainingNotes
from eskin.skin.samples import fit_array
from eskin.skin.textures.dataset import EMBEDDED, Dataset, open_dataset
from eskin.skin.textures.physical import large_enough
from eskin.skin.textures.presets import preset


def codes_to_play(
    weights: IntegerWeights,
    readout: ReadoutConfig,
    *,
    samples: Path | None = None,
    recordings: Path | None = None,
    dataset: str | None = None,
    only: str | None = None,
) -> tuple[str, NDArray[Any]]:
    """Return name and codes, shape (ticks, taxels), of the chosen input, by default an embedded texture.

    Textures and recordings are prepared as in the training of the network. Without ``only``, the input is a texture or
    recording that the network has not learned.
    """
    if samples is not None:
        return samples.name, codes_of(samples, readout)
    if recordings is not None:
        found = recordings_of(weights, readout, recordings)
        names = [source.name for source in found.sources]
        chosen = _chosen(names, only or names[0], recordings, "recording")
        return chosen, found.codes[names.index(chosen)]
    training = TrainingNotes.of(weights)
    if training.preset is None:
        raise InputError("these weights were trained on recordings; give recordings with --data")
    data, unseen = textures_of(weights, dataset or EMBEDDED)
    textures = {texture.name: texture for texture in data}
    chosen = _chosen(list(textures), only or unseen[0], data.name, "texture")
    image = textures[chosen].load()
    image = large_enough(image, readout) if data.name == EMBEDDED else image
    return chosen, preset(training.preset, training.wiring).samples(readout, image)[0]


def _chosen(names: list[str], name: str, place: str | Path, kind: str) -> str:
    if name not in names:
        raise InputError(f"{place} has no {kind} {name!r}; the first {kind} is {names[0]}")
    return name


def codes_of(path: Path, readout: ReadoutConfig) -> NDArray[Any]:
    """Return the codes in a file of samples, shape (ticks, taxels)."""
    table, _ = read_one(path, Preparation(), taxels=readout.taxels)
    if not table.codes:
        raise InputError(
            f"{path} holds floats, but a board needs codes; encode them first, or give --data for recordings"
        )
    codes, _, _ = fit_array(table.values.astype(int), readout.rows, readout.columns, size_given=True)
    if codes.min() < -readout.full_scale or codes.max() >= readout.full_scale:
        raise InputError(
            f"{path} must be in {-readout.full_scale}..{readout.full_scale - 1} ({readout.sample_bits} bits), not "
            f"{codes.min()}..{codes.max()}"
        )
    return codes


def textures_of(weights: IntegerWeights, dataset: str) -> tuple[Dataset, list[str]]:
    """Return a dataset, and the names of its textures outside the training set, or of all textures."""
    training = TrainingNotes.of(weights)
    data = open_dataset(dataset)
    names = [texture.name for texture in data]
    unseen = [one for one in names if one in training.tested] if training.dataset == data.name else names
    return data, unseen or names


def recordings_of(weights: IntegerWeights, readout: ReadoutConfig, place: Path) -> RecordingSet:
    """Return a user's recordings, prepared as in the training."""
    own = TrainingNotes.of(weights).own
    if own is None:
        raise InputError("these weights were trained on textures; leave --data out, or train on recordings")
    return read_set(place, own.options, readout, EVERY_FIELD, flat=True)  # without labels too
