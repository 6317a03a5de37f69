"""Draw docs/figures/encoders.png: one signal with the events of every encoder.

``python docs/figures/encoders.py`` from the top of the project.
"""

from pathlib import Path

import numpy as np

from eskin.base.figures.style import OFF_COLOUR, ON_COLOUR, PALETTE, dress, legend_below, new_figure, save_figure
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.registry import ENCODERS
from eskin.model.taxel import decode, encode_timed, uncontended_events

CONFIG = ReadoutConfig(rows=1, columns=1, resolution=3, window_period=40, leak_period=8)
REMARKS = {
    "lcs": ": level crossings",
    "cw-lcs": ": the window closes while nothing happens",
    "nlcs": ": the threshold leaks",
    "nlcs-bipolar": ": a signed reference leaks to zero from both sides",
}


def main() -> None:
    """Draw the figure."""
    tick = np.arange(2400)
    seconds = tick / CONFIG.sample_rate_hz
    swing = 900 * np.sin(2 * np.pi * 40 * seconds) * np.exp(-(((seconds - 0.03) / 0.02) ** 2))
    plateau = 700 / (1 + np.exp(-(seconds - 0.075) / 0.003)) + 60 * np.sin(2 * np.pi * 25 * seconds)
    codes = np.rint(swing + plateau).astype(np.int16)[:, None]

    figure = new_figure(8.0, 2.3 * len(ENCODERS) + 0.6, "One signal, and the events of every encoder")
    axes = figure.subplots(len(ENCODERS), 1, sharex=True, squeeze=False)
    for axis, encoder in zip(axes[:, 0], ENCODERS, strict=True):
        config = CONFIG.replace(encoding=encoder.name)
        title = encoder.title + REMARKS.get(encoder.name, "")
        counts, late = encode_timed(config, codes)
        reference = decode(config, counts, late)[:, 0]
        events = uncontended_events(config, counts, late)
        axis.plot(seconds * 1e3, codes[:, 0] / config.full_scale, color=PALETTE["grey"], label="signal x")
        level = reference / config.full_scale
        axis.step(seconds * 1e3, level, where="post", color=PALETTE["black"], lw=1, label="reference u")
        for polarity, colour, name in ((True, ON_COLOUR, "ON events"), (False, OFF_COLOUR, "OFF events")):
            times = events["t"][events["p"] == polarity] / config.clock_hz * 1e3
            if config.has_polarity or polarity:
                level = -0.75 if polarity else -0.9
                axis.plot(times, np.full(len(times), level), "|", color=colour, ms=9, label=name)
        dress(axis, f"{title} ({len(events)} events)", up="signal (full scales)")
        axis.set_ylim(-1, 0.55)
    axes[-1, 0].set_xlabel("time (ms)", fontsize=8.5)
    legend_below(figure, axes[0, 0].get_legend_handles_labels(), 4, "N-LCS has ON events only")
    save_figure(figure, Path(__file__).with_suffix(".png"))


if __name__ == "__main__":
    main()
