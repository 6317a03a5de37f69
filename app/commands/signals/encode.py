"""The commands encode, decode and compare (docs/guide/files.md)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import typer
from numpy.typing import NDArray

from eskin.app.cli import echo
from eskin.app.commands import common
from eskin.app.commands.signals.recordings import (
    DEFAULTS,
    PREPARATION,
    print_notes,
    print_set,
    quality_text,
    scale_text,
    warn,
)
from eskin.app.options import RECORDINGS, arg, command, opt, option_name, out_file, with_config, with_fields
from eskin.app.tables import new_table, show
from eskin.base.errors import InputError
from eskin.base.figures.style import check_picture_path
from eskin.base.progress import bar
from eskin.base.workers.engine import open_pool
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import count_per_taxel, covering_config, first_difference
from eskin.model.events.recording import Recording, check_event_path
from eskin.skin.encode import IMAGE_SUFFIXES, Encoded, Model, encode_image, encode_samples, preparation_of
from eskin.skin.figures.raster import plot_comparison, plot_signals
from eskin.skin.readers.registry import SUFFIXES
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.quality import decode_recording, names_and_start
from eskin.skin.samples import check_samples_path, write_samples

if TYPE_CHECKING:
    from eskin.base.workers.engine import Pool

_MAX_LINES = 32  # differing taxels that compare lists


@command(
    "Signals to events and back",
    fuzz="good/samples.npz --rows 1 --columns 4 -o new.npz",
    idle={
        "--preset=paper": "--sample-rate --decide-every --reference-reset --start-row",
    },
)
@with_config
@with_fields(Preparation, PREPARATION, "prepared", DEFAULTS, heading=RECORDINGS)
def encode(
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    source: Path = arg(..., "INPUT", "image, samples as .npy, .npz, .csv, or folder of class folders"),
    out: Path = out_file(
        ...,
        "OUT",
        "event file to write (.npz); for an input folder, a folder",
        when=lambda given: given["source"].is_dir(),
    ),
    preset: str | None = opt(None, "physical|paper", "scan of an image [physical]"),
    start_row: float | None = opt(None, "PIXELS", "image row of the array's top edge [0]"),
    model: str = opt("cycle", "|".join(get_args(Model)), "cycle: with arbiter and link; functional: without"),
    name: str | None = opt(None, "TEXT", "name stored in the file [name of the input]"),
    label: str | None = opt(None, "--class", "--label", "TEXT", "class stored in the file"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
) -> None:
    """Encode an image, a file of samples, or a folder of sample files into address events."""
    if model not in get_args(Model):
        raise InputError(f"--model must be one of {', '.join(get_args(Model))}, not {model!r}")
    Preparation(**prepared)  # refuses what is out of range before any work
    if source.is_dir():
        own = {"--preset": preset, "--start-row": start_row, "--name": name, "--class": label}
        own["--model functional"] = None if model == "cycle" else model
        if unused := [option for option, value in own.items() if value is not None]:
            raise InputError(f"{unused[0]} is for a single input; a folder gives each recording its name and class")
        with open_pool(workers, scheduler, threads=True) as pool:
            _encode_folder(source, out, preparation_of(source, config, prepared), config, given, pool)
        return
    of_folders = {"--scheduler": scheduler, "--workers": workers, "--strict": prepared.get("strict")}
    if wrong := [option for option, value in of_folders.items() if value is not None]:
        raise InputError(
            f"{wrong[0]} is for the recordings of a folder, but {source} is a single input; leave {wrong[0]} out"
        )
    check_event_path(out)
    kind = source.suffix.lower()
    if kind in IMAGE_SUFFIXES:
        if prepared:
            option = option_name(next(iter(prepared)), Preparation)
            raise InputError(f"{option} is only for samples; the preset sets the scale of an image")
        made = encode_image(source, config, preset or "physical", start_row or 0.0, model)
    elif kind in SUFFIXES:
        if preset is not None or start_row is not None:
            raise InputError("--preset and --start-row are only for images, and this input has samples; leave them out")
        made = encode_samples(source, config, given, prepared, model)
    else:
        raise InputError(
            f"{source} is of unknown kind; give an image ({', '.join(IMAGE_SUFFIXES)}) "
            f"or samples ({', '.join(SUFFIXES)})"
        )
    said = ({"name": name} if name else {}) | ({"class": label} if label else {})
    recording = dataclasses.replace(made.recording, metadata=made.recording.metadata | said)
    recording.save(out)
    print_notes(made.notes)
    _print_summary(recording, made, out)
    if kind in SUFFIXES and model == "cycle":
        from eskin.skin.recordings.folder import quality_warnings
        from eskin.skin.recordings.quality import measure_quality

        quality = measure_quality(recording.config, made.codes, recording.events)
        print(quality_text(quality))
        warn((*made.warnings, *quality_warnings(recording.config, [made.codes], quality)))


def _encode_folder(
    source: Path, out: Path, options: Preparation, config: ReadoutConfig, given: frozenset[str], pool: Pool
) -> None:
    """Write an event file for every recording in class folders, and print the quality of the events."""
    from eskin.skin.recordings.folder import read_set, write_folder

    with bar("reading recordings") as progress:
        recordings = read_set(source, options, config, given, progress)
    with bar("encoding recordings", len(recordings.sources)) as progress:
        quality, warnings = write_folder(recordings, out, pool, progress)
    print_set(recordings)
    echo(f"{out}: {len(recordings.sources)} event files, {quality.events} events in {quality.seconds:.6g} s")
    print(quality_text(quality))
    warn((*recordings.warnings, *warnings))


def _print_summary(recording: Recording, data: Encoded, out: Path) -> None:
    config, full_scale = recording.config, recording.config.full_scale
    counts = count_per_taxel(recording.events, config)
    rate = f"{recording.rate_hz:.6g} events/s"
    echo(f"{out}: {len(recording.events)} events in {recording.duration_s:.6g} s, {rate}")
    print(
        f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels, "
        f"{len(data.codes)} samples at {config.sample_rate_hz:g} Hz, clock {config.clock_hz:g} Hz"
    )
    low, high = int(data.codes.min()) / full_scale, int(data.codes.max()) / full_scale
    clipped = f"{data.clipped} of {data.codes.size} clipped" if data.clipped else "none clipped"
    used = recording.metadata
    scale = "" if "preset" in used else f", {scale_text(used.get('scale', 1 / full_scale))}"
    print(f"samples {low:+.4f}..{high:+.4f} of full scale, {clipped}{scale}")
    print(f"events per taxel: {_at(counts, int(counts.argmin()))} to {_at(counts, int(counts.argmax()))}")


def _at(counts: NDArray[np.int64], index: int) -> str:
    row, column = divmod(index, counts.shape[1])
    return f"{counts[row, column]} (row {row}, column {column})"


@command("Signals to events and back", fuzz="good/events.npz -o new.csv")
def decode(
    source: Path = arg(..., "EVENTS", "event file"),
    out: Path = out_file(..., "FILE", "signals: .npz, .npy or .csv"),
    plot: Path | None = out_file(None, "--plot", "FILE", "file for a plot of signals and events"),
) -> None:
    """Reconstruct the signals of all taxels from an event file."""
    check_samples_path(out)
    if plot is not None:
        check_picture_path(plot)
    recording = Recording.load(source)
    config = recording.config
    signals = decode_recording(recording)
    names, start_s = names_and_start(recording)
    write_samples(out, signals, config.sample_rate_hz, names, start_s)
    if plot is not None:
        title = f"{recording.metadata.get('name', source.stem)}: {config.encoder.title} {config.resolution} b"
        plot_signals(recording.events, signals, config, plot, title, "reconstruction", recording.duration_clocks)
    low, high = (float(signals.min()), float(signals.max())) if signals.size else (0.0, 0.0)
    echo(f"{out}: {signals.shape[0]} ticks of {signals.shape[1]} taxels at {config.sample_rate_hz:g} Hz")
    print(f"from {len(recording.events)} events, {low:+.4f}..{high:+.4f} of full scale")


@command("Signals to events and back", fuzz="good/events.npz good/events.npz")
def compare(
    a: Path = arg(..., "A", "event file"),
    b: Path = arg(..., "B", "event file"),
    plot: Path | None = out_file(None, "--plot", "FILE", "file for a raster plot of both recordings"),
) -> None:
    """Compare two event files; exit code 0 if all events are equal, 1 if not."""
    if plot is not None:
        check_picture_path(plot)
    first, second = Recording.load(a), Recording.load(b)
    labels = (a.name, b.name) if a.name != b.name else (str(a), str(b))
    fields, others = (one.config.to_dict() | {"duration_clocks": one.duration_clocks} for one in (first, second))
    for name, value in fields.items():
        if value != others[name]:
            print(f"{name} differs: {labels[0]} {value}; {labels[1]} {others[name]}")
    difference = first_difference(first.events, second.events)
    if plot is not None:
        duration = max(first.duration_clocks, second.duration_clocks)
        config = covering_config(first.config, second.config)
        plot_comparison((first.events, second.events), config, plot, labels, duration_clocks=duration)
    if difference is None:
        print(f"equal: {len(first.events)} events")
        return
    print(difference.describe(labels))
    _print_counts(first, second, labels)
    raise typer.Exit(1)


def _print_counts(first: Recording, second: Recording, labels: tuple[str, str]) -> None:
    """Print the event counts of taxels with different counts in both files."""
    config = covering_config(first.config, second.config)
    counts = [count_per_taxel(recording.events, config) for recording in (first, second)]
    print(f"\n{labels[0]} has {len(first.events)} events, {labels[1]} {len(second.events)}")
    differing = np.argwhere(counts[0] != counts[1])
    if not len(differing):
        print("every taxel has equally many events in both files")
        return
    print(f"the number of events differs in {len(differing)} of {config.taxels} taxels")
    table = new_table(("row", "column", *labels, "difference"), left=(), overflow="fold")
    for row, column in differing[:_MAX_LINES]:
        n, m = (int(c[row, column]) for c in counts)
        table.add_row(str(row), str(column), str(n), str(m), f"{m - n:+d}")
    if len(differing) > _MAX_LINES:
        table.caption = f"and {len(differing) - _MAX_LINES} more"
    show(table)
