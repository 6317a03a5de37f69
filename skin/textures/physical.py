"""The scan described in the text of the paper (docs/guide/textures.md)."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.scan import Scan, Signals, gray, leak_of


@dataclass(frozen=True, kw_only=True)
class PhysicalScan(Scan):
    """The physical scan: an array of 200 um pitch slides from left to right over the image at 65 mm/s.

    Taxel (r, c) starts r pitches below ``start_row`` and c pitches right of the left edge; the scan ends when
    the last column reaches the right edge. Pixel centres are points, in between the image is bilinear. The
    array is put down at the start: the sensor starts from rest, so its first output is the contact.
    """

    name = "physical"

    taxel_pitch_m: float = 200e-6  # distance of neighbouring taxels in metres (paper, section II)
    pixel_pitch_m: float = 26e-3 / 576  # of neighbouring pixels: a Kylberg image of 576 pixels is 26 mm wide
    speed_m_per_s: float = 65e-3  # of the slide
    lowest_time_base_hz: float = 20_000.0
    """The sensor is solved on the sample ticks, or on whole fractions of them until it is solved this often."""

    @property
    def taxel_pitch_px(self) -> float:
        """Distance of neighbouring taxels in pixels."""
        return self.taxel_pitch_m / self.pixel_pitch_m

    def configure(self, config: ReadoutConfig, tau_s: float | None = None) -> ReadoutConfig:
        """Return the configuration with the leak of a leaky encoder set to ``tau_s``; see ``Scan.configure``."""
        if not config.encoder.leaks or tau_s is None:
            return config
        return config.replace(**leak_of(tau_s, config.sample_rate_hz))

    def duration_s(self, config: ReadoutConfig, shape: tuple[int, int]) -> float:
        """Return the duration of the slide in seconds, a whole number of sample periods."""
        return self._ticks(config, shape) / config.sample_rate_hz

    def start_rows(self, config: ReadoutConfig, shape: tuple[int, int], count: int) -> list[float]:
        """Return evenly spaced start rows from the top of an image to the lowest possible row.

        - ``shape``: height and width of the image in pixels.
        - ``count``: number of rows, at least 1; a single one is row 0.
        """
        if count < 1:
            raise InputError(f"the number of start rows must be at least 1, not {count}")
        return [float(row) for row in np.linspace(0.0, self._lowest_start_row(config, shape), count)]

    def signals(self, config: ReadoutConfig, image: ArrayLike, start_row: float = 0.0) -> Signals:
        """Return the sensor outputs at the sample ticks; see ``Scan.signals``."""
        pixels = gray(image)
        rows, columns, row, column = self._places(config)
        lowest = self._lowest_start_row(config, pixels.shape)
        if not 0 <= start_row <= lowest:
            raise InputError(
                f"start row must be in 0..{lowest:.6g} for {rows} x {columns} taxels "
                f"on an image {pixels.shape[0]} pixels high, not {start_row:g}"
            )
        pitch = self.taxel_pitch_px
        finer = max(1, math.ceil(self.lowest_time_base_hz / config.sample_rate_hz - 1e-9))  # ticks of the sensor model
        step = self._step_px(config) / finer
        count = (self._ticks(config, pixels.shape) - 1) * finer + 1
        lines = np.empty((count, config.taxels))
        travelled = step * np.arange(count)
        for one in np.unique(column):
            there = column == one
            strips = _interpolate(pixels, start_row + pitch * row[there]).T
            lines[:, there] = _interpolate(strips, travelled + pitch * one)
        response = self.sensor(lines, config.sample_rate_hz * finer)
        return np.ascontiguousarray(response[::finer])

    def _step_px(self, config: ReadoutConfig) -> float:
        """Return the distance in pixels that the array moves per sample tick."""
        return self.speed_m_per_s / self.pixel_pitch_m / config.sample_rate_hz

    def _lowest_start_row(self, config: ReadoutConfig, shape: tuple[int, int]) -> float:
        rows, columns, _, _ = self._places(config)
        room = shape[0] - 1 - self.taxel_pitch_px * (rows - 1)
        if room < 0 or shape[1] - 1 - self.taxel_pitch_px * (columns - 1) <= 0:
            raise InputError(
                f"an image {shape[1]} pixels wide and {shape[0]} high is too small for {rows} x "
                f"{columns} taxels in the physical preset, {self.taxel_pitch_px:.3g} pixels apart; "
                f"use a smaller array or a larger image"
            )
        return room

    def _ticks(self, config: ReadoutConfig, shape: tuple[int, int]) -> int:
        self._lowest_start_row(config, shape)
        way = shape[1] - 1 - self.taxel_pitch_px * (self._places(config)[1] - 1)
        # The last tick stands at the right edge or before it; the margin is for rounding only.
        return math.floor(way / self._step_px(config) + 1e-9) + 1


def _interpolate(values: NDArray[np.float64], positions: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return values interpolated linearly along axis 0 at the given positions."""
    below = np.clip(positions.astype(np.intp), 0, max(len(values) - 2, 0))
    above = np.minimum(below + 1, len(values) - 1)
    part = np.clip(positions - below, 0.0, 1.0)[:, None]
    result: NDArray[np.float64] = values[below] * (1.0 - part) + values[above] * part
    return result


def large_enough(image: NDArray[np.uint8], config: ReadoutConfig) -> NDArray[np.uint8]:
    """Return an embedded texture, tiled for a larger array so that half its width remains for the scan."""
    pitch = PhysicalScan().taxel_pitch_px
    height = math.ceil(config.rows * pitch) + 1
    width = math.ceil(config.columns * pitch) + image.shape[1] // 2
    repeats = (-(-height // image.shape[0]), -(-width // image.shape[1]))
    return np.tile(image, repeats)
