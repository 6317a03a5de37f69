"""Cache of event files encoded from recordings, with their samples, keyed by a digest of all inputs."""

import hashlib
import inspect
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin import model
from eskin.base.errors import InputError
from eskin.base.files import read_arrays, write_arrays, write_json
from eskin.base.workers.engine import Pool
from eskin.model import __version__
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.fitting import Fit
from eskin.skin.recordings.folder import RecordingSet, quality_warnings, read_set, sources_of, write_folder
from eskin.skin.recordings.options import Preparation

_MODEL, _HERE = Path(model.__file__).parent, Path(__file__).parent
KEPT = Path("out/recordings")  # folder of the event files that commands encode from folders of recordings

SEGMENT, BANDS = 64, 16
"""Samples of a segment of the spectrum (Welch, half overlapping, Hann), and bands into which its lines are averaged."""

BIN_SEGMENT, SPECTRUM = 256, 0.9
"""Samples of a segment of the spectrum that sets a time bin, and the share of its power up to its edge."""

_FILE = "signals.codes"  # file of codes: an archive like ``.npz``, without the ending of event files
CHOICE = "choice.json"  # file of the scores of the settings that were compared
_CODES = "codes/"
_LEAST = 1e-6  # small number that is added to deviations and powers before a logarithm


def kept_events(
    place: Path,
    options: Preparation,
    config: ReadoutConfig,
    given: Collection[str] = (),
    progress: Callable[[], object] | None = None,
    pool: Pool | None = None,
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
    sources, left_out = sources_of(place, flat or options.splits, options.strict)
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
        write_json(part / CHOICE, {"scores": list(recordings.scores)})
        part.chmod(0o755)
        if not folder.is_dir():
            os.replace(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    chosen = flat or "resolution" not in given  # flat: a network has the resolution
    warnings = quality_warnings(recordings.config, recordings.codes, quality, chosen)
    return folder, recordings.notes, (*recordings.warnings, *warnings)


def statistics(signal: NDArray[Any]) -> NDArray[np.float64]:
    """Return mean, log deviation and log band powers of every column, shape (columns * (2 + BANDS),).

    A signal, shape (ticks, columns), that is shorter than a segment is extended with its last sample.
    """
    from scipy.signal import welch

    signal = np.asarray(signal, np.float64)
    filled = np.pad(signal, ((0, max(SEGMENT - len(signal), 0)), (0, 0)), mode="edge")
    power = welch(filled, nperseg=SEGMENT, axis=0)[1][1:]
    bands = np.array([part.mean(0) for part in np.array_split(power, BANDS)])
    logs = np.log(np.vstack([signal.std(0)[None], np.sqrt(bands)]) + _LEAST)
    return np.concatenate([signal.mean(0), logs.ravel()])


def write_signals(recordings: RecordingSet, folder: Path) -> None:
    """Write the codes of every recording beside their event files."""
    config, named = recordings.config, zip(recordings.sources, recordings.codes, strict=True)
    arrays: dict[str, Any] = {f"{_CODES}{source.name}": codes for source, codes in named}
    arrays |= {"sample_rate_hz": np.array(config.sample_rate_hz), "full_scale": np.array(config.full_scale)}
    write_arrays(folder / _FILE, arrays, compressed=True)


def signals_of(folder: Path) -> tuple[dict[str, NDArray[np.int32]], float]:
    """Return the codes of each recording by name, shape (ticks, taxels), and their common samples per second.

    Raise InputError if the folder has no samples, as one of event files alone, or they are damaged.
    """
    if (found := _read(folder)) is None:
        raise InputError("frames need samples, and event files have none; give textures or --data")
    return found[:2]


def seconds_of(folder: Path) -> NDArray[np.float64] | None:
    """Return the length in seconds of each recording in a folder of event files; None if unknown."""
    if (found := _read(folder)) is None:
        return None
    codes, rate_hz, _ = found
    return np.array([len(one) / rate_hz for one in codes.values()])


def bin_of_spectrum(signals: Sequence[NDArray[Any]], rate_hz: float) -> float:
    """Return a time bin in seconds for signals, shape (ticks, taxels): whole sample periods, nearest to a quarter
    period of the frequency below which ``SPECTRUM`` of their power lies, without their means."""
    from scipy.signal import welch

    power = np.zeros(BIN_SEGMENT // 2 + 1)
    for signal in signals:
        filled = np.pad(signal - signal.mean(0), ((0, max(BIN_SEGMENT - len(signal), 0)), (0, 0)))
        power += welch(filled, nperseg=BIN_SEGMENT, axis=0)[1].sum(1)
    share = np.cumsum(power) / max(power.sum(), np.finfo(float).tiny)
    edge_hz = rate_hz * max(int(np.searchsorted(share, SPECTRUM)), 1) / BIN_SEGMENT
    return max(round(rate_hz / (4 * edge_hz)), 1) / rate_hz


def signal_statistics(folder: Path, names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Return the signal statistics of recordings, shape (recordings, columns); None without stored samples."""
    if (found := _read(folder)) is None or not set(names) <= set(found[0]):
        return None
    codes, _, full_scale = found
    return np.array([statistics(codes[name] / full_scale) for name in names])


def _read(folder: Path) -> tuple[dict[str, NDArray[np.int32]], float, int] | None:
    """Return codes by name, samples per second and full scale, or None for a folder without samples."""
    path = folder / _FILE
    if not path.exists():
        return None
    stored = read_arrays(path, "the samples of recordings", "remove its folder")
    if not {"sample_rate_hz", "full_scale"} <= set(stored):
        raise InputError(f"{path} is damaged, or of an earlier version; remove its folder")
    codes = {name.removeprefix(_CODES): array for name, array in stored.items() if name.startswith(_CODES)}
    return codes, float(stored["sample_rate_hz"]), int(stored["full_scale"])
