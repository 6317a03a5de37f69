"""Layer of integrate-and-fire neurons over a whole sequence, as one autograd function.

The rule of one step (physics of the paper's network, section II-D; variants as parameters)::

    i <- synapse_decay * i + W_in x + W_rec s + b
    v <- decay * carry + i                         held above the floor
    s <- 1 if v > 1 else 0
    carry <- 0 where it fired (reset "zero"), or v - s (reset "subtract")

Forward is one product with W_rec per step, and backward one with its transpose; the weight gradients are one product
each at the end. On the CPU a compiled kernel computes products with spikes or sparse inputs over the events only. The
torch path computes the same steps with dense products, on any device and in any float type. ``layer_reference`` is the
plain loop, the reference for all, and alone has synaptic currents (``synapse_decay`` above 0).
"""

from typing import Any, Literal

import torch
from torch import Tensor
from torch.nn import functional

from eskin.base.errors import InputError
from eskin.snn.kernels import cpu as kernel
from eskin.snn.kernels import dense
from eskin.snn.kernels.reference import layer_reference
from eskin.snn.kernels.rule import NeuronRule

Backend = Literal["auto", "kernel", "torch"]


MAX_ENTRIES = 2**31 - 2**20
"""Largest number of entries of a sequence in the kernel, which numbers them in 32 bits."""

DENSE_FROM = 0.6
"""Fraction of non-zero entries from which a dense product is faster than a sparse product."""


def layer(
    rule: NeuronRule,
    x: Tensor,
    w_in: Tensor,
    bias: Tensor,
    decay: Tensor,
    w_rec: Tensor | None = None,
    backend: Backend = "auto",
    synapse_decay: float = 0.0,
) -> Tensor:
    """Return the spikes of a layer that starts at rest: 0 and 1, shape (steps, batch, neurons).

    - ``x``: shape (steps, batch, inputs); counts, spikes or any numbers.
    - ``w_in``: shape (neurons, inputs).
    - ``bias``, ``decay``: shape (neurons,). Decay is the part of v that is left after one step; 1 without a leak.
    - ``w_rec``: shape (neurons, neurons). Entry (i, j) is the weight from neuron j to neuron i, one step later.
    - ``backend``: "auto" selects the kernel for float32 on the CPU if it can be compiled.
    - ``synapse_decay``: part of the synaptic current that is left after one step; 0 for neurons without one. With it
      the plain loop computes, whatever the backend.

    Examples
    --------
    One neuron without a leak takes 0.4 in every step. It fires where its potential passes 1, and starts from 0 again:

    >>> x, w_in, bias, decay = torch.ones(7, 1, 1), torch.full((1, 1), 0.4), torch.zeros(1), torch.ones(1)
    >>> layer(NeuronRule(), x, w_in, bias, decay).flatten().tolist()
    [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]
    """
    if synapse_decay:
        return layer_reference(rule, x, w_in, bias, decay, w_rec, synapse_decay)
    suits = x.device.type == "cpu" and all(p is None or p.dtype == torch.float32 for p in (x, w_in, w_rec))
    suits = suits and x.shape[0] * x.shape[1] * max(w_in.shape) < MAX_ENTRIES
    if backend == "kernel" and not (suits and kernel.available()):
        raise InputError(
            "the kernel needs float32 on the CPU, a C++ compiler and sequences below 2**31 entries; use torch"
        )
    if backend == "kernel" or (backend == "auto" and suits and kernel.available()):
        return SparseLayer.apply(rule, x, w_in, bias, decay, w_rec)
    return _DenseLayer.apply(rule, x, w_in, bias, decay, w_rec)


