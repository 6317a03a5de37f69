"""One small valid file of every kind that a command reads."""

from pathlib import Path

import numpy as np
from PIL import Image

from eskin.base.files import write_json
from eskin.model.config import ReadoutConfig
from eskin.power.rates import stored_table
from eskin.rtl.delivery import description
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.presets import preset
from eskin.snn.data.record import record
from eskin.snn.exchange.nir_events import save_nir_data
from tests.fuzz.run import run_command

CONFIG = ReadoutConfig(rows=1, columns=4)
TRAIN = ("--config", "good/config.json", "--bin", "0.02", "--set", "hidden=16", "--set", "batch=4", "--folds", "2")

LIBERTY = Path(__file__).with_suffix(".lib").read_text()


def make(root: Path) -> None:
    """Write the corpus into the folder ``good`` of ``root``."""
    good = root / "good"
    events = good / "events"
    for texture in embedded_dataset().limit(6):
        made = record(texture, "embedded", preset("physical"), CONFIG)
        (events / texture.name).parent.mkdir(parents=True, exist_ok=True)
        made.save(events / f"{texture.name}.npz")
    made.save(good / "events.npz")
    save_nir_data(good / "events.nir", made)
    (good / "config.json").write_text(CONFIG.to_json())
    (good / "delivered.json").write_text(description(CONFIG))
    samples = np.round(1000 * np.sin(np.arange(200)[:, None] / 9 + np.arange(4))).astype(np.int32)
    np.save(good / "samples.npy", samples)
    np.savez(good / "samples.npz", samples=samples, sample_rate_hz=1000.0)
    np.savetxt(good / "samples.csv", samples, "%d", delimiter=",")
    for label in ("brick", "grass"):
        for number in range(2):
            (good / "images" / label).mkdir(parents=True, exist_ok=True)
            picture = np.random.default_rng(number).integers(0, 256, (96, 96), np.uint8)
            Image.fromarray(picture).save(good / "images" / label / f"{number}.png")
    Image.fromarray(picture).save(good / "image.png")
    write_json(good / "rates.json", {"tables": [stored_table().to_dict()]})
    gates = {"readout": "lcs", "rows": 8, "columns": 8, "clock_hz": 1e6, "area_um2": 1e5, "leakage_w": 1e-6}
    write_json(good / "synthesis.json", gates | {"clock_power_w_per_hz": 1e-11, "energy_per_event_j": 1e-12})
    (good / "cells.lib").write_text(LIBERTY)
    for line in (
        ("train", "--dataset", "embedded", *TRAIN, "--epochs", "1", "-o", "good/train"),
        ("sweep", "--dataset", "embedded", "--points", "lcs:3", *TRAIN, "--epochs", "1", "--seeds", "1",
         "--workers", "1", "-o", "good/sweep"),
        ("export", "good/train/weights.npz", "-o", "good/network.nir"),
    ):  # fmt: skip
        seen = run_command(line)
        assert seen.code == 0, seen.err
