"""Cache of event files encoded from recordings, keyed by a digest of all inputs."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Collection
from dataclasses import asdict
from pathlib import Path

from eskin import model
from eskin.base.errors import InputError
from eskin.base.workers.pool import WorkerPool
from eskin.model import __version__
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.fitting import Fit
from eskin.skin.recordings.folder import quality_warnings, read_set, sources_of, write_folder
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.statistics import write_signals

_MODEL, _HERE = Path(model.__file__).parent, Path(__file__).parent
KEPT = Path("out/recordings")  # folder of the event files that commands encode from folders of recordings


def kept_events(
    place: Path,
    options: Preparation,
    config: ReadoutConfig,
    given: Collection[str] = (),
    progress: Callable[[], object] | None = None,
    pool: WorkerPool | None = None,
    flat: bool = False,
    fit: Fit | None = None,
) -> tuple[Path, tuple[str, ...], tuple[str, ...]]:
    """Return the folder of event files for class folders, with notes and warnings; encode the recordings if needed.

    With ``flat``, recordings may be beside the class folders, or a single file; they have no class. ``fit`` chooses
    what is not given.

    The folder's name contains a digest of recordings, options, configuration and the model's source files, so files
    made by anything else are never used.
    """
    fit = fit or Fit()
    settings = [__version__, asdict(options), config.to_dict(), sorted(given), repr(fit)]
    digest = hashlib.sha256(json.dumps(settings).encode())
    for file in sorted([*_MODEL.rglob("*.py"), *_HERE.glob("*.py"), Path(inspect.getfile(type(fit)))]):
        digest.update(file.read_bytes())
    sources, left_out = sources_of(place, flat, options.strict)
    for source in sources:
        try:
            digest.update(source.name.encode() + source.path.suffix.encode() + b"\0" + source.path.read_bytes())
        except OSError as error:
            raise InputError(f"cannot read {source.path}: {error.strerror}") from None
    folder = KEPT / f"{place.resolve().name}-{digest.hexdigest()[:12]}"
    if folder.is_dir():
        return folder, (), left_out
    recordings = read_set(place, options, config, given, progress, flat, fit)
    try:
        KEPT.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=KEPT))
    except OSError as error:
        raise InputError(f"cannot make a folder in {KEPT}: {error.strerror}") from None
    try:
        quality, _ = write_folder(recordings, part, pool)
        write_signals(recordings, part)
        part.chmod(0o755)
        if not folder.is_dir():
            os.replace(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    warnings = quality_warnings(recordings.config, recordings.codes, quality)
    return folder, recordings.notes, (*recordings.warnings, *warnings)
