"""The commands encode and decode (docs/guide/files.md)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
import typer
from numpy.typing import NDArray

from model.cli.app import printable
from model.cli.config_options import with_config
from model.cli.crew_options import Scheduler, Workers, open_crew
from model.cli.field_options import with_fields
from model.cli.progress import bar
from model.commands.recordings import PREPARATION, print_notes, print_set, quality_text, warn
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.address import Events
from model.events.compare import count_per_taxel
from model.events.recording import Recording, check_event_path
from model.events.samples import ARRAY_SUFFIXES, check_samples_path, fit_array, read_samples, write_samples
from model.files import check_writable
from model.recordings.options import Preparation

if TYPE_CHECKING:
    from PIL.Image import Image

    from model.crew.crew import Crew

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".gif", ".webp", ".pgm", ".ppm")

Model = Literal["cycle", "functional"]


@dataclass(frozen=True)
class _Input:
    """What encode read: codes of shape (ticks, taxels), and the configuration they belong to."""

    codes: NDArray[Any]
    config: ReadoutConfig
    clipped: int
    metadata: dict[str, Any]
    warnings: tuple[str, ...] = ()


# -- encode ------------------------------------------------------------------------------------------


@with_config
@with_fields(Preparation, PREPARATION, "prepared", {"baseline": "first of a folder, none of a file"})
def encode(
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    source: Annotated[
        Path,
        typer.Argument(metavar="INPUT", help="image, samples as .npy, .npz, .csv, or folder of class folders"),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="event file to write, .npz; of a folder, a folder", metavar="OUT")
    ],
    preset: Annotated[str | None, typer.Option(help="scan of an image [physical]", metavar="physical|paper")] = None,
    start_row: Annotated[
        float | None, typer.Option(help="image row of the array's top edge [0]", metavar="PIXELS")
    ] = None,
    model: Annotated[
        str, typer.Option(help="with contention and link, or without", metavar="|".join(get_args(Model)))
    ] = "cycle",
    name: Annotated[str | None, typer.Option(help="name kept in the file [that of the input]", metavar="TEXT")] = None,
    label: Annotated[
        str | None, typer.Option("--class", "--label", help="class kept in the file", metavar="TEXT")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Encode an image, your own samples or a folder of them into address events."""
    from model.recordings.folder import quality_warnings
    from model.recordings.quality import measure_quality

    if model not in get_args(Model):
        raise InputError(f"--model must be one of {', '.join(get_args(Model))}, not {model!r}")
    if source.is_dir():
        own = {"--preset": preset, "--start-row": start_row, "--name": name, "--class": label}
        own["--model functional"] = None if model == "cycle" else model
        if unused := [option for option, value in own.items() if value is not None]:
            raise InputError(f"{unused[0]} belongs to one input; a folder gives each recording its name and class")
        with open_crew(workers, scheduler, threads=True) as crew:
            _encode_folder(source, out, Preparation(**({"baseline": "first"} | prepared)), config, given, crew)
        return
    if workers is not None or scheduler is not None:
        option = "--workers" if scheduler is None else "--scheduler"
        raise InputError(f"{option} is for the recordings of a folder; {source} is one input, leave it out")
    check_event_path(out)
    check_writable(out)
    kind = source.suffix.lower()
    if kind in IMAGE_SUFFIXES:
        if prepared:
            option = "--" + next(iter(prepared)).removesuffix("_hz").replace("_", "-")
            raise InputError(f"{option} belongs to samples; the scale of an image is part of its preset")
        data = _scan_image(source, config, preset or "physical", start_row or 0.0)
    elif kind in ARRAY_SUFFIXES:
        if preset is not None or start_row is not None:
            raise InputError("--preset and --start-row belong to images; samples are taken as they are")
        data = _take_samples(source, config, given, prepared)
    else:
        raise InputError(
            f"{source} is of unknown kind; give an image ({', '.join(IMAGE_SUFFIXES)}) "
            f"or samples ({', '.join(ARRAY_SUFFIXES)})"
        )
    metadata = {"name": name or source.stem, "source": source.name, "model": model} | data.metadata
    metadata |= {"class": label} if label else {}
    events, duration = _simulate(data.config, data.codes, model), _duration(data.config, data.codes)
    recording = Recording(events, data.config, duration, metadata=metadata)
    recording.save(out)
    _print_summary(recording, data, out)
    if kind in ARRAY_SUFFIXES and model == "cycle":
        quality = measure_quality(data.config, data.codes, events)
        print(quality_text(quality))
        warn((*data.warnings, *quality_warnings(data.config, [data.codes], quality)))