class SparseLayer(torch.autograd.Function):
    """Autograd function of the compiled kernel, with sparse products, or dense products for many non-zero entries."""

    @staticmethod
    def forward(
        ctx: Any, rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None
    ) -> Tensor:
        steps, batch, inputs = x.shape
        neurons = len(w_in)
        flat = x.detach().reshape(-1, inputs).contiguous()
        entries = kernel.entries_of(flat)
        columns, padded_bias, padded_decay = (kernel.padded(p) for p in (w_in.t(), bias, decay))
        sparse = entries.filled < DENSE_FROM * flat.numel()
        v = kernel.product(entries, columns, padded_bias) if sparse else torch.addmm(padded_bias, flat, columns)
        v = v.view(steps, batch, -1)
        recurrent = None if w_rec is None else kernel.padded(w_rec.t(), v.shape[2])
        s, spikes = kernel.forward(rule, padded_decay, recurrent, v)
        spikes = spikes._replace(column=spikes.column[: spikes.filled].clone())
        ctx.rule, ctx.sparse, ctx.inputs = rule, sparse, inputs
        ctx.save_for_backward(w_in, w_rec, padded_decay, v, *spikes[:2], *(entries if sparse else (flat,)))
        return s[:, :, :neurons]

    @staticmethod
    def backward(ctx: Any, grad_s: Tensor) -> tuple[Tensor | None, ...]:
        w_in, w_rec, decay, v, first, index, *kept = ctx.saved_tensors
        steps, batch, width = v.shape
        neurons = len(w_in)
        matrix = None if w_rec is None else kernel.padded(w_rec)
        grad, grad_decay = kernel.backward(ctx.rule, decay, matrix, v, kernel.padded(grad_s))
        rows = grad.view(steps * batch, width)
        grad_x = grad_in = grad_rec = None
        if ctx.needs_input_grad[1]:
            product = kernel.dense_product(rows, neurons, kernel.padded(w_in))
            grad_x = product[:, : ctx.inputs].view(steps, batch, -1)
        if ctx.needs_input_grad[2]:
            sparse = ctx.sparse
            product = kernel.outer(kernel.Entries(*kept), ctx.inputs, rows) if sparse else torch.mm(kept[0].t(), rows)
            grad_in = product[:, :neurons].t()
        if w_rec is not None and ctx.needs_input_grad[5]:
            before = (steps - 1) * batch  # rows whose spikes still reach a step
            after = rows[batch:]
            spikes = kernel.Entries(first[: before + 1], index, None)
            if spikes.filled < DENSE_FROM * before * neurons:
                product = kernel.outer(spikes, width, after)
            else:
                product = torch.mm((v.view(-1, width)[:before] > 1).to(v).t(), after)
            grad_rec = product[:neurons, :neurons].t()
        return None, grad_x, grad_in, rows.sum(0)[:neurons], grad_decay[:neurons], grad_rec


class _DenseLayer(torch.autograd.Function):
    """Autograd function of the torch path, with dense products."""

    @staticmethod
    def forward(
        ctx: Any, rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None
    ) -> Tensor:
        v, s = dense.forward(rule, decay, w_rec, functional.linear(x, w_in, bias))
        ctx.rule = rule
        ctx.save_for_backward(x, w_in, w_rec, decay, v, s)
        return s

    @staticmethod
    def backward(ctx: Any, grad_s: Tensor) -> tuple[Tensor | None, ...]:
        x, w_in, w_rec, decay, v, s = ctx.saved_tensors
        grad = dense.backward(ctx.rule, decay, w_rec, v, grad_s)
        rows = grad.flatten(0, 1)
        grad_x = grad @ w_in if ctx.needs_input_grad[1] else None
        grad_decay = None
        if ctx.needs_input_grad[4]:
            carry = v - s if ctx.rule.reset == "subtract" else v * (1.0 - s)
            grad_decay = (grad[1:] * carry[:-1]).sum((0, 1))
        grad_rec = None if w_rec is None else grad[1:].flatten(0, 1).t() @ s[:-1].flatten(0, 1)
        return None, grad_x, rows.t() @ x.flatten(0, 1), rows.sum(0), grad_decay, grad_rec
