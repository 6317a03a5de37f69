"""Draw the picture of ``sim``: the RTL's events of one scan above the model's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from eskin.base.files import atomic_write
from eskin.cocotb_tests.bench.stimuli import settled
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import simulate

PICTURE = "raster.png"


def draw(config: ReadoutConfig, name: str, samples: NDArray[Any], folder: Path, texture: Any = None) -> None:
    """Draw the events of RTL and model above each other, and write both event files.

    ``samples``, shape (ticks, taxels), are the codes that were played, and ``texture`` is the image that was scanned.
    """
    from eskin.skin.figures.raster import plot_comparison

    recorded = folder / "events" / f"{name}.npz"
    rtl = Recording.load(recorded)
    model = simulate(config, settled(config, samples))
    metadata = rtl.metadata | {"source": "model"}
    Recording(model, config, rtl.duration_clocks, metadata=metadata).save(folder / "model.npz")
    with atomic_write(folder / "rtl.npz") as file:
        file.write(recorded.read_bytes())
    plot_comparison(
        (rtl.events, model),
        config,
        folder / PICTURE,
        labels=("RTL", "model"),
        title=f"{name}, {config.encoder.title} {config.resolution} b, {config.rows} x {config.columns} taxels",
        signal=samples / config.full_scale,
        texture=texture,
        duration_clocks=rtl.duration_clocks,
    )
