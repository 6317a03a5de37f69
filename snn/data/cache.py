"""Cache of recorded scans between runs (docs/guide/classifier.md).

The name of an entry is a checksum of everything that determines it: image bytes, scan, readout, start rows, time steps,
and the sources and libraries that compute it. An entry is therefore never outdated. If the cache is full, the least
recently used entries are removed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import io
import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eskin import model, skin
from eskin.base import cache
from eskin.base.errors import InputError
from eskin.base.files import atomic_write, plain
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.presets import Scan
from eskin.snn.data.scans import ScanData

LIMIT_BYTES = 2**30
"""Largest size of all cached scans together."""

_ARRAYS = ("values", "labels", "images")
_ABANDONED_S = 3600.0
"""Age of a half-written entry from which its writer counts as dead."""


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
    return sorted(folder.glob("*.npz"))


def _read(path: Path) -> ScanData | None:
    """Return a cache entry, or None for a missing or damaged entry."""
    if not cache.is_private(path):
        return None
    try:
        with np.load(path, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in _ARRAYS}
        if not len(arrays["values"]) == len(arrays["labels"]) == len(arrays["images"]) > 0:
            return None
        names, class_names = tuple(header.pop("names")), tuple(header.pop("class_names"))
        if header["lengths"] is not None:
            header["lengths"] = np.array(header["lengths"], np.int64)
        return ScanData(**arrays, names=names, class_names=class_names, **header)
    except Exception:  # a damaged archive makes zipfile, zlib and NumPy raise almost any type
        return None


def _write(path: Path, data: ScanData) -> None:
    header = {field.name: getattr(data, field.name) for field in dataclasses.fields(data) if field.name not in _ARRAYS}
    header["lengths"] = None if data.lengths is None else data.lengths.tolist()
    content = io.BytesIO()
    np.savez_compressed(content, header=np.array(json.dumps(header)), **{n: getattr(data, n) for n in _ARRAYS})
    with atomic_write(path) as file:
        file.write(content.getvalue())


def _shrink(folder: Path, newest: Path) -> None:
    """Remove the least recently used entries beyond the size limit, and temporary files of killed processes."""
    for path in folder.glob(".*.part"):
        if time.time() - path.stat().st_mtime > _ABANDONED_S:
            path.unlink(missing_ok=True)
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
