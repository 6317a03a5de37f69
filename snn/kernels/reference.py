"""Layer of neurons as a plain loop with autograd, the reference for all kernels."""

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from eskin.snn.kernels.rule import NeuronRule


class _Spike(torch.autograd.Function):
    """Step function at 1 with a surrogate derivative."""

    @staticmethod
    def forward(ctx: Any, v: Tensor, rule: NeuronRule) -> Tensor:
        ctx.rule = rule
        ctx.save_for_backward(v)
        return (v > 1.0).to(v)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        (v,) = ctx.saved_tensors
        return grad * ctx.rule.slope(v), None


def layer_reference(
    rule: NeuronRule,
    x: Tensor,
    w_in: Tensor,
    bias: Tensor,
    decay: Tensor,
    w_rec: Tensor | None = None,
    synapse_decay: float = 0.0,
) -> Tensor:
    """Return the spikes of a layer, computed by a plain loop with autograd.

    ``synapse_decay`` is the part of a synaptic current that is left after one step.
    """
    currents = functional.linear(x, w_in, bias).unbind()  # indexing x[t] instead makes backward quadratic
    carry = synaptic = torch.zeros_like(currents[0])
    spikes: list[Tensor] = []
    for current in currents:
        if synapse_decay:
            synaptic = current = current + synapse_decay * synaptic
        v = current + decay * carry
        if w_rec is not None and spikes:
            recurrent = functional.linear(spikes[-1], w_rec)
            v, synaptic = v + recurrent, synaptic + recurrent
        v = torch.where(v > rule.floor, v, rule.floor)  # no gradient at the floor
        s = _Spike.apply(v, rule)
        resetting = s if rule.reset_gradient else s.detach()
        carry = v - resetting if rule.reset == "subtract" else v * (1.0 - resetting)
        spikes.append(s)
    return torch.stack(spikes)
