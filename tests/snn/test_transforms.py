"""Test the encoders as torch transforms: bit-exact and usable in a DataLoader."""

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.taxel import encode
from eskin.skin.textures.scan import quantise
from eskin.snn.exchange.transforms import LevelCrossing

DOCUMENT = Path(__file__).parents[2] / "docs" / "guide" / "exchange.md"
CONFIGS = {
    "lcs": ReadoutConfig(rows=2, columns=3, resolution=4),
    "lcs, once per sample": ReadoutConfig(rows=2, columns=3, resolution=4, decide_every="sample"),
    "cw-lcs": ReadoutConfig(rows=2, columns=3, encoding="cw-lcs", resolution=4, window_period=3),
    "nlcs": ReadoutConfig(rows=2, columns=3, encoding="nlcs", resolution=4, leak_period=5, leak_shift=3),
}


def signals(*shape: int) -> Tensor:
    """Return signals of shape (200, *shape) that cross several levels and exceed full scale."""
    generator = torch.Generator().manual_seed(3)
    return 0.2 * torch.cumsum(torch.randn((200, *shape), generator=generator) * 0.5, 0)


@pytest.mark.parametrize("name", CONFIGS)
def test_events_are_those_of_the_model(name: str) -> None:
    config, data = CONFIGS[name], signals(2, 3)
    assert data.abs().max() > 1
    codes, clipped = quantise(data.double().numpy(), config.sample_bits)
    assert clipped > 0
    expected = encode(config, codes.reshape(200, 6)).reshape(200, 2, 3)
    found = LevelCrossing(config)(data)
    assert (found.dtype, found.shape) == (torch.float32, data.shape)
    np.testing.assert_array_equal(found.numpy(), expected)
    most = np.abs(expected).max()
    assert most == 1 if config.decide_every == "sample" else most > 1
    np.testing.assert_array_equal(LevelCrossing(config)(data.double().numpy()).numpy(), expected)

    data = signals(5, 2, 3)
    whole = LevelCrossing(config)(data)
    for number in range(5):
        assert torch.equal(whole[:, number], LevelCrossing(config)(data[:, number])), "a batch is encoded in parts"
    assert torch.equal(LevelCrossing(config)(data.flatten(2)), whole.flatten(2))


def test_polarity_in_channels_of_its_own_or_left_out() -> None:
    config, data = CONFIGS["lcs"], signals(2, 3)
    signed = LevelCrossing(config)(data)
    assert (signed < 0).any()
    apart = LevelCrossing(config, polarity=True)(data)
    assert apart.shape == (200, 2, 2, 3)
    assert torch.equal(apart[:, 0] - apart[:, 1], signed)
    assert torch.equal(apart.sum(1), signed.abs())
    assert torch.equal(LevelCrossing(config, off_spike=False)(data), apart[:, 0])


def delta(data: Tensor, threshold: float) -> Tensor:
    """Return the result of ``snntorch.spikegen.delta`` with off_spike."""
    difference = torch.diff(data, dim=0, prepend=torch.zeros_like(data[:1]))
    return (difference >= threshold).to(data) - (difference <= -threshold).to(data)


@pytest.mark.parametrize("resolution", [2, 4, 7])
def test_the_threshold_of_delta_is_half_an_lsb(resolution: int) -> None:
    threshold = 2.0 ** -(resolution + 1)
    transform = LevelCrossing(ReadoutConfig(rows=1, columns=1, resolution=resolution, decide_every="sample"))
    generator = torch.Generator().manual_seed(resolution)
    moves = torch.randint(0, 2, (2**resolution,), generator=generator)
    rising = threshold * torch.cumsum(moves, 0)
    assert 0 < moves.sum() < len(moves)
    assert torch.equal(transform(rising), moves.float())
    assert torch.equal(delta(rising, threshold), moves.float())
    slow = torch.linspace(0, 0.9, 2 ** (resolution + 3))
    assert delta(slow, threshold).sum() == 0
    assert transform(slow).sum() == int(0.9 / threshold)


class Signals(Dataset[tuple[Tensor, int]]):
    """Dataset with a transform, in the style of torch."""

    def __init__(self, data: Tensor, transform: Any) -> None:
        self.data, self.transform = data, transform

    def __len__(self) -> int:
        return self.data.shape[1]

    def __getitem__(self, index: int) -> tuple[Tensor, int]:
        return self.transform(self.data[:, index]), index


@pytest.mark.parametrize("workers", [0, 2])
def test_a_loader_with_workers_gives_the_same(workers: int) -> None:
    transform, data = LevelCrossing(CONFIGS["nlcs"]), signals(6, 2, 3)
    expected = transform(data)
    assert pickle.loads(pickle.dumps(transform)) == transform, "so that workers can also be spawned"
    loader = DataLoader(Signals(data, transform), batch_size=3, num_workers=workers)
    batches = list(loader)
    assert torch.equal(torch.cat([index for _, index in batches]), torch.arange(6))
    assert torch.equal(torch.cat([events for events, _ in batches]).transpose(0, 1), expected)


def test_types_devices_and_gradients() -> None:
    transform, data = LevelCrossing(CONFIGS["lcs"]), signals(6)
    rounded = data.to(torch.bfloat16)
    assert transform(rounded).dtype == torch.bfloat16
    assert torch.equal(transform(rounded).float(), transform(rounded.float()))
    assert not transform(data.requires_grad_()).requires_grad
    assert transform(torch.zeros((0, 6))).shape == (0, 6)
    assert transform(data[:, 0]).shape == (200,)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("lcs", torch.zeros((5, 6), dtype=torch.uint8), r"floating-point numbers in full scales, not torch\.uint8; "),
        ("lcs", torch.full((5, 6), torch.nan), "must be numbers, not NaN"),
        ("lcs", torch.tensor(0.5), r"must have the shape \(time, \.\.\.\), not a single number"),
        ("nlcs", signals(3, 2), r"nlcs takes signals of shape \(time, \.\.\., 2, 3\) or \(time, \.\.\., 6\)"),
    ],
)
def test_other_data_are_refused(name: str, data: Tensor, message: str) -> None:
    with pytest.raises(InputError, match=message):
        LevelCrossing(CONFIGS[name])(data)


def test_other_options_are_refused() -> None:
    with pytest.raises(InputError, match="encoding nlcs has no OFF events; leave polarity out"):
        LevelCrossing(CONFIGS["nlcs"], polarity=True)
    with pytest.raises(InputError, match="polarity needs OFF events"):
        LevelCrossing(CONFIGS["lcs"], polarity=True, off_spike=False)


def test_infinite_values_saturate_as_samples_do() -> None:
    transform = LevelCrossing(CONFIGS["lcs"])
    data = torch.tensor([[2.0], [-torch.inf]])
    assert torch.equal(transform(data), transform(torch.tensor([[1.0], [-1.0]])))


def test_the_program_of_the_document_runs() -> None:
    (program,) = re.findall(r"```python\n(from torch.*?)```", DOCUMENT.read_text(), re.DOTALL)
    values: dict[str, Any] = {}
    exec(program, values)
    assert values["events"].shape == (16, 100, 2, 8, 8)
    assert values["counts"].shape == (100, 16, 128)
    assert values["events"].sum() > 1000
    assert torch.isfinite(values["logits"]).all()
