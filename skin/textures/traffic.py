"""Compare the data rates of spiking and frame readouts on equal scans (docs/reference/frame.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.presets import Scan
from eskin.skin.textures.rates import Rates, measure_rates

if TYPE_CHECKING:
    from collections.abc import Callable

    from eskin.base.workers.pool import WorkerPool


def compare_traffic(
    textures: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    frame: FrameConfig,
    tau_s: float | None = None,
    pool: WorkerPool | None = None,
    progress: Callable[[], object] | None = None,
) -> dict[str, Any]:
    """Return the data rates of every spiking readout and of the frame readout for scanned textures.

    - ``config``: array and resolution; every encoding is taken.
    - ``tau_s``: time constant of encoders with a leak; by default that of ``config``.
    - ``progress``: called after each texture of each readout.
    """
    configs = {
        encoding: scan.configure(config.replace(encoding=encoding), tau_s if registry.named(encoding).leaks else None)
        for encoding in registry.NAMES
    }
    return {
        "dataset": textures.name,
        "images": len(textures),
        "preset": scan.name,
        "rows": config.rows,
        "columns": config.columns,
        "resolution": config.resolution,
        "tau_s": next(one.tau_s for one in configs.values() if one.encoder.leaks),
        **{
            encoding: _of_events(one, measure_rates(textures, scan, one, pool=pool, progress=progress), frame)
            for encoding, one in configs.items()
        },
        "frame": {  # does not depend on the signal
            "words_per_s": frame.word_rate_hz,
            "bits_per_word": frame.word_bits,
            "bits_per_s": frame.bit_rate_hz,  # of the samples
            "word_bits_per_s": frame.word_rate_hz * frame.word_bits,  # with the filling of each frame's last word
            "conversions_per_taxel_per_s": frame.frame_rate_hz,
            "frame_rate_hz": frame.frame_rate_hz,
            "words_per_frame": frame.words_per_frame,
            "clock_hz": frame.clock_hz,
        },
    }


def _of_events(config: ReadoutConfig, rates: Rates, frame: FrameConfig) -> dict[str, Any]:
    """Return the data rate of a spiking readout, compared with a frame readout."""
    bits = rates.population_rate_hz * config.event_bits
    return {
        "events_per_s": rates.population_rate_hz,
        "bits_per_event": config.event_bits,
        "bits_per_s": bits,
        "events_per_taxel_per_s": rates.population_rate_hz / config.taxels,
        "ratio_to_frame": bits / frame.bit_rate_hz,
        "equal_frame_rate_hz": bits / (frame.resolution * frame.taxels),  # frames with equal N need as many bits
    }
