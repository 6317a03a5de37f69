"""Find event files in folders, and read them with names and classes."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from eskin.base.errors import InputError
from eskin.base.inputs import find_files
from eskin.model.events.recording import Recording
from eskin.skin.foreign.address_map import AddressMap
from eskin.skin.foreign.aedat4 import SUFFIX as AEDAT4
from eskin.skin.foreign.files import is_foreign, load_foreign
from eskin.skin.recordings.trained_on import OwnReadout


class EventFile(NamedTuple):
    """An event file, and the folder to which its name is relative."""

    path: Path
    root: Path

    @property
    def name(self) -> str:
        """Path of the file relative to the folder, without suffix: sand/03."""
        return self.path.relative_to(self.root).with_suffix("").as_posix()

    @property
    def class_folder(self) -> str | None:
        """First folder on the relative path of the file, or None."""
        parts = self.path.relative_to(self.root).parts
        return parts[0] if len(parts) > 1 else None


def event_files(paths: Iterable[Path]) -> list[EventFile]:
    """Return the given event files and those below the given folders, without duplicates, ordered by name.

    Raise InputError if a path does not exist, or a folder contains no event files.
    """
    found: list[EventFile] = []
    for path in paths:
        if not path.exists():
            raise InputError(f"event folder or file {path} does not exist; make one with eskin replay")
        if not path.is_dir():
            whole = path.absolute()  # with class folder and the folder above
            found.append(EventFile(whole, whole.parent.parent))
            continue
        inside, others = find_files(path, (".npz", AEDAT4))
        if others:
            raise InputError(
                f"event folder {path} has an entry that is not an event file: {others[0]}; fetch or remove it"
            )
        if not inside:
            raise InputError(
                f"event folder {path} holds no event files (.npz, .aedat4); record some with eskin replay, or "
                f"eskin encode on a folder of class folders"
            )
        found += [EventFile(file, path) for file in inside]
    return list({file.path.resolve(): file for file in found}.values())


def class_of(recording: Recording) -> str | None:
    """Return the class in the metadata of a recording."""
    for key in ("class", "label"):
        if isinstance(found := recording.metadata.get(key), str) and found:
            return found
    return None


def own_readout(folder: Path) -> OwnReadout | None:
    """Return preparation and readout of a user's recordings, or None for other event files."""
    return OwnReadout.of(Recording.load(event_files([folder])[0].path))


def read_recordings(
    files: Sequence[EventFile],
    classes: Sequence[str] | None = None,
    progress: Callable[[], object] | None = None,
    mapping: AddressMap | None = None,
) -> list[Recording]:
    """Return the recordings of event files with name and, if known, class in the metadata.

    A recording is identified by the name in its metadata if that name contains a folder (class/file of ``eskin
    encode``) or belongs to a scan of an image; else by its path below the root. The class is that of the metadata, else
    the folder.

    - ``classes``: names of classes; other folders are no class.
    - ``progress``: called after each file.
    - ``mapping``: taxels of the addresses of foreign event files.
    """
    recordings = []
    for file in files:
        recording = load_foreign(file.path, mapping) if is_foreign(file.path) else Recording.load(file.path)
        known = {"name": _name(recording, file)}
        kind = class_of(recording) or file.class_folder
        if kind is not None and (class_of(recording) is not None or classes is None or kind in classes):
            known["class"] = kind
        recordings.append(dataclasses.replace(recording, metadata=recording.metadata | known))
        if progress is not None:
            progress()
    times = Counter(_scan_of(recording) for recording in recordings)
    for number, (file, recording) in enumerate(zip(files, recordings, strict=True)):
        if times[_scan_of(recording)] > 1 and not (_is_scan(recording) and "/" in recording.metadata["name"]):
            # Two files with one name, not two recordings of one image.
            recordings[number] = dataclasses.replace(recording, metadata=recording.metadata | {"name": file.name})
    return recordings


def image_of(recording: Recording) -> tuple[str, str, str]:
    """Return dataset, class and name of a recording, equal for all scans of one image."""
    metadata = recording.metadata
    return str(metadata.get("dataset")), str(metadata.get("class")), str(metadata.get("name"))


def _scan_of(recording: Recording) -> tuple[object, ...]:
    """Return the metadata that identify one scan of an image."""
    return *image_of(recording), recording.metadata["start_row"] if _is_scan(recording) else None


def _name(recording: Recording, file: EventFile) -> str:
    name = recording.metadata.get("name")
    return name if isinstance(name, str) and name and ("/" in name or _is_scan(recording)) else file.name


def _is_scan(recording: Recording) -> bool:
    """Return True if the metadata contain a start row, as for scans of an image."""
    return isinstance(recording.metadata.get("start_row"), (int, float))
