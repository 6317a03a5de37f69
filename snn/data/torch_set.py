"""Scans as a dataset of torch."""

from __future__ import annotations

import dataclasses

import torch
from torch import Tensor
from torch.utils.data import Dataset

from eskin.snn.data.scans import ScanData


class ScanSet(ScanData, Dataset[tuple[Tensor, int]]):
    """Scans for ``torch.utils.data.DataLoader``: an item is counts, shape (steps, channels), and the label."""

    @classmethod
    def of(cls, data: ScanData) -> ScanSet:
        """Return the same scans."""
        return cls(**{field.name: getattr(data, field.name) for field in dataclasses.fields(data)})

    def __getitem__(self, number: int) -> tuple[Tensor, int]:
        return torch.from_numpy(self.values[number].astype("float32")), int(self.labels[number])
