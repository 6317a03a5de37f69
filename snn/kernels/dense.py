"""Layer of neurons with dense matrix products, for any device and float type."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from eskin.snn.kernels.rule import NeuronRule


class DenseLayer(torch.autograd.Function):
    """Autograd function of the layer with dense matrix products."""

    @staticmethod
    def forward(
        ctx: Any, rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None
    ) -> Tensor:
        v = functional.linear(x, w_in, bias)
        s = torch.empty_like(v)
        carry = torch.zeros_like(v[0])
        for t in range(len(v)):
            now = v[t].addcmul_(carry, decay)
            if w_rec is not None and t:
                now.addmm_(s[t - 1], w_rec.t())
            now.clamp_(min=rule.floor)
            torch.gt(now, 1.0, out=s[t])
            carry = now - s[t] if rule.reset == "subtract" else now * (1.0 - s[t])
        ctx.rule = rule
        ctx.save_for_backward(x, w_in, w_rec, decay, v, s)
        return s

    @staticmethod
    def backward(ctx: Any, grad_s: Tensor) -> tuple[Tensor | None, ...]:
        _, _, w_rec, decay, v, s = ctx.saved_tensors
        rule = ctx.rule
        subtract = rule.reset == "subtract"
        slope = rule.slope(v)
        through = torch.ones_like(v) if subtract else 1.0 - s  # d carry / d v
        if rule.reset_gradient:
            through = through - (slope if subtract else v * slope)
        open_ = (v > rule.floor).to(v)
        grad = torch.empty_like(v)
        for t in range(len(v) - 1, -1, -1):
            from_spikes = grad_s[t]
            now = grad[t]
            if t + 1 < len(v):
                if w_rec is not None:
                    from_spikes = from_spikes + grad[t + 1] @ w_rec
                torch.mul(grad[t + 1], decay, out=now).mul_(through[t])
            else:
                now.zero_()
            now.addcmul_(from_spikes, slope[t]).mul_(open_[t])
        return dense_gradients(ctx, grad)


def dense_gradients(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
    """Return the gradients of all arguments of a layer for the gradient of the currents, (steps, batch, neurons)."""
    x, w_in, w_rec, _, v, s = ctx.saved_tensors
    rows = grad.flatten(0, 1)
    grad_x = grad @ w_in if ctx.needs_input_grad[1] else None
    grad_decay = None
    if ctx.needs_input_grad[4]:
        carry = v - s if ctx.rule.reset == "subtract" else v * (1.0 - s)
        grad_decay = (grad[1:] * carry[:-1]).sum((0, 1))
    grad_rec = None if w_rec is None else grad[1:].flatten(0, 1).t() @ s[:-1].flatten(0, 1)
    return None, grad_x, rows.t() @ x.flatten(0, 1), rows.sum(0), grad_decay, grad_rec
