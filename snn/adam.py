"""Adam with decoupled weight decay (Kingma and Ba 2015; Loshchilov and Hutter 2019).

Steps, bits and checkpoints equal those of ``torch.optim.AdamW``. That class loads torch's compiler before its first
step, which takes as long as loading torch, or as some 20 epochs.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8


class Adam:
    """Adam optimiser with its moment estimates.

    Attributes
    ----------
    parameters : list of Parameter
    learning_rate, weight_decay : float
    state : dict
        For the number of every parameter that has had a gradient: ``step``, ``exp_avg`` and ``exp_avg_sq``.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], learning_rate: float, weight_decay: float) -> None:
        self.parameters = list(parameters)
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.state: dict[int, dict[str, Tensor]] = {}

    def zero_grad(self) -> None:
        """Clear the gradients of all parameters."""
        for parameter in self.parameters:
            parameter.grad = None

    @torch.no_grad()
    def step(self) -> None:
        """Update every parameter that has a gradient."""
        for number, parameter in enumerate(self.parameters):
            if (grad := parameter.grad) is None:
                continue
            if number not in self.state:
                first, second = torch.zeros_like(parameter), torch.zeros_like(parameter)
                self.state[number] = {"step": torch.tensor(0.0), "exp_avg": first, "exp_avg_sq": second}
            state = self.state[number]
            state["step"] += 1
            steps = state["step"].item()
            parameter.mul_(1 - self.learning_rate * self.weight_decay)
            mean = state["exp_avg"].lerp_(grad, 1 - BETA_1)
            square = state["exp_avg_sq"].mul_(BETA_2).addcmul_(grad, grad, value=1 - BETA_2)
            spread = square.sqrt().div_((1 - BETA_2**steps) ** 0.5).add_(EPSILON)
            parameter.addcdiv_(mean, spread, value=-(self.learning_rate / (1 - BETA_1**steps)))

    def load_state(self, state: dict[int, dict[str, Tensor]]) -> None:
        """Load the state from a checkpoint."""
        self.state = {
            number: {"step": torch.tensor(float(one["step"]))}
            | {name: one[name].to(self.parameters[number], copy=True) for name in ("exp_avg", "exp_avg_sq")}
            for number, one in state.items()
        }
