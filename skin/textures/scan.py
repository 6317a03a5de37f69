"""Sensor model, quantiser and image checks of both scan presets."""

import dataclasses
import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

Preset = Literal["paper", "physical"]  # names of the presets in commands and files

Signals = NDArray[np.float64]
"""Sensor outputs in units of full scale, shape (ticks, taxels); taxel (r, c) is column r * columns + c."""


def quantise(signals: ArrayLike, sample_bits: int) -> tuple[NDArray[np.int32], int]:
    """Return signals quantised to codes, and the number of clipped samples (docs/specification.md, section 6).

    Signals of any shape, in units of full scale (+-1.0), are rounded half to even, and saturated to the codes of
    ``sample_bits`` bits W, -2**(W-1) .. 2**(W-1) - 1. Samples outside that range are clipped.
    """
    full_scale = 1 << (sample_bits - 1)
    scaled = np.multiply(signals, float(full_scale))
    np.rint(scaled, out=scaled)
    # NaN fails both comparisons of a clip, but not this one.
    inside = np.count_nonzero((scaled >= -full_scale) & (scaled < full_scale))
    if inside < scaled.size:
        if np.isnan(scaled).any():
            raise InputError("signals must be numbers, not NaN; check the image they come from")
        np.clip(scaled, -full_scale, full_scale - 1, out=scaled)
    return scaled.astype(np.int32), int(scaled.size - inside)


