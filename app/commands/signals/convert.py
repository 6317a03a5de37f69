"""The command convert (docs/guide/events.md)."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eskin.app.cli import echo
from eskin.app.options import arg, command, opt, option_name, out_file, with_config
from eskin.base.errors import InputError
from eskin.base.figures.style import check_picture_path
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.figures.raster import plot_signals

KINDS = (".npz", ".aedat4", ".nir", ".npy", ".csv")


@command("Signals to events and back", needs="events", fuzz="good/events.npz -o new.npy")
@with_config
def convert(
    config: ReadoutConfig,
    given: frozenset[str],
    source: Path = arg(
        ..., "EVENTS", "event file .npz, AEDAT 4, NIRData, table or array of events, or a folder of such"
    ),
    out: Path = out_file(
        ...,
        "FILE",
        "event file .npz, .aedat4, .nir, .npy, .csv; folder: a folder",
        when=lambda given: given["source"].is_dir(),
    ),
    address_map: Path | None = opt(None, "--map", "FILE", "foreign events: taxel of each address, a .csv"),
    fields: str | None = opt(None, "A,B,...", "table: names of its columns: t, x, y, p, address, or - to skip"),
    time_unit: str | None = opt(None, "--time-unit", "s|ms|us|ns|clocks", "table: unit of its times"),
    start: str | None = opt(None, "TIME", "foreign events: time that becomes clock 0 [0; folder: the first event]"),
    wrap: int | None = opt(None, "BITS", "foreign events: bits of a time counter that wraps"),
    sort: bool = opt(False, "--sort", "foreign events: sort them by time"),
    drop_unmapped: bool = opt(False, "--drop-unmapped", "foreign events: drop addresses that --map lacks"),
    plot: Path | None = out_file(None, "--plot", "FILE", "file for a raster plot of the events"),
    bin_s: float | None = opt(
        None, "--bin", "SECONDS", "for .nir output: write event counts per time bin, not single events"
    ),
    unit: str | None = opt(None, "us|clocks", "to .npy or .csv: unit of the times [us]"),
) -> None:
    """Convert events from and to formats of other programs: AEDAT 4, NIRData, tables and arrays.

    A folder of foreign events becomes a folder of event files of one readout, for train --events.
    """
    from eskin.skin.foreign.files import is_foreign

    if not source.is_dir():
        _check_output(out, bin_s, unit)
    elif plot or bin_s or unit:
        raise InputError("--plot, --bin and --unit are for a single file; leave them out for a folder")
    if plot is not None:
        check_picture_path(plot)
    begin = None if start is None else _time(start)
    foreign = {"--map": address_map, "--fields": fields, "--time-unit": time_unit, "--start": begin, "--wrap": wrap}
    foreign |= {"--sort": sort or None, "--drop-unmapped": drop_unmapped or None}
    foreign |= {option_name(name): True for name in sorted(given)}
    if source.is_dir():
        _convert_folder(source, config, given, foreign, out)
        return
    if is_foreign(source):
        (recording,) = _taken([source], config, given, foreign)
        if not len(recording.events):
            raise InputError(f"{source} has no event; nothing was written to {out}")
    else:
        if unused := [option for option, value in foreign.items() if value is not None]:
            raise InputError(
                f"{unused[0]} is for foreign events; {source.name} contains its own readout, so leave the option out"
            )
        from eskin.snn.exchange.nir_events import load_recording

        recording = load_recording(source)
    note = _write(out, recording, bin_s, unit)
    echo(f"{out}: {len(recording.events)} events in {recording.duration_s:.6g} s")
    if note:
        print(note)
    if plot is not None:
        end = recording.duration_clocks
        plot_signals(recording.events, None, recording.config, plot, source.name, duration_clocks=end)
        echo(f"raster: {plot}")


def _time(text: str) -> float:
    """Return a time, whole if it is: nanoseconds since 1970 have more digits than a float."""
    try:
        return int(text)
    except ValueError:
        pass
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise InputError(f"--start takes a time in the unit of the file, not {text!r}")
    return int(found) if found.is_integer() else found


def _check_output(out: Path, bin_s: float | None, unit: str | None) -> None:
    if out.suffix not in KINDS:
        raise InputError(f"events are written as {', '.join(KINDS)}, not {out.name}; rename the output")
    if bin_s is not None and out.suffix != ".nir":
        raise InputError(f"--bin is only for .nir, not for {out.name}; leave it out")
    if unit is not None and out.suffix not in (".npy", ".csv"):
        raise InputError(f"--unit is only for .npy and .csv, not for {out.name}; leave it out")
    if unit not in (None, "us", "clocks"):
        raise InputError(f"--unit must be us or clocks, not {unit!r}")


def _convert_folder(
    source: Path, config: ReadoutConfig, given: frozenset[str], options: Mapping[str, Any], out: Path
) -> None:
    from eskin.base.inputs import check_no_others, find_files
    from eskin.skin.foreign.files import SUFFIXES, is_foreign

    inside, others = find_files(source, (*SUFFIXES, ".npz"))
    files = [file for file in inside if is_foreign(file)]
    if others or not files:
        raise InputError(others[0] if others else f"{source} holds no events of other programs ({', '.join(SUFFIXES)})")
    places = [out / file.relative_to(source).with_suffix(".npz") for file in files]
    if len(set(places)) < len(places):
        twice = next(place for place in places if places.count(place) > 1)
        raise InputError(f"two files of {source} would become {twice}; rename one of them")
    check_no_others(out, places)
    recordings = _taken(files, config, given, options, own_start=True)
    for place, recording in zip(places, recordings, strict=True):
        place.parent.mkdir(parents=True, exist_ok=True)
        recording.save(place)
    count, array = sum(len(one.events) for one in recordings), recordings[0].config
    size = f"{array.rows} x {array.columns} taxels"
    echo(f"{out}: {len(files)} event files, {count} events, {size}; train on them with --events {out}")


def _taken(
    sources: Sequence[Path],
    config: ReadoutConfig,
    given: frozenset[str],
    options: Mapping[str, Any],
    own_start: bool = False,
) -> list[Recording]:
    """Return recordings converted from foreign files; print assumptions and losses.

    With ``own_start`` clock 0 is the first event of each file, unless the options say another time.
    """
    from eskin.skin.foreign.address_map import AddressMap
    from eskin.skin.foreign.events import configuration, in_order, take, unwrapped
    from eskin.skin.foreign.files import read_foreign

    path, columns, wrap, start = (options[name] for name in ("--map", "--fields", "--wrap", "--start"))
    mapping = AddressMap.read(path) if path else None
    if options["--drop-unmapped"] and mapping is None:
        raise InputError("--drop-unmapped leaves out addresses that a map lacks; add --map FILE")
    names = columns.split(",") if columns else ()
    read = [read_foreign(source, names, options["--time-unit"] or None) for source in sources]
    if wrap:
        read = [unwrapped(events, wrap) for events in read]
    if options["--sort"]:
        read = [in_order(events) for events in read]
    found = [configuration(events, config, given, mapping) for events in read]
    chosen = found[0].replace(rows=max(one.rows for one in found), columns=max(one.columns for one in found))
    recordings, said = [], dict[str, int]()
    for source, events in zip(sources, read, strict=True):
        begin = events.time[0].item() if own_start and start is None and len(events.time) else start
        metadata = {"name": source.stem, "source": source.name}
        try:
            taken = take(events, chosen, mapping, bool(options["--drop-unmapped"]), begin, metadata)
        except InputError as error:
            raise (InputError(f"{source}: {error}") if own_start else error) from None
        lines = taken.said()[1:] if own_start and start is None and taken.start else taken.said()
        for line in (*events.notes, *lines):
            said[line] = said.get(line, 0) + 1
        recordings.append(taken.recording)
    for line, times in said.items():
        echo(line if len(sources) == 1 else f"{times} of {len(sources)} files: {line}")
    units = ", ".join(sorted({events.unit for events in read}))
    print(
        f"array of {chosen.rows} rows x {chosen.columns} columns, clock {chosen.clock_hz:g} Hz, times in {units}; "
        f"--rows, --columns, --sample-rate and --clocks-per-sample change array and clock"
    )
    return recordings


def _write(out: Path, recording: Recording, bin_s: float | None, unit: str | None) -> str:
    """Write a recording in the format of the file suffix; return a warning about losses, or an empty text."""
    if out.suffix == ".npz":
        recording.save(out)
        return ""
    if out.suffix == ".aedat4":
        from eskin.skin.foreign.aedat4 import write_aedat4

        return write_aedat4(out, recording)
    if out.suffix == ".nir":
        from eskin.snn.data.bins import BinConfig
        from eskin.snn.exchange.nir_events import save_nir_data

        save_nir_data(out, recording, None if bin_s is None else BinConfig(bin_s=bin_s))
        return ""
    from eskin.skin.foreign.tables import write_events_table

    return write_events_table(out, recording, unit or "us")
