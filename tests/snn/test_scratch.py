"""Test a NumPy forward pass, written only from the documentation, against the project.

Nothing of the project is imported by what stands between the two lines.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import Encoding, ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.presets import preset
from eskin.snn.data.bins import BinConfig, bin_recording
from eskin.snn.data.scans import load_recordings
from eskin.snn.exchange.weights import Weights, save_weights
from eskin.snn.network import build
from eskin.snn.network_config import NetworkConfig
from eskin.snn.train import logits_of

# ----------------------------------------------------------------------------------------------------


def load(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    return arrays, json.loads(str(arrays.pop("metadata")))


def count(path: Path, step_s: float, inputs: int) -> NDArray[np.int64]:
    """Return the events per bin and channel of an event file."""
    arrays, header = load(path)
    start = 0
    if header["metadata"].get("preset") == "paper":
        rate = header["config"]["sample_rate_hz"]
        skip = 20_000 if header["config"]["encoding"] == "nlcs" else 2_000
        start = round((np.ceil((skip + 1) / (200_000 / rate)) - 1) * header["clock_hz"] / rate)
    rows, columns = header["config"]["rows"], header["config"]["columns"]
    width = step_s * header["clock_hz"]
    steps = int(np.floor((header["duration_clocks"] - start) / width + 1e-9))
    counts = np.zeros((steps, inputs), np.int64)
    for t, x, y, p in arrays["events"].tolist():
        k = int(np.floor((t - start) / width))
        if t >= start and k < steps:
            counts[k, y * columns + x + (0 if p or inputs == rows * columns else rows * columns)] += 1
    return counts


def classify(counts: NDArray[np.int64], path: Path) -> NDArray[np.float64]:
    """Return the logits of a weight file for event counts."""
    w, header = load(path)
    network = header["network"]
    floor = float(network["floor"])

    def fire(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        v = np.maximum(v, floor)
        s = (v > 1).astype(float)
        return s, v - s if network["reset"] == "subtract" else np.where(s == 1, 0.0, v)

    v, s, u = np.zeros(len(w["w_in"])), np.zeros(len(w["w_in"])), np.zeros(len(w["w_out"]))
    total, i, j = np.zeros(len(u)), np.zeros(len(v)), np.zeros(len(u))
    for row in counts:
        x = network["input_scale"] * row
        i = network["synapse_decay"] * i + w["w_in"] @ x + w["b_hidden"] + w["w_rec"] @ s
        s, v = fire(w["decay"] * v + i)
        j = network["output_synapse_decay"] * j + w["w_out"] @ s + w["b_out"]
        u = w["output_decay"] * u + j
        if network["readout"] == "spikes":
            z, u = fire(u)
            total += z
        else:
            total += u / len(counts)
    return network["output_scale"] * total


# ----------------------------------------------------------------------------------------------------

CONFIG = ReadoutConfig(rows=2, columns=3, resolution=4)
STEP_S = 0.0007
NETWORKS: dict[str, dict[str, Any]] = {
    "paper": {"output_scale": 0.1},
    "tuned": {"input_scale": 0.4, "decay": 0.8, "output_decay": 0.95, "readout": "membrane"},
    "portable": {"decay": 0.5, "output_decay": 0.75, "floor": float("-inf")},
    "learned": {"decay": 0.9, "output_decay": 0.8, "learn_decay": True},
    "synaptic": {"decay": 0.8, "output_decay": 0.9, "synapse_decay": 0.6, "output_synapse_decay": 0.4},
    "synaptic membranes": {"decay": 0.8, "output_decay": 0.9, "output_synapse_decay": 0.4, "readout": "membrane"},
    "subtract": {"reset": "subtract", "decay": 0.95, "floor": -0.5},
}


EXACT = ("paper", "portable")
"""Networks whose sums have no rounding."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return event files of two classes with events on bin edges, at clock 0 and after the last bin."""
    folder, generator = tmp_path_factory.mktemp("events"), np.random.default_rng(0)
    width = STEP_S * CONFIG.clock_hz
    edges = np.ceil(np.arange(0, 40) * width).astype(np.int64)
    for number in range(12):
        duration = int(40.4 * width) + number
        t = np.sort(np.concatenate((edges, edges[1:] - 1, generator.integers(0, duration, 300 + 40 * number))))
        events = np.empty(len(t), EVENT_DTYPE)
        events["t"], events["p"] = t, generator.random(len(t)) < (0.3 if number % 2 else 0.7)
        events["x"], events["y"] = generator.integers(0, 3, len(t)), generator.integers(0, 2, len(t))
        metadata = {"name": f"scan-{number:02}", "class": "ab"[number % 2]}
        Recording(events, CONFIG, duration, metadata=metadata).save(folder / f"{number:02}.npz")
    return folder


@pytest.mark.parametrize("name", NETWORKS)
def test_the_page_suffices_for_the_forward_pass(folder: Path, tmp_path: Path, name: str) -> None:
    network = build(NetworkConfig.from_dict({"inputs": 12, "classes": 2, "hidden": 24} | NETWORKS[name]), seed=4)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for key, tensor in network.named_parameters():
            if key.startswith(("b_", "raw_")):
                tensor.add_(torch.randn(tensor.shape, generator=generator), alpha=0.1)
            if name in EXACT:  # in eighths: potentials meet the threshold of 1 exactly, and do not fire
                tensor.mul_(8).round_().div_(8)
    data = load_recordings(folder, BinConfig(bin_s=STEP_S))
    save_weights(tmp_path / "weights.npz", Weights(network, data.class_names, STEP_S))
    expected = logits_of(network, data)
    found = [classify(count(file, STEP_S, 12), tmp_path / "weights.npz") for file in sorted(folder.iterdir())]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)
    assert np.argmax(found, 1).tolist() == expected.argmax(1).tolist()
    assert len(np.unique(np.round(expected, 4), axis=0)) > 6


@pytest.mark.parametrize("polarity", [True, False])
def test_the_page_suffices_for_the_counts(folder: Path, polarity: bool) -> None:
    bins = BinConfig(bin_s=STEP_S, polarity=polarity)
    for file in sorted(folder.iterdir()):
        recording = Recording.load(file)
        np.testing.assert_array_equal(count(file, STEP_S, 12 if polarity else 6), bin_recording(recording, bins))


@pytest.mark.parametrize(("encoding", "resolution"), [("lcs", 4), ("lcs", 6), ("nlcs", 6)])
def test_the_page_says_where_the_first_bin_of_a_paper_scan_begins(
    tmp_path: Path, encoding: Encoding, resolution: int
) -> None:
    config = preset("paper").configure(ReadoutConfig(rows=2, columns=3, encoding=encoding, resolution=resolution), 0.2)
    start = preset("paper").skipped_ticks(config) * config.clocks_per_sample
    events = np.zeros(4, EVENT_DTYPE)
    events["t"], events["p"] = [start - 1, start, start + 1, 2 * start], True
    recording = Recording(events, config, 3 * start, metadata={"preset": "paper"})
    recording.save(tmp_path / "e.npz")
    bins = BinConfig(bin_s=2 / config.clock_hz)
    found = count(tmp_path / "e.npz", bins.bin_s, bins.channels(config))
    np.testing.assert_array_equal(found, bin_recording(recording, bins))
    assert found[0].sum() == 2
