"""The layer on the CPU: products over the events only, in the compiled kernel."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from snn.kernels import cpu as kernel
from snn.kernels.rule import NeuronRule

DENSE_FROM = 0.6
"""Fraction of non-zero entries from which a dense product is faster than one over the events."""


class SparseLayer(torch.autograd.Function):
    """All matrices are padded to whole vectors; products are over events where few entries are not zero."""

    @staticmethod
    def forward(
        ctx: Any, rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None
    ) -> Tensor:
        steps, batch, inputs = x.shape
        neurons = len(w_in)
        width = kernel.pad(neurons)
        more = width - neurons
        flat = x.detach().reshape(-1, inputs).contiguous()
        entries = kernel.entries_of(flat)
        padded_decay = functional.pad(decay.detach(), (0, more)).contiguous()
        columns = functional.pad(w_in.detach().t(), (0, more)).contiguous()
        padded_bias = functional.pad(bias.detach(), (0, more)).contiguous()
        sparse = entries.filled < DENSE_FROM * flat.numel()
        v = kernel.product(entries, columns, padded_bias) if sparse else torch.addmm(padded_bias, flat, columns)
        v = v.view(steps, batch, width)
        recurrent = None if w_rec is None else functional.pad(w_rec.detach().t(), (0, more, 0, more)).contiguous()
        s, spikes = kernel.forward(rule, padded_decay, recurrent, v)
        spikes = spikes._replace(column=spikes.column[: spikes.filled].clone())
        ctx.rule, ctx.sparse, ctx.inputs = rule, sparse, inputs
        ctx.save_for_backward(w_in, w_rec, padded_decay, v, *spikes[:2], *(entries if sparse else (flat,)))
        return s[:, :, :neurons] if more else s

    @staticmethod
    def backward(ctx: Any, grad_s: Tensor) -> tuple[Tensor | None, ...]:
        w_in, w_rec, decay, v, first, index, *kept = ctx.saved_tensors
        steps, batch, width = v.shape
        neurons = len(w_in)
        more = width - neurons
        grad_s = functional.pad(grad_s, (0, more)) if more else grad_s
        matrix = None if w_rec is None else functional.pad(w_rec.detach(), (0, more)).contiguous()
        grad, grad_decay = kernel.backward(ctx.rule, decay, matrix, v, grad_s.contiguous())
        rows = grad.view(steps * batch, width)
        grad_x = grad_in = grad_rec = None
        if ctx.needs_input_grad[1]:
            grad_x = torch.mm(rows[:, :neurons], w_in.detach()).view(steps, batch, -1)
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
