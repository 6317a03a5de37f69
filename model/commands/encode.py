"""The commands encode, decode and compare (docs/guide/files.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
import typer
from numpy.typing import NDArray

from model.cli.config_options import with_config
from model.cli.tables import new_table, show
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.address import Events
from model.events.compare import count_per_taxel, first_difference
from model.events.recording import Recording, check_event_path
from model.events.samples import ARRAY_SUFFIXES, check_samples_path, fit_array, read_samples, write_samples
from model.files import check_writable

if TYPE_CHECKING:
    from PIL.Image import Image

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".gif", ".webp", ".pgm", ".ppm")

Model = Literal["cycle", "functional"]

MOST_VALUES = 2**28
"""Largest number of values that decode writes (2 GiB): a longer recording is hardly meant."""

_MOST_LINES = 32  # differing taxels listed by compare


@dataclass(frozen=True)
class _Input:
    """What encode read: codes of shape (ticks, taxels), and the configuration they belong to."""

    codes: NDArray[Any]
    config: ReadoutConfig
    clipped: int
    metadata: dict[str, Any]


# -- encode ------------------------------------------------------------------------------------------


@with_config
def encode(
    config: ReadoutConfig,
    given: frozenset[str],
    source: Annotated[
        Path,
        typer.Argument(metavar="INPUT", help="image, or samples as .npy, .npz, .csv"),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="event file to write, .npz", metavar="FILE")],
    scale: Annotated[
        str | None, typer.Option(help="factor from samples to full scale, or max", metavar="FACTOR|max")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="scan of an image [physical]", metavar="physical|paper")] = None,
    start_row: Annotated[
        float | None, typer.Option(help="image row of the array's top edge [0]", metavar="PIXELS")
    ] = None,
    model: Annotated[
        str, typer.Option(help="with contention and link, or without", metavar="|".join(get_args(Model)))
    ] = "cycle",
    name: Annotated[str | None, typer.Option(help="name kept in the file [that of the input]", metavar="TEXT")] = None,
    label: Annotated[str | None, typer.Option(help="class or remark kept in the file", metavar="TEXT")] = None,
) -> None:
    """Encode an image or your own samples into address events."""
    check_event_path(out)
    check_writable(out)
    if model not in get_args(Model):
        raise InputError(f"--model must be one of {', '.join(get_args(Model))}, not {model!r}")
    kind = source.suffix.lower()
    if kind in IMAGE_SUFFIXES:
        if scale is not None:
            raise InputError("--scale belongs to samples; the scale of an image is part of its preset")
        data = _scan_image(source, config, preset or "physical", start_row or 0.0)
    elif kind in ARRAY_SUFFIXES:
        if preset is not None or start_row is not None:
            raise InputError("--preset and --start-row belong to images; samples are taken as they are")
        data = _take_samples(source, config, given, scale)
    else:
        raise InputError(
            f"{source} is of unknown kind; give an image ({', '.join(IMAGE_SUFFIXES)}) "
            f"or samples ({', '.join(ARRAY_SUFFIXES)})"
        )
    metadata = {"name": name or source.stem, "source": source.name, "model": model} | data.metadata
    metadata |= {"label": label} if label else {}
    events, duration = _simulate(data.config, data.codes, model), _duration(data.config, data.codes)
    recording = Recording(events, data.config, duration, metadata=metadata)
    recording.save(out)
    _print_summary(recording, data, out)


def _scan_image(source: Path, config: ReadoutConfig, preset_name: str, start_row: float) -> _Input:
    """Return the samples of an array that slides over an image."""
    from model.textures.presets import preset

    scan = preset(preset_name)
    pixels = _read_image(source)
    config = scan.configure(config)
    codes, clipped = scan.samples(config, pixels, start_row)
    return _Input(codes, config, clipped, {"preset": preset_name, "start_row": start_row})


def _read_image(path: Path) -> NDArray[Any]:
    """Return the gray values of an image in units of an 8-bit pixel, shape (height, width)."""
    from PIL import Image

    try:
        data = path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    try:
        with data, Image.open(data) as image:
            return _gray(image)
    except Exception:  # the many decoders raise as many types
        raise InputError(
            f"{path} is damaged or not an image that can be read; save it as .png with 8 or 16 bits"
        ) from None


def _gray(image: Image) -> NDArray[Any]:
    if image.mode.startswith("I"):  # 16 bits, which a conversion to 8 would cut off instead of scaling
        return np.asarray(image, dtype=np.float64) / 257.0
    return np.asarray(image.convert("L"))


def _take_samples(source: Path, config: ReadoutConfig, given: frozenset[str], scale: str | None) -> _Input:
    """Return the user's own samples as codes."""
    from model.textures.presets import quantise

    samples = read_samples(source)
    if "sample_rate_hz" not in given:
        if samples.rate_hz is None:
            raise InputError(f"{source} does not say its sampling rate; add --sample-rate HZ")
        config = config.replace(sample_rate_hz=samples.rate_hz)
    size_given = bool({"rows", "columns"} & given)
    values, rows, columns = fit_array(samples.values, config.rows, config.columns, size_given)
    config = config.replace(rows=rows, columns=columns)
    if values.dtype.kind in "iu" and scale is None:
        return _Input(_checked_codes(source, values, config), config, 0, {"input": "codes"})
    factor = _scale_factor(scale, values, config)
    with np.errstate(over="ignore"):  # what overflows to infinity saturates, as all that is out of range
        codes, clipped = quantise(values.astype(np.float64) * factor, config.sample_bits)
    return _Input(codes, config, clipped, {"input": "full scale", "scale": factor})


