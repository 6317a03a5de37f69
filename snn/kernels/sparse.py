"""Layer of neurons on the CPU, with the compiled kernel and sparse products."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from eskin.snn.kernels import cpu as kernel
from eskin.snn.kernels.rule import NeuronRule

DENSE_FROM = 0.6
"""Fraction of non-zero entries from which a dense product is faster than a sparse product."""


class SparseLayer(torch.autograd.Function):
    """Autograd function of the layer with sparse products, or dense products for many non-zero entries."""

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
