"""Test that a checkpoint with a right seal and other content is refused in a sentence."""

import hashlib
import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import torch

from eskin.base.errors import InputError
from eskin.snn.checkpoint import load_checkpoint


def sealed(content: Any) -> bytes:
    """Return a checkpoint with this content."""
    torch.save(content, buffer := io.BytesIO())
    return hashlib.sha256(buffer.getvalue()).digest() + buffer.getvalue()


KEY = '{"seed": 0}'


@pytest.mark.parametrize(
    "content",
    [
        sealed({}),
        sealed([1, 2]),
        sealed({"key": 3}),
        sealed({"key": "x"}),
        sealed({"key": KEY}),
        sealed({"key": KEY, "network": {}, "optimizer": None, "history": 4, "best": None}),
        hashlib.sha256(b"no archive").digest() + b"no archive",
        hashlib.sha256(b"").digest(),
    ],
    ids=lambda _: "sealed",
)
def test_other_content_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(content)
    training = SimpleNamespace(network=torch.nn.Linear(1, 1), optimizer=None)
    with pytest.raises(InputError, match=f"^checkpoint {path} does not hold a training; remove it to start again$"):
        load_checkpoint(path, cast(Any, training), KEY)
