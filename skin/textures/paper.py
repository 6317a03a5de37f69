"""The scan of the paper's original model, which produced the published event rates (docs/guide/textures.md)."""

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.scan import Scan, Signals, gray, leak_of


@dataclass(frozen=True, kw_only=True)
class PaperScan(Scan):
    """The original scan: one-pixel taxel offsets, every fourth pixel, and a slowed-down sensor.

    Taxel (i, j) reads the pixels of image column j from row i downwards, all ``height - rows + 1`` of them.
    An image that is wider than high is turned first, so the scan runs along its longer side.
    """

    name = "paper"

    pixel_step: int = 4  # the first of this many pixels is used: 200 um of taxel pitch in pixels of 45 um, rounded
    upsampling: int = 560  # factor of the polyphase filter from kept pixels to the played line
    kaiser_beta: float = 5.0  # window of that filter
    half_length: int = 10  # of that filter in kept pixels (it has 2 * half_length * upsampling + 1 taps)
    playback_hz: float = 200_000.0
    """Samples per second of the played line: 80,080 samples last 0.4004 s, 65 mm/s."""
    sensor_time_base_hz: float = 1_400_000.0
    """Samples per second for which the sensor is discretised; seven times faster than playback, as in the original, so
    that in playback time the sensor is seven times slower."""
    max_slew_per_s: float = 120.0
    """maxSR in full scales per second, from which the loop times follow."""
    nlcs_loop_divisor: float = 3.0
    """N-LCS loop time: round(LSB tau / (LSB + tau maxSR) / nlcs_loop_divisor / dt) samples of the line."""
    lcs_skip_s: float = 0.010
    nlcs_skip_s: float = 0.100
    """Events before this time do not count; the rate still divides by the whole scan."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("pixel_step", 1), ("upsampling", 2), ("half_length", 1)):
            value = getattr(self, name)
            if type(value) is not int or value < least:
                raise InputError(f"{name} must be a whole number from {least}, not {value!r}")

    def loop_samples(self, config: ReadoutConfig, tau_s: float | None = None) -> int:
        """Return the loop time in samples of the played line, at least 1.

        LSB / maxSR; with a leak LSB tau / (LSB + tau maxSR) / 3 (docs/specification.md, section 6).
        """
        lsb = 2.0**-config.resolution
        if config.encoder.leaks:
            tau_s = config.tau_s if tau_s is None else tau_s
            loop_s = lsb * tau_s / (lsb + tau_s * self.max_slew_per_s) / self.nlcs_loop_divisor
        else:
            loop_s = lsb / self.max_slew_per_s
        return max(1, round(loop_s * self.playback_hz))

    def configure(self, config: ReadoutConfig, tau_s: float | None = None) -> ReadoutConfig:
        """Return the configuration with one sample and one decision per loop time; see ``Scan.configure``.

        The reference starts at D, with a leak at 0.
        """
        tau_s = config.tau_s if tau_s is None else tau_s
        leaky = config.encoder.leaks
        if leaky and not (math.isfinite(tau_s) and tau_s > 0):
            raise InputError(f"tau must be a positive number of seconds, not {tau_s!r}")
        rate_hz = self.playback_hz / self.loop_samples(config, tau_s)
        leak = leak_of(tau_s, rate_hz) if leaky else {}
        reset = 0 if leaky else config.step
        return config.replace(sample_rate_hz=rate_hz, decide_every="sample", reference_reset=reset, **leak)

    def duration_s(self, config: ReadoutConfig, shape: tuple[int, int]) -> float:
        """Return the duration of the played line in seconds."""
        return self._kept_pixels(config, shape) * self.upsampling / self.playback_hz

    def skipped_ticks(self, config: ReadoutConfig) -> int:
        """Return the number of initial sample ticks whose events are not counted."""
        skip_s = self.nlcs_skip_s if config.encoder.leaks else self.lcs_skip_s
        # Tick n is sample (n + 1) * every - 1 of the line; the first that counts is at or behind the skip.
        every = self._every(config)
        return -(-(round(skip_s * self.playback_hz) + 1) // every) - 1

    def signals(self, config: ReadoutConfig, image: ArrayLike, start_row: float = 0.0) -> Signals:
        """Return the sensor outputs at the end of every loop time; see ``Scan.signals``.

        The scan is linear in the pixels, so its response to each used pixel is computed once and cached.
        """
        pixels = gray(image)
        every = self._every(config)
        if start_row != 0:
            raise InputError(f"start row must be 0 in the paper preset, not {start_row:g}; use the physical preset")
        kept = self._kept_pixels(config, pixels.shape)
        turned = pixels.T if pixels.shape[1] > pixels.shape[0] else pixels
        rows, _, row, column = self._places(config)
        length = turned.shape[0] - rows + 1
        lines = np.empty((kept, config.taxels))
        for taxel, (r, c) in enumerate(zip(row, column, strict=True)):
            lines[:, taxel] = turned[r : r + length : self.pixel_step, c]
        return _paper_response(dataclasses.replace(self, skin=None, taxels=()), kept, every) @ lines

    def _kept_pixels(self, config: ReadoutConfig, shape: tuple[int, int]) -> int:
        """Return the number of pixels used from an image line."""
        long, wide = max(shape), min(shape)
        rows, columns, _, _ = self._places(config)
        if long - rows < self.pixel_step or wide < columns:
            raise InputError(
                f"an image {shape[1]} pixels wide and {shape[0]} high is too small for {rows} x "
                f"{columns} taxels in the paper preset; it needs {rows + self.pixel_step} "
                f"pixels along the scan and {columns} across"
            )
        return -(-(long - rows + 1) // self.pixel_step)

    def _every(self, config: ReadoutConfig) -> int:
        """Return the number of samples of the played line per sample tick."""
        every = self.playback_hz / config.sample_rate_hz
        whole = round(every)
        if whole < 1 or abs(every - whole) > 1e-6 * every:
            raise InputError(
                f"sample_rate_hz must be {self.playback_hz:g} divided by a whole number in the paper preset, "
                f"not {config.sample_rate_hz:g}; use the configuration from configure()"
            )
        return whole


@functools.lru_cache(maxsize=2)
def _paper_response(scan: PaperScan, kept: int, every: int) -> Signals:
    """Return the sampled sensor response to each used pixel, shape (ticks, pixels).

    Tick n is sample (n + 1) * every - 1 of the played line: the loop time ends with it, as in the original.
    Takes up to 92 MB, for a whole Kylberg line with every = 1.
    """
    from scipy import signal

    # The filter of the first pixels begins before the line; every later pixel has the response of the last of them.
    ahead = scan.half_length
    lowpass = signal.firwin(2 * ahead * scan.upsampling + 1, 1.0 / scan.upsampling, window=("kaiser", scan.kaiser_beta))
    line = signal.resample_poly(np.eye(kept)[:, : ahead + 1], scan.upsampling, 1, axis=0, window=lowpass)
    first = scan.sensor(line, scan.sensor_time_base_hz)
    at = np.arange(every - 1, len(line), every)
    response = np.empty((len(at), kept))
    for pixel in range(kept):
        since = at - max(pixel - ahead, 0) * scan.upsampling
        response[:, pixel] = np.where(since < 0, 0.0, first[since, min(pixel, ahead)])
    response.setflags(write=False)
    return response
