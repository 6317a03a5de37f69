"""Adam with decoupled weight decay (Kingma and Ba 2015; Loshchilov and Hutter 2019), without torch's compiler.

Bits and checkpoints equal those of ``torch.optim.AdamW``. That class loads torch's compiler before its first step,
which takes as long as loading torch, or as some 20 epochs; its function ``adamw`` does not.
"""

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.adamw import adamw

OPTIONS: dict[str, Any] = {"beta1": 0.9, "beta2": 0.999, "eps": 1e-8}
OPTIONS |= dict.fromkeys(("foreach", "amsgrad", "maximize"), False)


class Adam:
    """Adam optimiser with its moment estimates.

    ``state``: for the number of every parameter that has had a gradient ``step``, ``exp_avg`` and ``exp_avg_sq``.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], learning_rate: float, weight_decay: float) -> None:
        self.parameters = list(parameters)
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.state: dict[int, dict[str, Tensor]] = {}

    def zero_grad(self) -> None:
        for parameter in self.parameters:
            parameter.grad = None

    @torch.no_grad()
    def step(self) -> None:
        """Update every parameter that has a gradient."""
        for number, parameter in enumerate(self.parameters):
            if parameter.grad is None:
                continue
            if number not in self.state:
                self.state[number] = {"step": torch.tensor(0.0)}
                self.state[number] |= {name: torch.zeros_like(parameter) for name in ("exp_avg", "exp_avg_sq")}
            steps, first, second = ([value] for value in self.state[number].values())
            options = OPTIONS | {"lr": self.learning_rate, "weight_decay": self.weight_decay}
            adamw([parameter], [parameter.grad], first, second, [], steps, **options)

    def load_state(self, state: dict[int, dict[str, Tensor]]) -> None:
        self.state = {
            number: {"step": torch.tensor(float(one["step"]))}
            | {name: one[name].to(self.parameters[number], copy=True) for name in ("exp_avg", "exp_avg_sq")}
            for number, one in state.items()
        }
