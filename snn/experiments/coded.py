"""Data rate of an experiment's readout after lossless compression (``eskin.snn.data.coding``)."""

from __future__ import annotations

from pathlib import Path

from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.data.coding import coded_events, coded_frames
from eskin.snn.data.frames import codes_of
from eskin.snn.data.record import record
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.experiments.experiment import Experiment

SCANS = 24
"""Number of scans that are compressed as one stream, evenly spread over the images."""


def coded_bps(experiment: Experiment) -> dict[str, float]:
    """Return the compressed bits per second of each form in which ``snn/data/coding.py`` codes events or frames."""
    if experiment.events is not None:
        files = event_files([Path(experiment.events)])
        return _of_events(read_recordings(files[:: -(-len(files) // SCANS)]))
    scan, config = experiment.scan_and_config()
    textures = open_dataset(experiment.dataset).limit(SCANS)
    frames = experiment.frames
    if frames is None:
        kind = experiment.variant
        recordings = [record(texture, textures.name, scan, config, variant=kind) for texture in textures]
        return _of_events(recordings, experiment.bins.start_s)
    codes = [codes_of(frames, texture.load(), scan, config) for texture in textures]
    seconds = sum(map(len, codes)) / frames.rate_hz
    return {name: bits / seconds for name, bits in coded_frames(codes, frames.bits).items()}


def _of_events(recordings: list[Recording], start_s: float | None = None) -> dict[str, float]:
    seconds = sum(recording.duration_s for recording in recordings)
    return {name: bits / seconds for name, bits in coded_events(recordings, start_s).items()}
