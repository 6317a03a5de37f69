"""Time loop of a layer on a GPU: one Triton kernel forward, one backward.

Importing this module imports Triton; ``eskin.snn.kernels.layer`` does so on demand. All tensors are contiguous float32
of shape (steps, batch, neurons), and of shape (neurons, neurons) and (neurons,); nothing else is checked.

A program (CUDA block) owns ROWS sequences of the batch for all steps and all neurons, so programs never wait for each
other. A step is done in blocks of COLUMNS neurons. Each needs the spikes (backwards: the gradients) of *all* neurons
one step earlier, of any number of neurons, so these pass through global memory, written by other threads of the
same program. The hazards, and what guards them:

* Read after write. Step t reads of v and s (backwards: grad) what step t - 1 (t + 1) wrote: the barrier after the
  blocks of each step, which every thread of the program passes, orders the two and makes the writes visible.
  Triton pipelines loads of the inner loop, over the products, only; that loop stores nothing, lies between two
  barriers, and its first loads come after the barrier before it.
* Write after read, write after write. Triton may hold an element in several threads, of which one may store before
  another has loaded. No kernel therefore works in place: every element is written once and read only after the barrier.
* Between programs there is nothing to order: they share inputs only.
"""

# no "from __future__ import annotations": Triton reads the annotations of kernels

from typing import TYPE_CHECKING

import torch
import triton
import triton.language as tl
from torch import Tensor

if TYPE_CHECKING:
    from eskin.snn.kernels.rule import NeuronRule

INTERPRETED: bool = triton.knobs.runtime.interpret
"""Whether Triton's interpreter runs the kernels, with NumPy on the CPU (TRITON_INTERPRET=1 before the import)."""

ROWS = 16
"""Number of sequences per program."""
COLUMNS = 128
"""Most neurons of a block; a power of two, at least 16."""
INNER = 32
"""Neurons of the previous step multiplied at once; a power of two, at least 8."""
OPTIONS = {"num_warps": 8, "enable_fp_fusion": True}
"""Options of the compiler; sums of products stay in float32 with or without fusion."""


def forward(rule: "NeuronRule", decay: Tensor, w_rec: Tensor | None, currents: Tensor) -> tuple[Tensor, Tensor]:
    """Return potentials and spikes, both of shape (steps, batch, neurons)."""
    v, s = torch.empty_like(currents), torch.empty_like(currents)
    matrix = None if w_rec is None else w_rec.t().contiguous()
    subtract = rule.reset == "subtract"
    with torch.cuda.device_of(v):
        forward_kernel[_grid(v)](
            currents, decay, matrix, v, s, *v.shape, rule.floor, SUBTRACT=subtract, **_tile(v), **OPTIONS
        )
    return v, s


def backward(rule: "NeuronRule", decay: Tensor, w_rec: Tensor | None, v: Tensor, grad_s: Tensor) -> Tensor:
    """Return the gradient of the currents for the gradient of the spikes, shape (steps, batch, neurons)."""
    grad = torch.empty_like(v)
    matrix = None if w_rec is None else w_rec.contiguous()
    with torch.cuda.device_of(v):
        backward_kernel[_grid(v)](
            v,
            grad_s,
            decay,
            matrix,
            grad,
            *v.shape,
            rule.floor,
            rule.surrogate_scale / rule.surrogate_width,
            1.0 / rule.surrogate_width,
            SUBTRACT=rule.reset == "subtract",
            RESET_GRADIENT=rule.reset_gradient,
            SURROGATE=rule.surrogate,
            **_tile(v),
            **OPTIONS,
        )
    return grad


def _grid(v: Tensor) -> tuple[int]:
    return (triton.cdiv(v.shape[1], ROWS),)


def _tile(v: Tensor) -> dict[str, int]:
    columns = min(COLUMNS, max(16, triton.next_power_of_2(v.shape[2])))
    return {"ROWS": ROWS, "COLUMNS": columns, "INNER": INNER}


@triton.jit
def forward_kernel(
    currents: tl.tensor,
    decay: tl.tensor,
    matrix: tl.tensor,
    v: tl.tensor,
    s: tl.tensor,
    steps: tl.tensor,
    batch: tl.tensor,
    neurons: tl.tensor,
    floor: tl.tensor,
    SUBTRACT: tl.constexpr,
    ROWS: tl.constexpr,
    COLUMNS: tl.constexpr,
    INNER: tl.constexpr,
) -> None:
    """Compute potentials and spikes of all steps for ROWS sequences.

    ``matrix``: the transpose of w_rec, or None. All other arguments as in ``forward``.
    """
    rows = tl.program_id(0).to(tl.int64) * ROWS + tl.arange(0, ROWS)
    size = tl.cast(batch, tl.int64) * neurons
    for t in range(steps):
        now = t * size
        before = now - size
        for first in range(0, neurons, COLUMNS):
            columns = first + tl.arange(0, COLUMNS)
            inside = (rows < batch)[:, None] & (columns < neurons)[None, :]
            place = rows[:, None] * neurons + columns[None, :]
            last = tl.load(v + before + place, mask=inside & (t > 0), other=0.0)
            fired = tl.where(last > 1.0, 1.0, 0.0)
            carry = last - fired if SUBTRACT else last * (1.0 - fired)
            kept = tl.load(decay + columns, mask=columns < neurons, other=0.0)
            potential = tl.load(currents + now + place, mask=inside, other=0.0) + kept[None, :] * carry
            if matrix is not None:
                potential += _product(
                    s + before, rows, (rows < batch) & (t > 0), matrix, columns, neurons, ROWS, COLUMNS, INNER
                )
            potential = tl.where(potential > floor, potential, floor)
            tl.store(v + now + place, potential, mask=inside)
            tl.store(s + now + place, tl.where(potential > 1.0, 1.0, 0.0), mask=inside)
        tl.debug_barrier()  # the next step reads v and s of this one