def _checked_codes(source: Path, values: NDArray[Any], config: ReadoutConfig) -> NDArray[np.int32]:
    low, high = -config.full_scale, config.full_scale - 1
    wrong = np.argwhere((values < low) | (values > high))
    if len(wrong):
        tick, taxel = (int(i) for i in wrong[0])
        raise InputError(
            f"{source} has the code {values[tick, taxel]} at tick {tick}, taxel {taxel}, outside "
            f"{low}..{high} "
            f"of {config.sample_bits} bits; add --sample-bits, or --scale FACTOR to read them as numbers"
        )
    return values.astype(np.int32)


def _scale_factor(scale: str | None, values: NDArray[Any], config: ReadoutConfig) -> float:
    """Return the factor from the unit of the values to full scale; "max" puts the largest at full scale."""
    if scale == "max":
        largest = float(np.abs(values.astype(np.float64)).max())
        # The positive end of the range is one code short of full scale.
        return (1.0 - 1.0 / config.full_scale) / largest if largest else 1.0
    try:
        factor = 1.0 if scale is None else float(scale)
    except ValueError:
        factor = math.nan
    if not (math.isfinite(factor) and factor != 0):
        raise InputError(f"--scale takes a number other than 0, or max, not {scale!r}")
    return factor


def _simulate(config: ReadoutConfig, codes: NDArray[Any], model: str) -> Events:
    """Return the events that leave while the samples last; what would leave later is not seen."""
    if model == "cycle":
        from model.readout import Stimulus, simulate

        return simulate(config, Stimulus.from_samples(config, codes))
    from model.taxel import encode_timed, uncontended_events

    events = uncontended_events(config, *encode_timed(config, codes))
    return events[events["t"] < _duration(config, codes)]


def _duration(config: ReadoutConfig, codes: NDArray[Any]) -> int:
    """Return the clocks that the samples last."""
    return len(codes) * config.clocks_per_sample


def _print_summary(recording: Recording, data: _Input, out: Path) -> None:
    config, full_scale = recording.config, recording.config.full_scale
    counts = count_per_taxel(recording.events, config)
    rate = f"{recording.rate_hz:.6g} events/s"
    print(f"{out}: {len(recording.events)} events in {recording.duration_s:.6g} s, {rate}")
    print(
        f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels, "
        f"{len(data.codes)} samples at {config.sample_rate_hz:g} Hz, clock {config.clock_hz:g} Hz"
    )
    low, high = int(data.codes.min()) / full_scale, int(data.codes.max()) / full_scale
    clipped = f"{data.clipped} of {data.codes.size} clipped" if data.clipped else "none clipped"
    print(f"samples {low:+.4f}..{high:+.4f} of full scale, {clipped}")
    print(f"events per taxel: {_at(counts, int(counts.argmin()))} to {_at(counts, int(counts.argmax()))}")


def _at(counts: NDArray[np.int64], index: int) -> str:
    row, column = divmod(index, counts.shape[1])
    return f"{counts[row, column]} (row {row}, column {column})"


# -- decode ------------------------------------------------------------------------------------------