@dataclass(frozen=True, kw_only=True)
class Scan(ABC):
    """Base class of the scan presets: sensor model and pixel scale."""

    name: ClassVar[Preset]

    sensor_numerator: tuple[float, ...] = (1000.0, 0.0)
    sensor_denominator: tuple[float, ...] = (1.0, 1007.0, 7000.0)
    """Coefficients of the sensor's transfer function, highest power of s (rad/s) first: 1000 s / (s^2 + 1007 s + 7000),
    a POSFET with 7 rad/s high-pass and a pole at 1000 rad/s."""
    pixel_full_scale: float = 256.0  # pixel value of 1.0 full scale: 2^8 for 8-bit images
    skin: tuple[int, int] | None = None  # rows and columns of the sliding skin, by default of the readout
    taxels: tuple[int, ...] = ()
    """Taxels of ``skin`` (row * columns + column) that the inputs of the readout are wired to, in their order; empty:
    all of them."""

    def __post_init__(self) -> None:
        self._check_wiring()
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, tuple) and not all(map(math.isfinite, value)):
                raise InputError(f"{field.name} must be finite numbers, not {value}")
            if isinstance(value, int | float) and not (math.isfinite(value) and value > 0):
                raise InputError(f"{field.name} must be a positive number, not {value!r}")
        if len(self.sensor_denominator) <= len(self.sensor_numerator) or self.sensor_denominator[0] == 0:
            raise InputError(
                f"sensor_denominator must be of higher order than sensor_numerator, not {self.sensor_denominator}"
            )

    @abstractmethod
    def configure(self, config: ReadoutConfig, tau_s: float | None = None) -> ReadoutConfig:
        """Return the configuration with the fields that the preset prescribes.

        - ``config``: encoding, resolution, array and everything that the preset leaves open.
        - ``tau_s``: time constant of a leak in seconds; by default that of ``config``.
        """

    @abstractmethod
    def duration_s(self, config: ReadoutConfig, shape: tuple[int, int]) -> float:
        """Return the duration in seconds of the scan of an image."""

    def skipped_ticks(self, config: ReadoutConfig) -> int:
        """Return the number of initial sample ticks whose events are not counted; 0 unless a preset skips some."""
        return 0

    @abstractmethod
    def signals(self, config: ReadoutConfig, image: ArrayLike, start_row: float = 0.0) -> Signals:
        """Return the sensor outputs at the sample ticks, shape (ticks, taxels), in units of full scale.

        Raise InputError if the image is not gray, not finite, or too small for the array.

        - ``config``: from ``configure``.
        - ``image``: shape (height, width); gray values in units of an 8-bit pixel, integer or float.
        - ``start_row``: image row, in pixels from the top, of the array's row 0; always 0 in ``paper``.
        """

    def wired_to(self, skin: ReadoutConfig, taxels: Sequence[int]) -> tuple[Self, ReadoutConfig]:
        """Return the scan of a larger skin, and the readout connected to a selection of its taxels.

        The readout is an array of one column with as many rows as taxels. The other taxels of the skin have no
        converter.

        - ``skin``: readout of all taxels.
        - ``taxels``: each once, as row * columns + column.
        """
        scan = dataclasses.replace(self, skin=(skin.rows, skin.columns), taxels=tuple(taxels))
        return scan, skin.replace(rows=len(taxels), columns=1)

    def _check_wiring(self) -> None:
        """Check that all selected taxels exist and are distinct."""
        if self.skin is None:
            if self.taxels:
                raise InputError("chosen taxels need the rows and columns of the skin; give skin")
            return
        count = self.skin[0] * self.skin[1]
        if wrong := [taxel for taxel in self.taxels if not 0 <= taxel < count]:
            raise InputError(f"taxel {wrong[0]} is not on the skin; its taxels are 0..{count - 1}")
        if len(set(self.taxels)) < len(self.taxels) or not self.taxels:
            raise InputError("choose at least one taxel, and no taxel twice")

    def _places(self, config: ReadoutConfig) -> tuple[int, int, NDArray[np.int64], NDArray[np.int64]]:
        """Return the size of the skin, and row and column of the taxel at every input of the readout."""
        rows, columns = self.skin or (config.rows, config.columns)
        taxels = np.array(self.taxels or range(config.taxels), np.int64)
        if len(taxels) != config.taxels:
            raise InputError(f"{len(taxels)} taxels are chosen, but the readout has {config.taxels} inputs")
        return rows, columns, taxels // columns, taxels % columns

    def samples(self, config: ReadoutConfig, image: ArrayLike, start_row: float = 0.0) -> tuple[NDArray[np.int32], int]:
        """Return the codes of all taxels, int32 of shape (ticks, taxels), and the number of clipped samples."""
        return quantise(self.signals(config, image, start_row), config.sample_bits)

    def sensor(self, line: Signals, rate_hz: float) -> Signals:
        """Return the sensor response to lines of pixel values, shape (ticks, lines), in units of full scale.

        The sensor starts from rest. The solution is exact for a line that is straight between its samples (first-order
        hold).
        """
        from scipy import signal

        numerator, denominator = _discrete(self.sensor_numerator, self.sensor_denominator, rate_hz)
        response: Signals = signal.lfilter(numerator / self.pixel_full_scale, denominator, line, axis=0)
        return response


@functools.lru_cache(maxsize=16)
def _discrete(numerator: tuple[float, ...], denominator: tuple[float, ...], rate_hz: float) -> tuple[Any, Any]:
    """Return the cached coefficients of a sensor between samples.

    Without the cache, their computation would take half the time of every scan.
    """
    from scipy import signal

    found, below, _ = signal.cont2discrete((numerator, denominator), 1.0 / rate_hz, method="foh")
    return np.ravel(found), below


def leak_of(tau_s: float, sample_rate_hz: float) -> dict[str, Any]:
    """Return the leak settings of a configuration for a time constant."""
    leak = ReadoutConfig.from_tau(tau_s, 1.0 / sample_rate_hz)
    return {"leak_shift": leak.leak_shift, "leak_period": leak.leak_period}


def gray(image: ArrayLike) -> NDArray[np.float64]:
    """Return an image as a finite float64 array of shape (height, width)."""
    pixels = np.asarray(image)
    if pixels.ndim != 2 or pixels.dtype.kind not in "uif":
        raise InputError(
            f"an image must be a gray array of shape (height, width), not {pixels.dtype} of shape "
            f"{pixels.shape}; convert it to gray"
        )
    values = pixels.astype(np.float64)
    if not np.isfinite(values).all():
        raise InputError("an image must not contain NaN or infinity; replace those pixels")
    return values