def _encode_folder(
    source: Path, out: Path, options: Preparation, config: ReadoutConfig, given: frozenset[str], crew: Crew
) -> None:
    """Write an event file for every recording of a folder of class folders, and say how well they render it."""
    from model.recordings.folder import read_set, write_folder

    if out.exists() and not out.is_dir():
        raise InputError(f"cannot write {out}: it is a file; give a folder for the event files")
    with bar("reading recordings") as progress:
        recordings = read_set(source, options, config, given, progress)
    with bar("encoding recordings", len(recordings.sources)) as progress:
        quality, warnings = write_folder(recordings, out, crew, progress)
    print_set(recordings)
    print(
        printable(f"{out}: {len(recordings.sources)} event files, {quality.events} events in {quality.seconds:.6g} s")
    )
    print(quality_text(quality))
    warn((*recordings.warnings, *warnings))


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


def _take_samples(source: Path, config: ReadoutConfig, given: frozenset[str], prepared: dict[str, Any]) -> _Input:
    """Return the user's own samples as codes: as they stand, or prepared where options or time stamps ask for it."""
    from model.recordings.suit import SLOW_HZ, with_clock, with_seconds
    from model.textures.presets import quantise

    scale = prepared.get("scale")
    percentile = scale is not None and scale.startswith("p")
    if set(prepared) - {"scale"} or percentile or (source.suffix.lower() == ".csv" and _has_time(source)):
        return _prepare(source, config, given, prepared)
    samples = read_samples(source)
    if "sample_rate_hz" not in given:
        if samples.rate_hz is None:
            raise InputError(f"{source} does not say its sampling rate; add --sample-rate HZ")
        config = config.replace(sample_rate_hz=samples.rate_hz)
    size_given = bool({"rows", "columns"} & given)
    values, rows, columns = fit_array(samples.values, config.rows, config.columns, size_given)
    config = with_seconds(config.replace(rows=rows, columns=columns), given)
    if values.dtype.kind in "iu" and scale is None:
        metadata: dict[str, Any] = {"input": "codes"}
        codes, clipped = _checked_codes(source, values, config), 0
    else:
        factor = _scale_factor(scale, values, config)
        with np.errstate(over="ignore"):  # what overflows to infinity saturates, as all that is out of range
            codes, clipped = quantise(values.astype(np.float64) * factor, config.sample_bits)
        metadata = {"input": "full scale", "scale": factor}
    if "clocks_per_sample" not in given and config.sample_rate_hz < SLOW_HZ:
        config = with_clock(config, [codes])
    return _Input(codes, config, clipped, metadata, ())


def _has_time(source: Path) -> bool:
    """Return whether a .csv has a column that is no taxel; what cannot be read is left to the one who reads it."""
    from model.recordings.table import read_table

    try:
        return bool(read_table(source, Preparation()).notes)
    except InputError:
        return False


def _prepare(source: Path, config: ReadoutConfig, given: frozenset[str], prepared: dict[str, Any]) -> _Input:
    """Return the samples of a recording without time stamps and baseline, in full scale."""
    from model.recordings.folder import read_set
    from model.recordings.table import read_table

    options = Preparation(**prepared)
    if "scale" not in prepared and options.baseline == "none":  # the values mean what they mean without time stamps
        codes = read_table(source, options).codes
        options = dataclasses.replace(options, scale=repr(1 / config.full_scale if codes else 1.0))
    found = read_set(source, options, config, given)
    if found.clipped and "scale" not in prepared and options.baseline == "none":
        raise InputError(
            f"{source} has {found.clipped} values beyond full scale; take the baseline off with --baseline first, or "
            f"add --scale max"
        )
    print_notes(found.notes)
    metadata = {"input": "recording", "scale": found.scale, "baseline": options.baseline}
    return _Input(found.codes[0], found.config, found.clipped, metadata, found.warnings)


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
    print(printable(f"{out}: {len(recording.events)} events in {recording.duration_s:.6g} s, {rate}"))
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
    from model.recordings.quality import decode_recording

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
    print(printable(f"{out}: {signals.shape[0]} ticks of {signals.shape[1]} taxels at {config.sample_rate_hz:g} Hz"))
    print(f"from {len(recording.events)} events, {low:+.4f}..{high:+.4f} of full scale")
