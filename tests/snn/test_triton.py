"""Test that the Triton kernels equal a plain loop, have no races, and compile for a GPU.

Without a GPU they run in Triton's interpreter, which must be chosen before Triton is imported: in a process of its
own, started by ``test_in_the_interpreter``. With a GPU the same tests also run compiled, in this process.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from eskin.base.errors import InputError
from eskin.snn.kernels import dense
from eskin.snn.kernels.layer import layer
from eskin.snn.kernels.rule import NeuronRule
from tests.snn.test_network import RULES, check, tensors

triton = pytest.importorskip("triton", reason="triton is not installed: pip install '.[gpu]'")

from triton.backends.compiler import GPUTarget  # noqa: E402
from triton.compiler import ASTSource  # noqa: E402

from eskin.snn.kernels import triton as kernel_triton  # noqa: E402

INTERPRETED = kernel_triton.INTERPRETED
DEVICE = "cpu" if INTERPRETED or not torch.cuda.is_available() else "cuda"
NOT_RUN = "no CUDA GPU: test_in_the_interpreter runs it"
runs = pytest.mark.skipif(not INTERPRETED and DEVICE == "cpu", reason=NOT_RUN)
interpreter_only = pytest.mark.skipif(not INTERPRETED, reason="test_in_the_interpreter runs it")
compiler_only = pytest.mark.skipif(INTERPRETED, reason="the interpreter is on")


@compiler_only
def test_in_the_interpreter() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", __file__],
        env={**os.environ, "TRITON_INTERPRET": "1"},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stdout[-8000:] + result.stderr[-2000:]
    assert NOT_RUN not in result.stdout


def on_device(rule: NeuronRule, **values: Tensor) -> Tensor:
    return layer(rule, **{name: value.to(DEVICE) for name, value in values.items()}, backend="triton").cpu()


def check_on_device(rule: NeuronRule, values: dict[str, Tensor]) -> Tensor:
    return check(on_device, rule, values, rtol=1e-4, part=1e-5)


@runs
@pytest.mark.parametrize(("rule", "recurrent"), [*((rule, True) for rule in RULES), (NeuronRule(), False)], ids=str)
def test_equals_plain_autograd(rule: NeuronRule, recurrent: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_triton, "COLUMNS", 32)  # two blocks of neurons, two of the sum
    values = tensors(5, 5, 6, 33, 0.5)
    values["decay"][::2] = 0.5  # sums stay exact
    if not recurrent:
        del values["w_rec"]
    assert 0.02 < check_on_device(rule, values).mean() < 0.6


@runs
@pytest.mark.parametrize(
    "shape", [(1, 1, 1, 1), (1, 5, 3, 6), (7, 5, 3, 6), (3, 18, 6, 70), (3, 2, 6, 150), (2, 33, 4, 16)], ids=str
)
def test_any_size_and_floor(shape: tuple[int, int, int, int]) -> None:
    for floor in (-0.25, -float("inf")) if shape[0] == 7 else (-0.25,):
        check_on_device(NeuronRule(floor=floor), tensors(*shape, 0.7))


class Memory:
    """Monitor of memory accesses that finds races between threads.

    Between two barriers of a program no address may be both read and written, or written twice; no address that one
    program writes may be touched by another. Triton may hold an element in several threads, so that even a read and
    a write of the very same place race.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from triton.runtime.interpreter import interpreter_builder as builder

        self.barriers = 0
        self.program = -1
        self.all_read: dict[int, set[int]] = {}
        self.all_written: dict[int, set[int]] = {}
        self.read: set[int] = set()
        self.written: set[int] = set()
        load, store, start = builder.create_masked_load, builder.create_masked_store, builder.set_grid_idx

        def watched_load(pointers: Any, mask: Any, *rest: Any) -> Any:
            self.note(self.read, self.all_read, pointers, mask)
            return load(pointers, mask, *rest)

        def watched_store(pointers: Any, value: Any, mask: Any, *rest: Any) -> Any:
            now = self.note(self.written, self.all_written, pointers, mask)
            assert len(now) == np.count_nonzero(mask.data), "an element is written twice at once"
            return store(pointers, value, mask, *rest)

        def watched_barrier() -> None:
            self.barriers += 1
            self.end_phase()

        def watched_start(*index: int) -> None:
            self.end_phase()
            self.program += 1
            start(*index)

        monkeypatch.setattr(builder, "create_masked_load", watched_load)
        monkeypatch.setattr(builder, "create_masked_store", watched_store)
        monkeypatch.setattr(builder, "create_barrier", watched_barrier)
        monkeypatch.setattr(builder, "set_grid_idx", watched_start)

    def note(self, phase: set[int], overall: dict[int, set[int]], pointers: Any, mask: Any) -> list[int]:
        now: list[int] = np.unique(pointers.data[mask.data]).tolist()
        if phase is self.written:
            assert phase.isdisjoint(now), "written twice between barriers"
        phase.update(now)
        for address in now:
            overall.setdefault(address, set()).add(self.program)
        return now

    def end_phase(self) -> None:
        assert self.read.isdisjoint(self.written), "read and written between the same two barriers"
        self.read.clear()
        self.written.clear()

    def finish(self) -> None:
        self.end_phase()
        for address, writers in self.all_written.items():
            assert len(writers | self.all_read.get(address, set())) == 1, "two programs share what one of them writes"