def decode(
    source: Annotated[Path, typer.Argument(metavar="EVENTS", help="event file")],
    out: Annotated[Path, typer.Option("-o", "--out", help="signals: .npz, .npy or .csv", metavar="FILE")],
    plot: Annotated[Path | None, typer.Option(help="picture of signals and events", metavar="FILE")] = None,
) -> None:
    """Rebuild the signals of all taxels from an event file alone."""
    check_samples_path(out)
    if plot is not None:
        from model.figures.raster import plot_signals
        from model.figures.style import check_picture_path

        check_picture_path(plot)
    recording = Recording.load(source)
    config = recording.config
    signals = decode_recording(recording)
    write_samples(out, signals, config.sample_rate_hz)
    if plot is not None:
        title = f"{recording.metadata.get('name', source.stem)}: {config.encoding} {config.resolution} b"
        plot_signals(recording.events, signals, config, plot, title, "reconstruction", recording.duration_clocks)
    low, high = (float(signals.min()), float(signals.max())) if signals.size else (0.0, 0.0)
    print(f"{out}: {signals.shape[0]} ticks of {signals.shape[1]} taxels at {config.sample_rate_hz:g} Hz")
    print(f"from {len(recording.events)} events, {low:+.4f}..{high:+.4f} of full scale")


def decode_recording(recording: Recording) -> NDArray[np.float64]:
    """Return the reconstruction of a recording, shape (ticks, taxels), in full scale.

    An event counts for the sample tick in which it left, (t - 3) // clocks_per_sample. One that had to wait
    for the link may count for a later tick than that of its cause, or, after the last tick, for none.
    """
    from model.taxel import counts_of_events, decode

    config = recording.config
    ticks = -(-recording.duration_clocks // config.clocks_per_sample)
    stated = recording.metadata.get("ticks")  # a recording may last longer than its samples, to see the last events
    if type(stated) is int and 0 <= stated < ticks:
        ticks = stated
    if ticks * config.taxels > MOST_VALUES:
        raise InputError(
            f"the recording lasts {ticks} ticks of {config.taxels} taxels, more than decode writes "
            f"({MOST_VALUES} values); cut it into shorter ones"
        )
    counts, late = counts_of_events(config, recording.events, ticks)
    return decode(config, counts, late) / config.full_scale


# -- compare -----------------------------------------------------------------------------------------


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="event file")],
    b: Annotated[Path, typer.Argument(metavar="B", help="event file")],
    plot: Annotated[Path | None, typer.Option(help="raster picture of both", metavar="FILE")] = None,
) -> None:
    """Compare two event files, event by event: exit code 0 if equal, 1 if not."""
    if plot is not None:
        from model.figures.raster import plot_comparison
        from model.figures.style import check_picture_path

        check_picture_path(plot)
    first, second = Recording.load(a), Recording.load(b)
    labels = (a.name, b.name) if a.name != b.name else (str(a), str(b))
    for line in _settings_that_differ(first, second, labels):
        print(line)
    difference = first_difference(first.events, second.events)
    if plot is not None:
        duration = max(first.duration_clocks, second.duration_clocks)
        config = _covering(first.config, second.config)
        plot_comparison((first.events, second.events), config, plot, labels, duration_clocks=duration)
    if difference is None:
        print(f"equal: {len(first.events)} events")
        return
    print(difference.describe(labels))
    _print_counts(first, second, labels)
    raise typer.Exit(1)


def _settings_that_differ(first: Recording, second: Recording, labels: tuple[str, str]) -> list[str]:
    fields = [
        recording.config.to_dict() | {"duration_clocks": recording.duration_clocks} for recording in (first, second)
    ]
    return [
        f"{name} differs: {labels[0]} {value}; {labels[1]} {fields[1][name]}"
        for name, value in fields[0].items()
        if value != fields[1][name]
    ]


def _covering(a: ReadoutConfig, b: ReadoutConfig) -> ReadoutConfig:
    """Return a configuration whose array holds the addresses of both; a's in everything else."""
    polar = next((c for c in (a, b) if c.has_polarity), a)
    return polar.replace(
        rows=max(a.rows, b.rows),
        columns=max(a.columns, b.columns),
        sample_rate_hz=a.sample_rate_hz,
        clocks_per_sample=a.clocks_per_sample,
    )


def _print_counts(first: Recording, second: Recording, labels: tuple[str, str]) -> None:
    """Print the numbers of events of the taxels in which they differ."""
    config = _covering(first.config, second.config)
    counts = [count_per_taxel(recording.events, config) for recording in (first, second)]
    print(f"\n{labels[0]} has {len(first.events)} events, {labels[1]} {len(second.events)}")
    differing = np.argwhere(counts[0] != counts[1])
    if not len(differing):
        print("every taxel has the same number of events in both")
        return
    print(f"the number of events differs in {len(differing)} of {config.taxels} taxels")
    table = new_table(("row", "column", *labels, "difference"), left=(), overflow="fold")
    for row, column in differing[:_MOST_LINES]:
        n, m = (int(c[row, column]) for c in counts)
        table.add_row(str(row), str(column), str(n), str(m), f"{m - n:+d}")
    if len(differing) > _MOST_LINES:
        table.caption = f"and {len(differing) - _MOST_LINES} more"
    show(table)
