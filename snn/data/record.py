"""Record texture scans with the cycle-accurate model or with a variant of an encoder."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import Dataset, Texture
from eskin.skin.textures.presets import Scan
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import ScanData, collect

Tick = Callable[[], object]
"""Function that is called after each finished scan or recording."""

Variant = Literal["", "on"]
"""Events of a readout that are recorded: all of them, or only ON events."""


def said_of(texture: Texture, dataset_name: str, scan: Scan) -> dict[str, Any]:
    """Return the metadata of a recording: texture, dataset and scan preset."""
    return {
        "name": texture.name,
        "class": texture.class_name,
        "label": texture.label,
        "dataset": dataset_name,
        "preset": scan.name,
    }


def recorded(config: ReadoutConfig, codes: NDArray[np.int32], metadata: dict[str, Any]) -> Recording:
    """Return the events of codes from the cycle-accurate model."""
    from eskin.model.readout import Stimulus, simulate

    stimulus = Stimulus.from_samples(config, codes)
    return Recording(simulate(config, stimulus), config, stimulus.clocks, metadata=metadata)


def record(
    texture: Texture,
    dataset_name: str,
    scan: Scan,
    config: ReadoutConfig,
    start_row: float = 0.0,
    variant: Variant = "",
    image: NDArray[np.uint8] | None = None,
) -> Recording:
    """Return the recording of one texture scan by the cycle-accurate model.

    ``image`` holds the pixels of the texture, if they are loaded already.

    The recording has the events and the metadata of an RTL replay but ``source``, which is "model".
    """
    try:
        samples, clipped = scan.samples(config, texture.load() if image is None else image, start_row)
    except InputError as error:
        raise InputError(f"image {texture.name}: {error}") from None
    metadata = said_of(texture, dataset_name, scan) | {
        "start_row": start_row,
        "clipped_samples": clipped,
        "source": "model",
    }
    made = recorded(config, samples, metadata)
    return dataclasses.replace(made, events=made.events[made.events["p"]]) if variant == "on" else made


def record_dataset(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    bins: BinConfig,
    start_rows: Sequence[float] = (0.0,),
    progress: Tick | None = None,
    variant: Variant = "",
) -> ScanData:
    """Return the event counts of all textures of a dataset, with one scan per start row.

    - ``config``: from ``scan.configure``.
    - ``start_rows``: image rows of the array's top edge, in pixels; only 0 in the ``paper`` preset.
    - ``progress``: called after each scan.
    """
    recordings = []
    for texture in dataset:
        image = texture.load()
        for start_row in start_rows:
            recordings.append(record(texture, dataset.name, scan, config, start_row, variant, image))
            if progress is not None:
                progress()
    return collect(recordings, bins, dataset.class_names)
