"""Store the preparation of training recordings, so that other recordings are prepared equally."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.folder import RecordingSet, read_set
from eskin.skin.recordings.options import Preparation, scale_option

EVERY_FIELD = frozenset(field.name for field in dataclasses.fields(ReadoutConfig))
"""Names of all fields, so that no field follows the recordings."""


RUNS = Path("out")
"""Folder of the folders that ``eskin train`` writes by default; ``eskin quantise`` writes ``whole.npz`` there."""


def networks_of_recordings() -> dict[Path, str]:
    """Return the integer networks trained on a user's recordings, newest first, with the name of their folder."""
    found = {}
    for path in sorted(RUNS.glob("train*/whole.npz"), key=lambda path: path.stat().st_mtime, reverse=True):
        try:
            said = IntegerWeights.load(path).notes.get("training") or {}
        except InputError:
            continue
        if said.get("recordings") and isinstance(said.get("dataset"), str):
            found[path] = said["dataset"]
    return found


def network_of(place: Path) -> Path | None:
    """Return the newest integer network trained on a folder of recordings of this name, or None."""
    name = place.resolve().name
    return next((path for path, dataset in networks_of_recordings().items() if dataset == name), None)


@dataclass(frozen=True)
class OwnReadout:
    """Preparation, scale and configuration used for the recordings of a training."""

    config: ReadoutConfig
    options: Preparation  # with the resulting scale

    @classmethod
    def of(cls, recording: Recording) -> OwnReadout | None:
        """Return the preparation stored in an event file, or None for other files."""
        prepared, scale = recording.metadata.get("prepared"), recording.metadata.get("scale")
        if not isinstance(prepared, dict) or not isinstance(scale, float | list):
            return None
        return cls.from_dict({"readout": recording.config.to_dict(), "prepared": prepared, "scale": scale})

    @property
    def prepared(self) -> dict[str, Any]:
        """All fields of the preparation."""
        return dataclasses.asdict(self.options)

    def read(self, place: Path, flat: bool = False) -> RecordingSet:
        """Return other recordings, read and prepared as the training recordings were; ``flat`` as in ``read_set``."""
        return read_set(place, self.options, self.config, EVERY_FIELD, flat=flat)

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary for JSON."""
        factors = self.options.factors()
        scale = list(factors) if isinstance(factors, tuple) else factors
        return {"readout": self.config.to_dict(), "prepared": self.options.chosen(), "scale": scale}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> OwnReadout:
        """Return the object for a dictionary written by ``to_dict``; raise InputError if fields are wrong."""
        try:
            scale = fields["scale"]
            factors = tuple(map(float, scale)) if isinstance(scale, list) else float(scale)
            options = Preparation(**fields["prepared"], scale=scale_option(factors))
            return cls(ReadoutConfig.from_dict(fields["readout"]), options)
        except (KeyError, TypeError, ValueError):
            raise InputError(
                "the stored preparation, scale and readout are damaged; encode the recordings again"
            ) from None


@dataclass(frozen=True)
class TrainingNotes:
    """Notes of an integer network on its training.

    ``eskin.snn.experiments.trained.said_of_training`` describes the fields.
    """

    readout: ReadoutConfig
    dataset: str | None
    preset: str | None
    tested: dict[str, int]
    bin_s: float
    own: OwnReadout | None
    wiring: dict[str, Any] | None

    @classmethod
    def of(cls, weights: IntegerWeights, path: Path | str = "the network") -> TrainingNotes:
        """Return the notes of a network from a file; raise InputError without notes, or if they are damaged."""
        advice = "quantise again, with result.json of the training beside its weights"
        said = weights.notes.get("training")
        if not said:
            raise InputError(f"{path} lacks the readout of its training; {advice}")
        try:
            readout, own = ReadoutConfig.from_dict(said["readout"]), said["recordings"]
            dataset, preset, tested, bin_s = said["dataset"], said["preset"], dict(said["tested"]), float(said["bin_s"])
            owned = None if own is None else OwnReadout.from_dict(own)
            return cls(readout, dataset, preset, tested, bin_s, owned, said.get("wiring"))
        except (KeyError, TypeError, ValueError):
            raise InputError(f"the training data in {path} are damaged; {advice}") from None
