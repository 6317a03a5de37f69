"""Cache of recorded scans between runs (docs/guide/classifier.md).

The name of an entry is a checksum of everything that determines it: image bytes, scan, readout, start rows, time steps,
and the sources and libraries that compute it. An entry is therefore never outdated. If the cache is full, the least
recently used entries are removed.
"""

import contextlib
import dataclasses
import functools
import hashlib
import json
import os
import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eskin import model, skin
from eskin.base import cache
from eskin.base.errors import InputError
from eskin.base.files import plain, read_arrays, write_arrays
from eskin.base.outputs import PART
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.presets import Scan
from eskin.snn.data.scans import ScanData

LIMIT_BYTES = 2**30
"""Largest size of all cached scans together."""


def kept(key: str, make: Callable[[], ScanData]) -> ScanData:
    """Return the scans of a key from the cache, or compute them with ``make`` and cache them.

    Without a trusted folder, or on a full disk, nothing is cached.
    """
    folder = cache.usable("scans")
    if folder is None:
        return make()
    path = folder / f"{key}.npz"
    if (found := _read(path)) is not None:
        with contextlib.suppress(OSError):
            os.utime(path)  # time of the last use
        return found
    data = make()
    with contextlib.suppress(InputError, OSError):
        _write(path, data)
        _shrink(folder, path)
    return data


def key_of(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    steps: Any,
    start_rows: Sequence[float],
) -> str:
    """Return the cache key for scans of a dataset.

    - ``dataset``, ``scan``, ``config``, ``start_rows``: values that determine the recording.
    - ``steps``: conversion of events or frames to time steps.
    """
    images = [[t.name, t.class_name, t.label, _sum(t.path, t.path.stat().st_mtime_ns), t.crop] for t in dataset]
    parts = {
        "computed by": _computed_by(),
        "images": images,
        "classes": dataset.class_names,
        "scan": [type(scan).__name__, dataclasses.asdict(scan)],
        "config": config.to_dict(),
        "steps": [type(steps).__name__, dataclasses.asdict(steps)],
        "start rows": list(start_rows),
    }
    return hashlib.sha256(json.dumps(plain(parts), sort_keys=True).encode()).hexdigest()[:40]


def size() -> tuple[int, int]:
    """Return the number of cache entries, and their size in bytes."""
    sizes = [path.stat().st_size for path in _entries(cache.folder() / "scans")]
    return len(sizes), sum(sizes)


def clear() -> int:
    """Remove all cache entries; return their number."""
    entries = _entries(cache.folder() / "scans")
    for path in entries:
        path.unlink(missing_ok=True)
    return len(entries)


def _entries(folder: Path) -> list[Path]:
    """Return the entries, and the temporary files of their writers."""
    return sorted(path for path in folder.glob("*") if path.suffix in (".npz", PART))


def _read(path: Path) -> ScanData | None:
    """Return a cache entry, or None for a missing or damaged entry."""
    if not cache.is_private(path):
        return None
    try:
        arrays: dict[str, Any] = dict(read_arrays(path, "scans", "remove it"))
        fields = json.loads(str(arrays.pop("fields")))
        fields |= {name: tuple(fields[name]) for name in ("names", "class_names")}
        return ScanData(**arrays, **fields)
    except (InputError, KeyError, TypeError, ValueError):
        return None


def _write(path: Path, data: ScanData) -> None:
    values = {field.name: getattr(data, field.name) for field in dataclasses.fields(data)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    fields = np.array(json.dumps({name: value for name, value in values.items() if name not in arrays}))
    write_arrays(path, arrays | {"fields": fields}, compressed=True)


def _shrink(folder: Path, newest: Path) -> None:
    """Remove the least recently used entries beyond the size limit."""
    by_use = sorted((path.stat().st_mtime_ns, path.stat().st_size, path) for path in _entries(folder))
    total = sum(size for _, size, _ in by_use)
    for _, size, path in by_use:
        if total <= LIMIT_BYTES or path == newest:
            break
        path.unlink(missing_ok=True)
        total -= size


@functools.lru_cache(maxsize=4096)
def _sum(path: Path, modified: int) -> str:
    """Return the SHA-256 sum of a file, cached within the process by modification time."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@functools.cache
def _computed_by() -> list[str]:
    """Return a checksum of the sources and library versions that determine the scans."""
    import numba
    import scipy

    found = hashlib.sha256()
    for folder in (Path(str(model.__file__)).parent, Path(str(skin.__file__)).parent, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            found.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes() + b"\0")
    return [found.hexdigest(), np.__version__, scipy.__version__, numba.__version__, platform.machine()]
