"""Small datasets and networks for tests of the classifier."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.skin.textures.dataset import embedded_dataset
from eskin.snn.data.scans import ScanData
from eskin.snn.exchange.weights import Weights
from eskin.snn.network import build
from eskin.snn.network_config import NetworkConfig

CLASSES = ("brick", "grass", "gravel")


def easy_data(images: int = 30, steps: int = 15, channels: int = 8) -> ScanData:
    """Return scans in which every class has its own active channels."""
    generator = np.random.default_rng(0)
    labels = np.arange(images) % 3
    rates = np.full((images, channels), 0.2)
    for label in range(3):
        rates[labels == label, label::3] = 1.5
    values = generator.poisson(rates[:, None, :], (images, steps, channels)).astype(np.int16)
    names = tuple(f"scan-{number}" for number in range(images))
    return ScanData(values, labels, np.arange(images), names, CLASSES, channels // 2, 0.004, 1000.0)


def two_textures(folder: Path) -> None:
    """Write four images each of a rough and a smooth class."""
    generator = np.random.default_rng(0)
    for name in ("rough", "smooth"):
        (folder / name).mkdir(parents=True)
        for number in range(4):
            pixels = generator.integers(0, 256 if name == "rough" else 64, (40, 160), np.uint8)
            Image.fromarray(pixels).save(folder / name / f"{number}.png")


def few_textures(monkeypatch: pytest.MonkeyPatch, number: int = 6) -> None:
    """Let experiments use some of the embedded textures, evenly spread."""
    for module in ("eskin.snn.experiments.experiment", "studies.noise_power"):
        monkeypatch.setattr(f"{module}.open_dataset", lambda _: embedded_dataset().limit(number))


def some_weights(classes: Sequence[str] = "abc", step_s: float = 0.002, seed: int = 0, **fields: Any) -> Weights:
    """Return an untrained network of 6 inputs and 5 hidden neurons, unless ``fields`` give others."""
    config = NetworkConfig.from_dict({"inputs": 6, "classes": len(classes), "hidden": 5} | fields)
    return Weights(build(config, seed), tuple(classes), step_s)


def small_network(**fields: Any) -> NetworkConfig:
    defaults: dict[str, Any] = {"inputs": 8, "classes": 3, "hidden": 16, "readout": "membrane", "decay": 0.8}
    return NetworkConfig.from_dict(defaults | fields)
