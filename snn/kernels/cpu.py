"""Compile and call the C++ kernel (cpu.cpp) through ctypes.

Without a compiler, ``available()`` is false and ``eskin.snn.kernels.dense`` computes the layer with torch. The
functions here need contiguous float32 CPU tensors and check nothing else.
"""

import contextlib
import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from eskin.base import cache
from eskin.snn.kernels.rule import SURROGATES, NeuronRule

SOURCE = Path(__file__).with_name("cpu.cpp")
COMPILER_VARIABLE = "CXX"
"""Environment variable that names another compiler than g++."""

_FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-std=c++17", "-shared", "-fPIC")


class _Rule(ctypes.Structure):
    _fields_ = [
        ("floor", ctypes.c_float),
        ("scale", ctypes.c_float),
        ("width", ctypes.c_float),
        ("subtract", ctypes.c_int32),
        ("reset_gradient", ctypes.c_int32),
        ("surrogate", ctypes.c_int32),
    ]


class Entries(NamedTuple):
    """Non-zero entries of a matrix, row by row."""

    first: Tensor
    """Entries of row r are ``first[r] .. first[r + 1]``. Shape (rows + 1,)."""
    column: Tensor
    """Column of each entry; may be longer than the number of entries."""
    value: Tensor | None
    """Values; None if all are 1."""

    @property
    def filled(self) -> int:
        """Number of non-zero entries."""
        return int(self.first[-1])


def available() -> bool:
    """Return True if the C++ kernel can be compiled and used."""
    return _library() is not None


def pad(columns: int) -> int:
    """Return a matrix width rounded up to whole vector registers."""
    unit: int = _require().kernel_pad()
    return -(-columns // unit) * unit


def padded(matrix: Tensor, rows: int | None = None) -> Tensor:
    """Return a contiguous vector or matrix padded with zeros to whole vector registers."""
    shape = (*matrix.shape[:-1], pad(matrix.shape[-1])) if rows is None else (rows, pad(matrix.shape[-1]))
    if shape == tuple(matrix.shape):
        return matrix.detach().contiguous()
    out = torch.zeros(shape)
    out[tuple(slice(size) for size in matrix.shape)] = matrix.detach()
    return out


def entries_of(x: Tensor) -> Entries:
    """Return the non-zero entries of a matrix, shape (rows, columns)."""
    rows, columns = x.shape
    first = torch.empty(rows + 1, dtype=torch.int32)
    most = x.numel() + _require().kernel_room()
    index, value = torch.empty(most, dtype=torch.int32), torch.empty(most)
    _call("kernel_events", x, rows, columns, first, index, value)
    return Entries(first, index, value)


def product(entries: Entries, matrix: Tensor, start: Tensor) -> Tensor:
    """Return start (width,) plus the product of sparse entries (rows, columns) and a matrix (columns, width)."""
    out = torch.empty(len(entries.first) - 1, matrix.shape[1])
    _call("kernel_product", *entries, len(out), len(matrix), matrix, matrix.shape[1], start, out)
    return out


def dense_product(left: Tensor, inner: int, matrix: Tensor) -> Tensor:
    """Return the product of the first ``inner`` columns of left (rows, pitch) and a matrix (inner, width)."""
    out = torch.empty(len(left), matrix.shape[1])
    _call("kernel_dense_product", left, *left.shape, matrix, inner, matrix.shape[1], out)
    return out


def outer(entries: Entries, columns: int, grad: Tensor) -> Tensor:
    """Return the transpose of sparse entries (rows, columns) times grad (rows, width), shape (columns, width)."""
    out = torch.zeros(columns, grad.shape[1])
    _call("kernel_outer", *entries, len(grad), columns, grad, grad.shape[1], out)
    return out


def forward(rule: NeuronRule, decay: Tensor, recurrent: Tensor | None, v: Tensor) -> tuple[Tensor, Entries]:
    """Compute potentials from currents in place, and return the spikes, dense and sparse.

    - ``decay``: shape (width,).
    - ``recurrent``: shape (width, width) or None; row j goes to the currents of the next step for every spike of neuron
      j.
    - ``v``: shape (steps, batch, width).
    """
    steps, batch, width = v.shape
    s = torch.empty_like(v)
    first = torch.empty(steps * batch + 1, dtype=torch.int32)
    index = torch.empty(v.numel() + _require().kernel_room(), dtype=torch.int32)
    _call("kernel_forward", steps, batch, width, _rule(rule), decay, recurrent, v, s, first, index)
    return s, Entries(first, index, None)


def backward(
    rule: NeuronRule, decay: Tensor, matrix: Tensor | None, v: Tensor, grad_s: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the gradients of the currents (steps, batch, width) and of the decay (width,).

    ``matrix``, shape (neurons, width) or None: the recurrent weights, one row per receiving neuron.
    """
    steps, batch, width = v.shape
    grad, grad_decay = torch.empty_like(v), torch.zeros(width)
    neurons = 0 if matrix is None else len(matrix)
    sizes = (steps, batch, width, neurons)
    _call("kernel_backward", *sizes, _rule(rule), decay, matrix, v, grad_s, grad, grad_decay)
    return grad, grad_decay


def _rule(rule: NeuronRule) -> Any:
    fields = _Rule(
        rule.floor,
        rule.surrogate_scale,
        rule.surrogate_width,
        rule.reset == "subtract",
        rule.reset_gradient,
        SURROGATES.index(rule.surrogate),
    )
    return ctypes.byref(fields)


def _call(name: str, *arguments: Any) -> None:
    """Call a library function with tensors as pointers and integers as 64 bits."""
    converted: list[Any] = []
    for argument in arguments:
        if isinstance(argument, Tensor):
            assert argument.is_contiguous()
            converted.append(ctypes.c_void_p(argument.data_ptr()))
        else:
            converted.append(ctypes.c_int64(argument) if isinstance(argument, int) else argument)
    getattr(_require(), name)(*converted)


def _require() -> ctypes.CDLL:
    library = _library()
    assert library is not None, "callers check available() first"
    return library


@functools.cache
def _library() -> ctypes.CDLL | None:
    """Return the compiled library, or None without a working compiler."""
    compiler = shutil.which(os.environ.get(COMPILER_VARIABLE, "g++"))
    if compiler is None:
        return None
    key = "\0".join((SOURCE.read_text(), compiler, *_FLAGS, platform.machine(), _instructions()))
    name = f"kernel-{hashlib.sha256(key.encode()).hexdigest()[:16]}.so"
    failures = (OSError, subprocess.CalledProcessError)
    with contextlib.suppress(*failures):
        if (folder := cache.usable()) is not None:
            path = folder / name
            if not cache.is_private(path):
                path.unlink(missing_ok=True)
                _compile(compiler, path)
            return _load(path)
    with contextlib.suppress(*failures), tempfile.TemporaryDirectory() as own:  # private: nobody else can write there
        _compile(compiler, Path(own) / name)
        return _load(Path(own) / name)
    return None


def _load(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    library.kernel_keep_memory()
    return library


def _compile(compiler: str, path: Path) -> None:
    """Compile the library to a temporary name, then rename it."""
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        made = Path(folder) / path.name
        subprocess.run([compiler, *_FLAGS, str(SOURCE), "-o", str(made)], check=True, capture_output=True)
        made.chmod(0o700)
        os.replace(made, path)


def _instructions() -> str:
    """Return a text that identifies the processor type, because the kernel uses all its instructions."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), platform.processor())
