"""Options and messages of all commands that read a user's recordings."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from eskin.app.cli import echo
from eskin.app.options import RECORDINGS, opt, option_name, with_fields
from eskin.base.errors import InputError
from eskin.base.progress import bar
from eskin.base.units import counted
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.options import FINGER, Preparation

if TYPE_CHECKING:
    from eskin.skin.recordings.fitting import Fit
    from eskin.skin.recordings.folder import RecordingSet
    from eskin.skin.recordings.quality import Quality

PREPARATION = tuple(field.name for field in dataclasses.fields(Preparation) if field.metadata)
"""Fields of Preparation that are options."""

DEFAULTS = {"baseline": "first of a folder, none of a file", "scale": "max; file without --baseline: none"}
"""Defaults of these options, for a file or for a folder."""


def named_place(given: Path | None) -> Path | None:
    """Return the folder named by the user, or the project's recordings of that name."""
    return FINGER if given == Path(FINGER.name) and not given.exists() else given


OwnData = Annotated[
    Path | None,
    opt(
        ...,
        "--data",
        "DIR|finger",
        "class folders of your own recordings, instead of textures; or finger, the project's own",
        callback=named_place,
    ),
]


def with_preparation(command: Callable[..., Any]) -> Callable[..., Any]:
    """Replace the parameter ``prepared`` of a command by options for reading and scaling recordings."""
    return with_fields(Preparation, PREPARATION, "prepared", {"baseline": "first"}, RECORDINGS)(command)


def check_alone(data: Path | None, prepared: Mapping[str, Any], others: Mapping[str, object]) -> None:
    """Check that options for textures and options for recordings are not mixed."""
    if data is None and prepared:
        raise InputError(f"{option_name(next(iter(prepared)), Preparation)} is for your own recordings; add --data DIR")
    if data is not None and (idle := [option for option, value in others.items() if value is not None]):
        raise InputError(f"{idle[0]} is for textures, --data plays your own recordings; leave one of the two out")


def preparation(prepared: Mapping[str, Any]) -> Preparation:
    """Return the preparation for a folder of recordings."""
    return Preparation(**({"baseline": "first"} | dict(prepared)))


def own_recordings(
    place: Path, prepared: Mapping[str, Any], config: ReadoutConfig, given: Collection[str], again: bool = False
) -> RecordingSet:
    """Return a user's recordings with a suitable configuration, and print a summary unless ``again``."""
    from eskin.skin.recordings.folder import read_set

    if not place.exists():
        raise InputError(f"{place} does not exist; give a folder of class folders, or a recording")
    with bar("reading recordings") as progress:
        found = read_set(place, preparation(prepared), config, given, progress)
    print_set(found, again)
    warn(() if again else found.warnings)
    return found


def events_of(
    place: Path,
    prepared: Mapping[str, Any],
    config: ReadoutConfig,
    given: Collection[str],
    flat: bool = False,
    fit: Fit | None = None,
) -> Path:
    """Return the folder of event files of a user's recordings, encoded if not cached.

    ``flat`` takes recordings without a class too: a file, or a folder of files. ``fit`` as in ``kept_events``.
    """
    from eskin.base.workers.engine import Local
    from eskin.skin.recordings.event_files import kept_events

    splits = preparation(prepared).splits
    if splits and not flat and not prepared.get("label_column") and not place.is_dir():
        raise InputError(f"the parts of {place} have no class; name the column of the class with --label-column")
    if not place.is_dir() and not ((flat or splits) and place.is_file()):
        raise InputError(
            f"{place} is not a folder; give a folder with a sub-folder for each class, or name the column of the "
            f"class with --label-column"
        )
    with Local(threads=True) as pool, bar("reading, comparing settings, encoding") as step:
        folder, notes, warnings = kept_events(
            place, preparation(prepared), config, given, step, pool=pool, flat=flat, fit=fit
        )
    print_notes(notes)
    warn(warnings)
    echo(f"event files of {place}: {folder}")
    return folder


def print_notes(notes: Iterable[str]) -> None:
    """Print notes on the interpretation of the files."""
    for note in notes:
        echo(f"note: {note}")


def warn(warnings: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        echo(f"warning: {warning}", file=sys.stderr)


def print_set(recordings: RecordingSet, again: bool = False) -> None:
    """Print a summary of recordings, unless ``again``, and their configuration."""
    config = recordings.config
    print_notes(() if again else recordings.notes)
    classes = sorted({source.class_name for source in recordings.sources if source.class_name is not None})
    of = (
        f" of {len(classes)} classes ({', '.join(classes[:8])}{', ...' if len(classes) > 8 else ''})" if classes else ""
    )
    if not again:
        echo(f"{recordings.name}: {counted(len(recordings.sources), 'recording')}{of}")
    print(
        f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels at "
        f"{config.sample_rate_hz:g} samples/s, {config.clocks_per_sample} clocks per sample, "
        f"clock {config.clock_hz:g} Hz, {scale_text(recordings.scale)}"
    )


def scale_text(scale: float | Sequence[float]) -> str:
    """Return a text for the scale factor of recordings, or for the scale factor of each taxel."""
    if isinstance(scale, Sequence):
        return f"scale per taxel, {min(scale):.4g} to {max(scale):.4g}"
    return f"scale {scale:.4g}"


def quality_text(quality: Quality) -> str:
    """Return a line with link load, late and merged decisions, SNR and error bound."""
    bound = "holds" if quality.bound_holds else "does not hold"
    return (
        f"link busy {quality.load:.2%}, {quality.peak_load:.0%} at most; {quality.late} events late, "
        f"{quality.merged} decisions merged; reconstruction {quality.snr_db:.1f} dB, the decoder's bound {bound}"
    )
