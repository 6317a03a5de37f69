"""What a recording of the RTL stands for: a digest of all that made it."""

from __future__ import annotations

import functools
import hashlib
from typing import Any

import cocotb_tests
import model
from cocotb_tests.session.simulator import Build
from cocotb_tests.session.store import sources

SOURCES = ((model, "*.py"), (model, "textures/*.py"), (cocotb_tests, "bench/*.py"))
"""Of the samples, the stimulus, the expected events, and the bench that compares them."""


def proof(program: Build, texture: Any, start_row: float = 0.0) -> str:
    """Return a digest of RTL and harness (the name of the program has it), of ``SOURCES``, and of the image."""
    digest = hashlib.sha256(f"{program.folder.name} {start_row} {_sources()}".encode())
    digest.update(texture.load().tobytes())
    return digest.hexdigest()


def proof_of(program: Build, samples: str) -> str:
    """Return a digest of RTL and harness, of ``SOURCES``, and of samples, by a digest of their own."""
    return hashlib.sha256(f"{program.folder.name} {samples} {_sources()}".encode()).hexdigest()


@functools.cache
def _sources() -> str:
    return sources(SOURCES)