@interpreter_only
@pytest.mark.parametrize("recurrent", [True, False])
def test_barriers_part_all_reads_from_writes(recurrent: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_triton, "COLUMNS", 16)
    monkeypatch.setattr(kernel_triton, "INNER", 16)
    values = tensors(4, 18, 3, 33, 0.5)
    currents = values["x"] @ values["w_in"].t()
    matrix = values["w_rec"] if recurrent else None
    with monkeypatch.context() as patch:
        memory = Memory(patch)
        v, _ = kernel_triton.forward(NeuronRule(), values["decay"], matrix, currents)
        memory.finish()
    assert memory.barriers == 2 * 4  # programs times steps
    with monkeypatch.context() as patch:
        memory = Memory(patch)
        kernel_triton.backward(NeuronRule(), values["decay"], matrix, v, torch.ones_like(v))
        memory.finish()
    assert memory.barriers == 2 * 4
    assert len(memory.all_written) == v.numel()


class Compiler:
    """Fake kernel that compiles for an H100 instead of launching."""

    def __init__(self, kernel: Any) -> None:
        self.kernel = kernel

    def __getitem__(self, grid: tuple[int]) -> Callable[..., None]:
        return self.compile

    def compile(self, *arguments: Any, **options: Any) -> None:
        names = self.kernel.arg_names
        values = dict(zip(names, arguments, strict=False)) | {
            name: options.pop(name) for name in set(options) & {*names}
        }
        signature, constants, multiples = {}, {}, {}
        for place, name in enumerate(names):
            value = values[name]
            if isinstance(value, Tensor):
                signature[name] = "*fp32"
            elif isinstance(value, float):
                signature[name] = "fp32"
            elif isinstance(value, int) and name.islower() and value != 1:
                signature[name] = "i32"
            else:
                signature[name], constants[name] = "constexpr", value
            if isinstance(value, Tensor) or (signature[name] == "i32" and value % 16 == 0):
                multiples[(place,)] = [["tt.divisibility", 16]]
        source = ASTSource(self.kernel, signature, constants, multiples)
        self.made = triton.compile(source, target=GPUTarget("cuda", 90, 32), options=options)


def compiled(
    direction: str, rule: NeuronRule, shape: tuple[int, int, int], recurrent: bool, patch: pytest.MonkeyPatch
) -> Any:
    """Return the compiled forward or backward kernel."""
    name = f"{direction}_kernel"
    compiler = Compiler(getattr(kernel_triton, name))
    patch.setattr(kernel_triton, name, compiler)
    v, square = torch.zeros(shape), torch.zeros(shape[2], shape[2]) if recurrent else None
    rest = (v,) if direction == "forward" else (v, v)
    getattr(kernel_triton, direction)(rule, v[0, 0], square, *rest)
    return compiler.made


@compiler_only
@pytest.mark.parametrize("recurrent", [True, False])
@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("shape", [(200, 32, 256), (7, 5, 33), (1, 1, 1)], ids=str)
def test_compiles_with_the_barrier_at_the_end_of_each_step(
    direction: str, shape: tuple[int, int, int], recurrent: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TRITON_CACHE_DIR", str(tmp_path))
    made = compiled(direction, NeuronRule(), shape, recurrent, monkeypatch)
    assert made.asm["cubin"]
    assert made.metadata.shared <= 48 * 1024
    ptx = made.asm["ptx"]
    assert "ld.global.nc" not in ptx  # that path may miss what the program itself wrote
    assert "tf32" not in ptx
    if recurrent:
        assert "bar.sync" in ptx  # also around the tiles in shared memory
    else:
        assert ptx.count("bar.sync") == 1
    stores, _, after = made.asm["ttir"].rpartition("tt.store")
    assert stores
    assert "barrier" not in stores
    assert after.count("barrier") == 1
    assert "tt.load" not in after


@compiler_only
@pytest.mark.parametrize("rule", RULES, ids=str)
def test_every_rule_compiles(rule: NeuronRule, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TRITON_CACHE_DIR", str(tmp_path))
    for direction in ("forward", "backward") if rule in RULES[::8] else ("backward",):  # forward knows the reset alone
        assert compiled(direction, rule, (200, 32, 16), False, monkeypatch).asm["cubin"]


@pytest.mark.skipif(DEVICE == "cpu", reason="no CUDA GPU")
def test_a_gpu_takes_the_kernel_for_float32() -> None:
    values = {name: value.cuda().requires_grad_() for name, value in tensors(3, 2, 3, 5, 1.0).items()}
    assert layer(NeuronRule(), **values).grad_fn.loop is kernel_triton
    doubles = {name: value.double() for name, value in values.items()}
    assert layer(NeuronRule(), **doubles).grad_fn.loop is dense


@pytest.mark.parametrize("dtype", [torch.float64, *([] if INTERPRETED else [torch.float32])])
def test_other_tensors_are_refused(dtype: torch.dtype) -> None:
    values = {name: value.to(dtype) for name, value in tensors(3, 2, 3, 5, 1.0).items()}
    with pytest.raises(InputError, match="float32 on a CUDA GPU and the package triton; use torch"):
        layer(NeuronRule(), **values, backend="triton")
