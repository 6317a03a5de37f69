"""Add scans of recordings at other gains, as a lighter or firmer touch gives them, for the training."""

import dataclasses
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig
from eskin.model.taxel import encode_timed
from eskin.skin.recordings.event_files import signals_of
from eskin.skin.recordings.prepare import at_gain, levels_of
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.recordings import own_readout
from eskin.snn.data.scans import ScanData, filled

GAINS = (0.7, 1.4)
"""Gains that inner validation compares with none where recordings have groups."""


def binned(config: ReadoutConfig, codes: NDArray[np.int32], bins: BinConfig) -> NDArray[np.int16]:
    """Return the event counts of a recording, shape (steps, channels), where every event leaves within its sample.

    ``codes``: shape (ticks, taxels). A last bin that is not full is left out, unless it is the only one.
    """
    counts, _ = encode_timed(config, codes)
    channels = np.hstack([np.maximum(counts, 0), np.maximum(-counts, 0)]) if config.has_polarity else counts
    start_s, end_s = bins.start_s or 0.0, min(bins.stop_s or math.inf, len(codes) / config.sample_rate_hz)
    steps = max(math.floor((end_s - start_s) / bins.bin_s + 1e-9), 1)
    time_s = (np.arange(len(codes)) + 0.5) / config.sample_rate_hz
    step = np.floor((time_s - start_s) / bins.bin_s).astype(np.int64)
    seen = (step >= 0) & (step < steps)
    found = np.zeros((steps, channels.shape[1]), np.int16)
    np.add.at(found, step[seen], channels[seen])
    return found


def with_gains(data: ScanData, folder: Path, bins: BinConfig) -> ScanData:
    """Return the scans of a user's recordings, followed for each recording by scans at the gains of the preparation."""
    own = own_readout(folder)
    if own is None or not own.options.gains:
        return data
    codes, _ = signals_of(folder)
    config, options = own.config, own.options
    levels = levels_of(options, options.factors(), config.sample_bits, config.taxels)
    more = [
        binned(config, at_gain(codes[name], gain, levels, config.sample_bits), bins)
        for gain in options.gains
        for name in data.names
    ]
    again = np.tile(np.arange(len(data.names)), len(options.gains))
    scans = [data.values[scan, : data.steps_of(scan)] for scan in range(len(data))]
    return dataclasses.replace(
        data,
        values=filled([*scans, *more]),
        labels=np.concatenate([data.labels, data.image_labels[again]]),
        images=np.concatenate([data.images, again]),
        lengths=np.array([len(scan) for scan in (*scans, *more)], np.int64),
    )
