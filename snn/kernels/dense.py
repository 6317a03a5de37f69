"""Time loop of a layer with dense matrix products, for any device and float type."""

import torch
from torch import Tensor

from eskin.snn.kernels.rule import NeuronRule


def forward(rule: NeuronRule, decay: Tensor, w_rec: Tensor | None, currents: Tensor) -> tuple[Tensor, Tensor]:
    """Compute potentials from currents in place, and return potentials and spikes, shape (steps, batch, neurons)."""
    v, s = currents, torch.empty_like(currents)
    carry = torch.zeros_like(v[0])
    for t in range(len(v)):
        now = v[t].addcmul_(carry, decay)
        if w_rec is not None and t:
            now.addmm_(s[t - 1], w_rec.t())
        now.clamp_(min=rule.floor)
        torch.gt(now, 1.0, out=s[t])
        carry = now - s[t] if rule.reset == "subtract" else now * (1.0 - s[t])
    return v, s


def backward(rule: NeuronRule, decay: Tensor, w_rec: Tensor | None, v: Tensor, grad_s: Tensor) -> Tensor:
    """Return the gradient of the currents for the gradient of the spikes, shape (steps, batch, neurons)."""
    subtract = rule.reset == "subtract"
    slope = rule.slope(v)
    through = torch.ones_like(v) if subtract else 1.0 - (v > 1.0).to(v)  # d carry / d v
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
    return grad
