"""A layer of integrate-and-fire neurons over a whole sequence, as one autograd function.

The rule of one step (physics of the paper's network, section II-D; variants as parameters)::

    v <- decay * carry + W_in x + W_rec s + b      held above the floor
    s <- 1 if v > 1 else 0
    carry <- 0 where it fired (reset "zero"), or v - s (reset "subtract")

Forward is one product with W_rec per step, backward one with its transpose; the weight gradients are one product
each at the end. On the CPU every product with spikes or sparse inputs on one side is done over the events only,
in a compiled kernel; on a GPU the whole time loop is one Triton kernel. The pure torch path does the same steps with
dense products on any device and in any float type; ``layer_reference`` is the plain loop that all are held to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import Tensor
from torch.nn import functional

from model.errors import InputError
from snn.kernels import cpu as kernel

Backend = Literal["auto", "kernel", "triton", "torch"]
Reset = Literal["zero", "subtract"]

DENSE_FROM = 0.6
"""Fraction of non-zero entries from which a dense product is faster than one over the events."""

MOST_ENTRIES = 2**31 - 2**20
"""Largest number of entries of a sequence in the kernel, which numbers them in 32 bits."""


@dataclass(frozen=True, kw_only=True)
class NeuronRule:
    """The constants of a neuron; the threshold is 1.

    Parameters
    ----------
    floor : float
        v is held above it (paper's network: -1); minus infinity for none.
    reset : "zero" or "subtract"
    reset_gradient : bool
        The gradient also flows through the spike that resets, as in the rule as written; else that spike counts as
        a constant, and with reset by subtraction gradients become large (docs/classifier.md).
    surrogate : str
        Shape f of the derivative of a spike, scale / width * f((v - 1) / width): gaussian (normal density),
        fast-sigmoid 1 / (1 + |d|)**2, triangle max(0, 1 - |d|), arctan 1 / (1 + d**2).
    surrogate_scale, surrogate_width : float
        Paper's network: 0.5 times the normal density with sigma 0.5.
    """

    floor: float = -1.0
    reset: Reset = "zero"
    reset_gradient: bool = True
    surrogate: str = "gaussian"
    surrogate_scale: float = 0.5
    surrogate_width: float = 0.5

    def __post_init__(self) -> None:
        if self.reset not in ("zero", "subtract"):
            raise InputError(f"reset must be zero or subtract, not {self.reset!r}")
        if self.surrogate not in kernel.SURROGATES:
            raise InputError(f"surrogate must be one of {', '.join(kernel.SURROGATES)}, not {self.surrogate!r}")
        if not self.floor < 1:
            raise InputError(f"floor must be below the threshold of 1, not {self.floor!r}")
        for name in ("surrogate_scale", "surrogate_width"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number, not {value!r}")

    def slope(self, v: Tensor) -> Tensor:
        """Return the surrogate derivative ds/dv, in the shape of v."""
        d = (v - 1.0) / self.surrogate_width
        if self.surrogate == "gaussian":
            shape = torch.exp(-0.5 * d * d) / math.sqrt(2 * math.pi)
        elif self.surrogate == "fast-sigmoid":
            shape = (1.0 + d.abs()) ** -2
        elif self.surrogate == "triangle":
            shape = (1.0 - d.abs()).clamp_min(0.0)
        else:
            shape = 1.0 / (1.0 + d * d)
        return shape * (self.surrogate_scale / self.surrogate_width)


def layer(
    rule: NeuronRule,
    x: Tensor,
    w_in: Tensor,
    bias: Tensor,
    decay: Tensor,
    w_rec: Tensor | None = None,
    backend: Backend = "auto",
) -> Tensor:
    """Return the spikes of a layer that starts from rest.

    Parameters
    ----------
    rule : NeuronRule
    x : shape (steps, batch, inputs)
        Counts, spikes or any numbers.
    w_in : shape (neurons, inputs)
    bias, decay : shape (neurons,)
        Decay is the part of v that is left after one step; 1 for a neuron without a leak.
    w_rec : shape (neurons, neurons), optional
        Entry (i, j) is the weight from neuron j to neuron i, one step later.
    backend : "auto", "kernel", "triton" or "torch"
        "auto" takes the kernel for float32 on the CPU where it can be compiled, and Triton for float32 on a GPU where
        it is installed.

    Returns
    -------
    Tensor of 0 and 1, shape (steps, batch, neurons)
    """
    suits = x.device.type == "cpu" and all(p is None or p.dtype == torch.float32 for p in (x, w_in, w_rec))
    suits = suits and x.shape[0] * x.shape[1] * max(w_in.shape) < MOST_ENTRIES
    if backend == "kernel" and not (suits and kernel.available()):
        raise InputError(
            "the kernel needs float32 on the CPU, a C++ compiler and sequences below 2**31 entries; use torch"
        )
    if backend == "kernel" or (backend == "auto" and suits and kernel.available()):
        return _KernelLayer.apply(rule, x, w_in, bias, decay, w_rec)
    if backend == "triton" or (backend == "auto" and x.is_cuda):
        if _triton_takes(x, w_in, bias, decay, w_rec):
            return _TritonLayer.apply(rule, x, w_in, bias, decay, w_rec)
        if backend == "triton":
            raise InputError("the Triton kernel needs float32 on a CUDA GPU and the package triton; use torch")
    return _TorchLayer.apply(rule, x, w_in, bias, decay, w_rec)


# -- kernel ------------------------------------------------------------------------------------------


class _KernelLayer(torch.autograd.Function):
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
        events = kernel.events_of(flat)
        padded_decay = functional.pad(decay.detach(), (0, more)).contiguous()
        columns = functional.pad(w_in.detach().t(), (0, more)).contiguous()
        padded_bias = functional.pad(bias.detach(), (0, more)).contiguous()
        sparse = events.entries < DENSE_FROM * flat.numel()
        v = kernel.product(events, columns, padded_bias) if sparse else torch.addmm(padded_bias, flat, columns)
        v = v.view(steps, batch, width)
        recurrent = None if w_rec is None else functional.pad(w_rec.detach().t(), (0, more, 0, more)).contiguous()
        s, spikes = kernel.forward(rule, padded_decay, recurrent, v)
        spikes = spikes._replace(column=spikes.column[: spikes.entries].clone())
        ctx.rule, ctx.sparse, ctx.inputs = rule, sparse, inputs
        ctx.save_for_backward(w_in, w_rec, padded_decay, v, *spikes[:2], *(events if sparse else (flat,)))
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
            product = kernel.outer(kernel.Events(*kept), ctx.inputs, rows) if sparse else torch.mm(kept[0].t(), rows)
            grad_in = product[:, :neurons].t()
        if w_rec is not None and ctx.needs_input_grad[5]:
            before = (steps - 1) * batch  # rows whose spikes still reach a step
            after = rows[batch:]
            spikes = kernel.Events(first[: before + 1], index, None)
            if spikes.entries < DENSE_FROM * before * neurons:
                product = kernel.outer(spikes, width, after)
            else:
                product = torch.mm((v.view(-1, width)[:before] > 1).to(v).t(), after)
            grad_rec = product[:neurons, :neurons].t()
        return None, grad_x, grad_in, rows.sum(0)[:neurons], grad_decay[:neurons], grad_rec


# -- torch -------------------------------------------------------------------------------------------


class _TorchLayer(torch.autograd.Function):
    """The same steps with dense products, for any device and float type."""

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
        return _dense_gradients(ctx, grad)


def _dense_gradients(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
    """Return the gradients of all arguments of a layer from that of the currents, (steps, batch, neurons)."""
    x, w_in, w_rec, _, v, s = ctx.saved_tensors
    rows = grad.flatten(0, 1)
    grad_x = grad @ w_in if ctx.needs_input_grad[1] else None
    grad_decay = None
    if ctx.needs_input_grad[4]:
        carry = v - s if ctx.rule.reset == "subtract" else v * (1.0 - s)
        grad_decay = (grad[1:] * carry[:-1]).sum((0, 1))
    grad_rec = None if w_rec is None else grad[1:].flatten(0, 1).t() @ s[:-1].flatten(0, 1)
    return None, grad_x, rows.t() @ x.flatten(0, 1), rows.sum(0), grad_decay, grad_rec


# -- triton ------------------------------------------------------------------------------------------


def _triton_takes(*tensors: Tensor | None) -> bool:
    """Return whether Triton is installed and takes these: float32 on a GPU, or on any device in its interpreter."""
    try:
        from snn.kernels import triton as kernel_triton
    except ImportError:
        return False
    return all(p is None or (p.dtype == torch.float32 and (p.is_cuda or kernel_triton.INTERPRETED)) for p in tensors)


class _TritonLayer(torch.autograd.Function):
    """The time loop in one launch forward and one backward; dense products over the whole sequence around it."""

    @staticmethod
    def forward(
        ctx: Any, rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None
    ) -> Tensor:
        from snn.kernels import triton as kernel_triton

        decay = decay.contiguous()
        v, s = kernel_triton.forward(rule, decay, w_rec, functional.linear(x, w_in, bias).contiguous())
        ctx.rule = rule
        ctx.save_for_backward(x, w_in, w_rec, decay, v, s)
        return s

    @staticmethod
    def backward(ctx: Any, grad_s: Tensor) -> tuple[Tensor | None, ...]:
        from snn.kernels import triton as kernel_triton

        _, _, w_rec, decay, v, _ = ctx.saved_tensors
        return _dense_gradients(ctx, kernel_triton.backward(ctx.rule, decay, w_rec, v, grad_s.contiguous()))


# -- reference ---------------------------------------------------------------------------------------


class _Spike(torch.autograd.Function):
    """A step at 1 whose derivative is the surrogate."""

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
    rule: NeuronRule, x: Tensor, w_in: Tensor, bias: Tensor, decay: Tensor, w_rec: Tensor | None = None
) -> Tensor:
    """Return what ``layer`` returns, by a plain loop that autograd differentiates."""
    currents = functional.linear(x, w_in, bias).unbind()  # indexing x[t] instead makes backward quadratic
    carry = torch.zeros_like(currents[0])
    spikes: list[Tensor] = []
    for current in currents:
        v = current + decay * carry
        if w_rec is not None and spikes:
            v = v + functional.linear(spikes[-1], w_rec)
        v = torch.where(v > rule.floor, v, rule.floor)  # no gradient at the floor
        s = _Spike.apply(v, rule)
        resetting = s if rule.reset_gradient else s.detach()
        carry = v - resetting if rule.reset == "subtract" else v * (1.0 - resetting)
        spikes.append(s)
    return torch.stack(spikes)
