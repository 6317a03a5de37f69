"""Test that the optimiser gives the same bits as torch's."""

import pytest
import torch
from torch import nn

from eskin.snn.adam import Adam


@pytest.mark.parametrize("weight_decay", [0.0, 0.01])
def test_it_gives_the_bits_of_torch_and_goes_on_from_its_checkpoints(weight_decay: float) -> None:
    generator = torch.Generator().manual_seed(0)
    shapes = [(37, 20), (5,), (3, 37)]
    ours, theirs = (
        [nn.Parameter(torch.randn(shape, generator=torch.Generator().manual_seed(1))) for shape in shapes]
        for _ in range(2)
    )
    adam, expected = Adam(ours, 1e-3, weight_decay), torch.optim.AdamW(theirs, lr=1e-3, weight_decay=weight_decay)
    for number in range(30):
        if number == 10:  # a checkpoint of torch's optimizer is one of ours
            adam = Adam(ours, 1e-3, weight_decay)
            adam.load_state(expected.state_dict()["state"])
        adam.learning_rate = expected.param_groups[0]["lr"] = 1e-3 / (number + 1)
        for index, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            gradient = torch.randn(shapes[index], generator=generator) * 10.0 ** (number - 15)
            a.grad, b.grad = (None, None) if index == 1 and number < 3 else (gradient.clone(), gradient.clone())
        adam.step()
        expected.step()
        assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))
    adam.zero_grad()
    assert all(parameter.grad is None for parameter in ours)