@triton.jit
def backward_kernel(
    v: tl.tensor,
    grad_s: tl.tensor,
    decay: tl.tensor,
    matrix: tl.tensor,
    grad: tl.tensor,
    steps: tl.tensor,
    batch: tl.tensor,
    neurons: tl.tensor,
    floor: tl.tensor,
    scale: tl.tensor,
    inverse_width: tl.tensor,
    SUBTRACT: tl.constexpr,
    RESET_GRADIENT: tl.constexpr,
    SURROGATE: tl.constexpr,
    ROWS: tl.constexpr,
    COLUMNS: tl.constexpr,
    INNER: tl.constexpr,
) -> None:
    """Compute the gradients of the currents for ROWS sequences, backwards in time.

    ``matrix``: w_rec or None. ``scale``: surrogate scale / width. All other arguments as in ``backward``.
    """
    rows = tl.program_id(0).to(tl.int64) * ROWS + tl.arange(0, ROWS)
    size = tl.cast(batch, tl.int64) * neurons
    for back in range(steps):
        t = steps - 1 - back
        now = t * size
        after = now + size
        for first in range(0, neurons, COLUMNS):
            columns = first + tl.arange(0, COLUMNS)
            inside = (rows < batch)[:, None] & (columns < neurons)[None, :]
            place = rows[:, None] * neurons + columns[None, :]
            potential = tl.load(v + now + place, mask=inside, other=0.0)
            slope = scale * _slope((potential - 1.0) * inverse_width, SURROGATE)
            through = 1.0 if SUBTRACT else tl.where(potential > 1.0, 0.0, 1.0)  # d carry / d v
            if RESET_GRADIENT:
                through -= slope if SUBTRACT else potential * slope
            spikes = tl.load(grad_s + now + place, mask=inside, other=0.0)
            if matrix is not None:
                spikes += _product(
                    grad + after, rows, (rows < batch) & (back > 0), matrix, columns, neurons, ROWS, COLUMNS, INNER
                )
            following = tl.load(grad + after + place, mask=inside & (back > 0), other=0.0)
            kept = tl.load(decay + columns, mask=columns < neurons, other=0.0)
            gradient = spikes * slope + following * kept[None, :] * through
            tl.store(grad + now + place, tl.where(potential > floor, gradient, 0.0), mask=inside)
        tl.debug_barrier()  # the next step reads grad of this one


@triton.jit
def _product(
    left: tl.tensor,
    rows: tl.tensor,
    present: tl.tensor,
    matrix: tl.tensor,
    columns: tl.tensor,
    neurons: tl.tensor,
    ROWS: tl.constexpr,
    COLUMNS: tl.constexpr,
    INNER: tl.constexpr,
) -> tl.tensor:
    """Return rows of left (batch, neurons) times columns of a matrix (neurons, neurons).

    Shape (ROWS, COLUMNS), in full float32 precision.
    """
    total = tl.zeros((ROWS, COLUMNS), tl.float32)
    for first in range(0, neurons, INNER):
        inner = first + tl.arange(0, INNER)
        a = tl.load(
            left + rows[:, None] * neurons + inner[None, :],
            mask=present[:, None] & (inner < neurons)[None, :],
            other=0.0,
        )
        b = tl.load(
            matrix + inner[:, None].to(tl.int64) * neurons + columns[None, :],
            mask=(inner < neurons)[:, None] & (columns < neurons)[None, :],
            other=0.0,
        )
        total = tl.dot(a, b, total, input_precision="ieee")
    return total


@triton.jit
def _slope(d: tl.tensor, SURROGATE: tl.constexpr) -> tl.tensor:
    """Return the surrogate function f(d) elementwise (``NeuronRule``)."""
    if SURROGATE == "gaussian":
        shape = 0.3989422804014327 * tl.exp(-0.5 * d * d)  # 1 / sqrt(2 pi)
    elif SURROGATE == "fast-sigmoid":
        shape = 1.0 / ((1.0 + tl.abs(d)) * (1.0 + tl.abs(d)))
    elif SURROGATE == "triangle":
        shape = tl.maximum(1.0 - tl.abs(d), 0.0)
    else:
        shape = 1.0 / (1.0 + d * d)
    return shape
