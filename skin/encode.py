"""Encode an image or a file of samples into address events (docs/guide/files.md)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.inputs import check_ends
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.options import Preparation
from eskin.skin.samples import fit_array

if TYPE_CHECKING:
    from PIL.Image import Image

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".gif", ".webp", ".pgm", ".ppm")
Model = Literal["cycle", "functional"]  # with contention and link, or without


@dataclass(frozen=True)
class Encoded:
    """Events encoded from one input, with the encoded samples."""

    recording: Recording
    codes: NDArray[np.int32]  # shape (ticks, taxels)
    clipped: int  # samples beyond full scale
    notes: tuple[str, ...] = ()  # assumptions about columns, units and rate of the input
    warnings: tuple[str, ...] = ()


def encode_image(
    path: Path, config: ReadoutConfig, preset_name: str = "physical", start_row: float = 0.0, model: str = "cycle"
) -> Encoded:
    """Return the events of an array that slides over an image.

    Raise InputError if the image cannot be read or is too small.

    - ``path``: one of ``IMAGE_SUFFIXES``.
    - ``config``: the preset sets its sample rate and clock.
    - ``preset_name``: "physical" or "paper".
    - ``start_row``: image row of the array's top edge, in pixels.
    - ``model``: "cycle" or "functional".
    """
    from eskin.skin.textures.presets import preset

    scan = preset(preset_name)
    pixels = read_image(path)
    config = scan.configure(config)
    codes, clipped = scan.samples(config, pixels, start_row)
    return _encoded(path, config, codes, clipped, model, {"preset": preset_name, "start_row": start_row})


def encode_samples(
    path: Path,
    config: ReadoutConfig,
    given: Collection[str] = (),
    prepared: Mapping[str, Any] | None = None,
    model: str = "cycle",
) -> Encoded:
    """Return the events encoded from a file of samples.

    The samples are resampled and scaled if time stamps or options require this.

    Raise InputError if the file cannot be read, its rate is unknown, or a code or a value without ``scale`` is out of
    range.

    - ``path``: of a kind in ``eskin.skin.readers.registry.SUFFIXES``.
    - ``given``: fields of ``config`` that the user set; the others follow the recording.
    - ``prepared``: fields of ``eskin.skin.recordings.options.Preparation`` that the user set.
    - ``model``: "cycle" or "functional".
    """
    from eskin.skin.recordings.columns import read_one
    from eskin.skin.recordings.fitting import SLOW_HZ, with_clock, with_seconds
    from eskin.skin.textures.presets import quantise

    prepared = prepared or {}
    scale = prepared.get("scale")
    of_recordings = scale is not None and (scale.startswith("p") or "," in scale)
    if set(prepared) - {"scale"} or of_recordings:
        return _encode_prepared(path, config, given, prepared, model)
    size_given = bool({"rows", "columns"} & set(given))
    rate_hz = config.sample_rate_hz if "sample_rate_hz" in given else None
    table, notes = read_one(path, Preparation(), rate_hz, config.taxels)
    if table.time_s is not None or table.filled:
        return _encode_prepared(path, config, given, prepared, model)
    if "sample_rate_hz" not in given:
        if table.rate_hz is None:
            raise InputError(f"{path} contains no sampling rate; add --sample-rate HZ")
        config = config.replace(sample_rate_hz=table.rate_hz)
    numbers = table.values.astype(np.int64) if table.codes else table.values
    shaped = numbers.reshape(len(numbers), *table.shape) if table.shape else numbers
    values, rows, columns = fit_array(shaped, config.rows, config.columns, size_given)
    config = with_seconds(config.replace(rows=rows, columns=columns), given)
    if values.dtype.kind in "iu" and scale is None:
        metadata: dict[str, Any] = {"input": "codes"}
        codes, clipped = _checked_codes(path, values, config), 0
    else:
        if scale is None:
            _check_full_scale(path, values, config)
        factor = _scale_factor(scale, values, config)
        with np.errstate(over="ignore"):  # infinities from overflow saturate like other values out of range
            codes, clipped = quantise(values.astype(np.float64) * factor, config.sample_bits)
        metadata = {"input": "full scale", "scale": factor}
    if "clocks_per_sample" not in given and config.sample_rate_hz < SLOW_HZ:
        config = with_clock(config, [codes])
    metadata |= {"columns": list(table.names)} if table.named else {}
    return dataclasses.replace(_encoded(path, config, codes, clipped, model, metadata), notes=notes)


def preparation_of(
    place: Path, config: ReadoutConfig, prepared: Mapping[str, Any], given: Collection[str] = ()
) -> Preparation:
    """Return the preparation of a file or of a folder, with scale and baseline.

    A folder has the baseline ``first`` and the scale ``max``. Without these options, integers in a file are codes and
    floats are in full scale.

    Raise InputError if the file cannot be read, or a code or a float without these options is out of range.
    """
    from eskin.skin.recordings.columns import read_one

    if place.is_dir():
        return Preparation(**{"baseline": "first"} | dict(prepared))
    options = Preparation(**prepared)
    if "scale" in prepared or options.baseline != "none":
        return options
    rate_hz = config.sample_rate_hz if "sample_rate_hz" in given else None
    table, _ = read_one(place, options, rate_hz, config.taxels if {"rows", "columns"} & set(given) else None)
    if table.codes:
        _checked_codes(place, table.values, config)
    else:
        _check_full_scale(place, table.values, config)
    return dataclasses.replace(options, scale=repr(1 / config.full_scale if table.codes else 1.0))


def _encode_prepared(
    path: Path, config: ReadoutConfig, given: Collection[str], prepared: Mapping[str, Any], model: str
) -> Encoded:
    """Return the events of a recording after resampling, baseline removal and scaling."""
    from eskin.skin.recordings.folder import read_set

    options = preparation_of(path, config, prepared, given)
    found = read_set(path, options, config, given)
    kept = found.said_of(found.sources[0])
    metadata = {"input": "recording", "scale": kept["scale"], "baseline": options.baseline}
    metadata |= {name: kept[name] for name in ("columns", "start_s") if name in kept}
    made = _encoded(path, found.config, found.codes[0], found.clipped, model, metadata)
    return dataclasses.replace(made, notes=tuple(found.notes), warnings=tuple(found.warnings))


def _encoded(
    path: Path, config: ReadoutConfig, codes: NDArray[np.int32], clipped: int, model: str, metadata: dict[str, Any]
) -> Encoded:
    """Return the events that leave the readout during the samples."""
    if model not in get_args(Model):
        raise InputError(f"model must be one of {', '.join(get_args(Model))}, not {model!r}")
    duration = len(codes) * config.clocks_per_sample
    if model == "cycle":
        from eskin.model.readout import Stimulus, simulate

        events = simulate(config, Stimulus.from_samples(config, codes))
    else:
        from eskin.model.taxel import encode_timed, uncontended_events

        events = uncontended_events(config, *encode_timed(config, codes))
        events = events[events["t"] < duration]
    metadata = {"name": path.stem, "source": path.name, "model": model} | metadata
    return Encoded(Recording(events, config, duration, metadata=metadata), codes, clipped)


def read_image(path: Path) -> NDArray[Any]:
    """Return the gray values of an image, 0 to 255, shape (height, width)."""
    from PIL import Image

    check_ends(path)
    try:
        data = path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    try:
        with data, Image.open(data) as image:
            gray = _gray(image)
            if gray.min() == gray.max():
                raise InputError(f"has the gray value {gray.flat[0]:g} everywhere; give an image with a texture")
            return gray
    except InputError as error:
        raise InputError(f"{path} {error}") from None
    except Exception:  # the many decoders raise as many types
        raise InputError(
            f"{path} is damaged or not an image that can be read; save it as .png with 8 or 16 bits"
        ) from None


def _gray(image: Image) -> NDArray[Any]:
    if image.mode == "F":
        raise InputError("contains floats of unknown scale; save it with 8 or 16 bits")
    if image.has_transparency_data and np.asarray(image.convert("RGBA"))[:, :, 3].min() < 255:
        raise InputError("has transparent pixels, which have no gray value; save it without transparency")
    if image.mode.startswith("I"):  # 16 bits, which a conversion to 8 would cut off instead of scaling
        return np.asarray(image, dtype=np.float64) / 257.0
    return np.asarray(image.convert("L"))


def _checked_codes(source: Path, values: NDArray[Any], config: ReadoutConfig) -> NDArray[np.int32]:
    low, high = -config.full_scale, config.full_scale - 1
    wrong = np.argwhere((values < low) | (values > high))
    if len(wrong):
        tick, taxel = (int(i) for i in wrong[0])
        raise InputError(
            f"{source} has the code {values[tick, taxel]:g} at tick {tick}, taxel {taxel}, outside "
            f"{low}..{high} "
            f"of {config.sample_bits} bits; add --sample-bits, or --scale FACTOR if the file has physical values"
        )
    return values.astype(np.int32)


def _check_full_scale(path: Path, values: NDArray[Any], config: ReadoutConfig) -> None:
    """Raise InputError for values more than half a code beyond full scale, -1 to 1.

    A user can clip such values by giving a scale.
    """
    magnitudes = np.abs(values)
    if beyond := np.count_nonzero(magnitudes > 1 + 0.5 / config.full_scale):
        raise InputError(
            f"{path} has {beyond} values beyond full scale, the largest {magnitudes.max():.6g} times full scale; "
            f"subtract the baseline with --baseline first, or add --scale max"
        )


def _scale_factor(scale: str | None, values: NDArray[Any], config: ReadoutConfig) -> float:
    if scale == "max":
        largest = float(np.abs(values.astype(np.float64)).max())
        # The positive end of the range is one code short of full scale.
        return (1.0 - 1.0 / config.full_scale) / largest if largest else 1.0
    try:
        factor = 1.0 if scale is None else float(scale)
    except ValueError:
        factor = math.nan
    if not (math.isfinite(factor) and factor != 0):
        raise InputError(f"--scale needs a number other than 0, or max, not {scale!r}")
    return factor
