"""Read a folder of recordings with a sub-folder for each class, and encode them with one configuration."""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.inputs import check_no_others, find_files
from eskin.base.workers.engine import Local, Pool, each
from eskin.model.address_events import Events
from eskin.model.config import MAX_SIDE, ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.readers.registry import SUFFIXES
from eskin.skin.recordings.columns import match_columns, only_taxels
from eskin.skin.recordings.fitting import Fit, other_leak, steepest_step, with_clock, with_seconds
from eskin.skin.recordings.options import Preparation, Scale
from eskin.skin.recordings.prepare import Prepared, prepare
from eskin.skin.recordings.quality import MUCH_LATE, Quality, encoded, pooled
from eskin.skin.recordings.table import Table, read_table, text_of
from eskin.skin.recordings.windows import Part, parts_of
from eskin.skin.samples import array_of

LOW_SNR_DB = 10.0  # reconstruction SNR below which an LCS readout is worth a warning


@dataclass(frozen=True)
class Source:
    """One recording file of a set, with its class."""

    path: Path
    name: str  # path relative to the folder, without its ending: equal file names in two classes stay apart
    class_name: str | None  # first folder below the set's; None for a file by itself
    group: str = ""  # recordings of one group are never in different folds; empty: the recording alone

    def part(self, part: Part) -> Source:
        """Return the source of a part of this recording."""
        group = part.group if part.group and not part.group.startswith("part ") else f"{self.name} {part.group}".strip()
        return Source(self.path, f"{self.name}@{part.name}", part.label or self.class_name, group)


@dataclass(frozen=True, eq=False)
class RecordingSet:
    """Recordings as codes, with their common configuration."""

    name: str  # of the folder or file
    sources: tuple[Source, ...]
    codes: list[NDArray[np.int32]]  # in the order of the sources, each of shape (ticks, taxels)
    config: ReadoutConfig
    options: Preparation  # that made the codes
    scale: Scale
    clipped: int  # samples beyond full scale
    notes: tuple[str, ...]  # interpretation of the files
    warnings: tuple[str, ...]  # problems, each with the option that fixes it
    columns: tuple[str, ...] = ()  # names of the taxels, if the files have them
    shaped: bool = False  # the files give rows and columns of the array
    starts_s: Mapping[str, float] = field(default_factory=dict)  # first time stamp in seconds by source, if any
    scores: Sequence[dict[str, Any]] = ()  # of all settings that were compared

    def recording(self, number: int) -> tuple[Recording, Quality]:
        """Return the events of a recording from the cycle-accurate model, and their quality."""
        return self._named(number, *encoded(self.config, self.codes[number]))

    def each_recording(self, pool: Pool | None = None) -> Iterator[tuple[Source, Recording, Quality]]:
        """Yield events and quality of every recording in order, computed by a worker pool."""
        found = each(pool or Local(1), encoded, ((self.config, codes) for codes in self.codes))
        for number, (events, quality) in enumerate(found):
            yield self.sources[number], *self._named(number, events, quality)

    def _named(self, number: int, events: Events, quality: Quality) -> tuple[Recording, Quality]:
        source = self.sources[number]
        metadata = {"name": source.name, "source": source.path.name, "model": "cycle", "dataset": self.name}
        metadata |= {"input": "recording"} | self.said_of(source)
        clocks = len(self.codes[number]) * self.config.clocks_per_sample
        return Recording(events, self.config, clocks, metadata=metadata), quality

    def said_of(self, source: Source) -> dict[str, Any]:
        """Return the metadata for an event file; they suffice to prepare other recordings equally."""
        scale = list(self.scale) if isinstance(self.scale, tuple) else self.scale
        said: dict[str, Any] = {"scale": scale, "prepared": self.options.chosen()}
        said |= {"columns": list(self.columns)} if self.columns else {}
        said |= {"start_s": self.starts_s[source.name]} if source.name in self.starts_s else {}
        said |= {"group": source.group} if source.group else {}
        return said | ({} if source.class_name is None else {"class": source.class_name})


def sources_of(folder: Path, flat: bool = False, strict: bool = False) -> tuple[tuple[Source, ...], tuple[str, ...]]:
    """Return the recording files of class folders ordered by name, or a single file.

    With ``flat``, files may be beside the class folders, and have no class. The second value is warnings: on unreadable
    entries with the name of a recording, which ``strict`` refuses, and on folders without a recording.

    Raise InputError if there are no recordings, or one is beside the class folders.
    """
    if not folder.is_dir():
        return (Source(folder, folder.stem, None),), ()
    found = []
    paths, others = find_files(folder, SUFFIXES)
    if others and strict:
        raise InputError(
            f"{len(others)} recordings of {folder} cannot be read: {others[0]}; fetch or remove them, or leave them "
            f"out with --no-strict"
        )
    for path in paths:
        parts = path.relative_to(folder).parts
        if len(parts) < 2 and not flat:
            raise InputError(f"{path} is beside the class folders; move it into the folder of its class")
        found.append(
            Source(path, path.relative_to(folder).with_suffix("").as_posix(), parts[0] if len(parts) > 1 else None)
        )
    if not found:
        raise InputError(
            f"{folder} contains no recordings; put files ending in {', '.join(SUFFIXES)} into a folder for each class"
        )
    names = [source.name for source in found]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{folder} holds {twice} twice, with two endings; remove one of them")
    warnings = [f"{len(others)} recordings of {folder} cannot be read and are left out: {', '.join(others[:4])}"]
    inside = sorted(one.name for one in folder.iterdir() if one.is_dir() and not one.name.startswith("."))
    empty = [name for name in inside if name not in {source.class_name for source in found}]
    warnings = warnings * bool(others) + [f"folder {folder / name} contains no recording" for name in empty]
    return tuple(found), tuple(warnings)


def read_set(
    place: Path,
    options: Preparation,
    config: ReadoutConfig,
    given: Collection[str] = (),
    progress: Callable[[], object] | None = None,
    flat: bool = False,
    fit: Fit | None = None,
) -> RecordingSet:
    """Return the recordings of a folder or file, with a suitable configuration.

    - ``place``: folder of class folders, or a file.
    - ``given``: fields of ``config`` that the user set; of the others, array, rate, clock and time constants follow the
      recordings. With ``scale`` among them, that of ``options`` is not changed.
    - ``progress``: called after each file.
    - ``flat``: as for ``sources_of``.
    - ``fit``: chooses encoder, resolution and scale from recordings, where these are not given.
    """
    sources, left_out = sources_of(place, flat or options.splits, options.strict)
    rate_hz = config.sample_rate_hz if "sample_rate_hz" in given else None
    taxels = config.taxels if {"rows", "columns"} & set(given) else None
    tables, options, notes = _tables_of(sources, options, rate_hz, taxels, flat, progress)
    pieces = _pieces_of(sources, tables, options, config.sample_bits, rate_hz)
    sources, tau_s = _in_groups(pieces.sources, options.group_name), fit.tau_s if fit else None
    classes = [str(source.class_name) for source in sources]
    groups = [source.group or source.name for source in sources]
    learned = fit.learned([source.name for source in sources], classes, groups) if fit else range(len(sources))
    files = sorted({pieces.files[number] for number in learned})
    tried = {
        one: prepare(tables, one, config.sample_bits, rate_hz, files)
        for one in (fit.variants(options, given, len(learned)) if fit else (options,))
    }
    prepared, scores = tried[options], list[dict[str, Any]]()
    config = _with_array(config, tables[0], given)
    config = with_seconds(config.replace(sample_rate_hz=prepared.rate_hz), given, tau_s)
    if fit and (len(tried) > 1 or not {"encoding", "resolution"} <= set(given)):
        codes = {one: [every[n] for n in learned] for one, made in tried.items() for every in [pieces.cut(made)]}
        kinds, of = ([every[n] for n in learned] for every in (classes, groups))
        levels = {one: made.levels(config.sample_bits) for one, made in tried.items()}
        config, chosen, note, scores = fit.choose(config, given, kinds, of, codes, levels, progress or (lambda: None))
        prepared = tried[chosen]
        notes += (note,) if note else ()
    codes_of_all = pieces.cut(prepared)
    if "clocks_per_sample" not in given:
        config = with_clock(config, codes_of_all)
    leak = other_leak(config, given) if tau_s is None else ()
    return RecordingSet(
        name=place.resolve().name if place.is_dir() else place.stem,
        sources=sources,
        codes=codes_of_all,
        config=config,
        options=prepared.options,
        scale=prepared.scale,
        clipped=prepared.clipped,
        notes=(*notes, *pieces.notes, *prepared.notes, *leak),
        warnings=(*left_out, *prepared.warnings, *negative_part_lost(config, codes_of_all)),
        columns=tables[0].names if tables[0].named else (),
        shaped=tables[0].shape is not None,
        starts_s=pieces.starts_s,
        scores=scores,
    )


def _tables_of(
    sources: Sequence[Source],
    options: Preparation,
    rate_hz: float | None,
    taxels: int | None,
    flat: bool,
    progress: Callable[[], object] | None,
) -> tuple[list[Table], Preparation, tuple[str, ...]]:
    """Return the recordings of files with the same taxels, the options that choose these again, and notes."""
    tables = []
    for source in sources:
        tables.append(read_table(source.path, options, rate_hz, needs_labels=not flat))
        if progress is not None:
            progress()
    tables, options = match_columns(tables, options)
    notes = tuple(dict.fromkeys(note for table in tables for note in table.notes))
    if options.taxel_columns:
        return tables, options, notes
    tables, no_taxels = only_taxels(tables, taxels)
    if no_taxels:  # other recordings get the same columns
        names = tables[0].names
        options = dataclasses.replace(options, taxel_columns=text_of(names), names=names if options.names else ())
    return tables, options, (*notes, *no_taxels)


@dataclass(frozen=True)
class _Pieces:
    """Parts of files, each of which is a recording; by default each file is one part."""

    sources: tuple[Source, ...]
    files: list[int]  # number of each source's file
    parts: list[list[Part]]  # of each file
    starts_s: Mapping[str, float]
    notes: tuple[str, ...]

    def cut(self, prepared: Prepared) -> list[NDArray[np.int32]]:
        """Return the codes of each source."""
        pairs = zip(prepared.codes, self.parts, strict=True)
        return [codes[part.begin : part.end] for codes, found in pairs for part in found]


def _pieces_of(
    sources: Sequence[Source], tables: Sequence[Table], options: Preparation, bits: int, rate_hz: float | None
) -> _Pieces:
    if not options.splits:
        starts_s = {s.name: t.start_s for s, t in zip(sources, tables, strict=True) if t.time_s is not None}
        whole = [[Part(0, sys.maxsize, None, "", "")] for _ in tables]
        return _Pieces(tuple(sources), list(range(len(sources))), whole, starts_s, ())
    prepared = prepare(tables, options, bits, rate_hz)
    parts, notes = parts_of(tables, [len(codes) for codes in prepared.codes], prepared.rate_hz, options)
    found = [(n, source.part(part)) for n, source in enumerate(sources) for part in parts[n]]
    return _Pieces(tuple(source for _, source in found), [n for n, _ in found], parts, {}, notes)


def _in_groups(sources: Sequence[Source], pattern: str) -> tuple[Source, ...]:
    """Return recordings with the group that a regular expression finds in their names."""
    if not pattern:
        return tuple(sources)
    found = [re.search(pattern, source.name) for source in sources]
    if None in found:
        raise InputError(f"--group-name {pattern!r} does not match {sources[found.index(None)].name}")
    return tuple(
        dataclasses.replace(source, group=match.group())
        for source, match in zip(sources, found, strict=True)
        if match is not None
    )


def _with_array(config: ReadoutConfig, table: Table, given: Collection[str]) -> ReadoutConfig:
    """Return the configuration with an array for the taxels of a recording, after checking a user's array."""
    taxels, shape = table.values.shape[1], table.shape
    if shape is not None and not {"rows", "columns"} & set(given) and max(shape) <= MAX_SIDE:
        return config.replace(rows=shape[0], columns=shape[1])
    if {"rows", "columns"} & set(given) or config.taxels == taxels:
        if config.taxels != taxels:
            array = f"{config.rows} x {config.columns} = {config.taxels}"
            raise InputError(
                f"{table.path} has {taxels} taxels, but the array has {array}; give --rows and --columns, or "
                f"neither, or choose columns with --taxel-columns"
            )
        return config
    if (size := array_of(taxels)) is None:
        raise InputError(
            f"{taxels} taxels do not fill an array of at most 64 rows and 64 columns; choose fewer with --taxel-columns"
        )
    return config.replace(rows=size[0], columns=size[1])


def negative_part_lost(config: ReadoutConfig, recordings: Sequence[NDArray[np.int32]]) -> list[str]:
    """Return a warning about negative signals that an encoder without OFF events cannot represent."""
    if config.has_polarity:
        return []
    seen = sum(int((codes > 0).sum()) for codes in recordings)
    below = sum(int((codes < -config.step).sum()) for codes in recordings)
    if below <= 0.2 * (seen + below):
        return []
    return [
        f"{below / (seen + below):.0%} of the signal is below zero, which {config.encoder.title} cannot represent; "
        f"invert the sign with a negative --scale FACTOR, choose another --baseline, or --encoding lcs"
    ]


def write_folder(
    recordings: RecordingSet, out: Path, pool: Pool | None = None, progress: Callable[[], object] | None = None
) -> tuple[Quality, tuple[str, ...]]:
    """Write the event file ``OUT/class/name.npz`` for every recording.

    Return the quality of all recordings together, and warnings with the options that fix the problems. The result does
    not depend on the pool. ``progress`` is called after each file.

    Raise InputError if the folder contains other event files, or cannot be made.
    """
    paths = [out / f"{source.name}.npz" for source in recordings.sources]
    check_no_others(out, paths)
    parts = []
    for path, (_, recording, quality) in zip(paths, recordings.each_recording(pool), strict=True):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make the folder {path.parent}: {error.strerror}; choose another --out") from None
        recording.save(path)
        parts.append(quality)
        if progress is not None:
            progress()
    total = pooled(parts)
    return total, quality_warnings(recordings.config, recordings.codes, total)


def quality_warnings(
    config: ReadoutConfig, recordings: list[NDArray[np.int32]], quality: Quality, chosen: bool = False
) -> tuple[str, ...]:
    """Return a warning for each kind of loss in a readout, with the option that avoids the loss.

    No warning advises against resolution and scale if the program has ``chosen`` them.
    """
    warnings = []
    more = f"raise --clocks-per-sample above {config.clocks_per_sample}, or leave it out"
    if not quality.events:
        mend = "check --baseline" if chosen else "raise --scale or --resolution, or check --baseline"
        warnings.append(f"no taxel sends an event; {mend}")
    elif quality.late + quality.merged > MUCH_LATE * quality.expected:
        warnings.append(
            f"the link is too slow: {quality.late} of {quality.expected} events are late, {quality.merged} decisions "
            f"merged; {more}"
        )
    if quality.events and 2 * len(quality.silent) > config.taxels:
        mend = "" if chosen else "--scale per-taxel scales each taxel by its own range; "
        warnings.append(
            f"{len(quality.silent)} of {config.taxels} taxels send no event; {mend}--taxel-columns leaves columns out"
        )
    step, limit = steepest_step(config, recordings)
    if step > limit:
        mend = "--decide-every clock" if config.decide_every == "sample" else more
        warnings.append(
            f"steps of {step} codes from sample to sample are beyond the {limit:.0f} of the decoder's bound; {mend}"
        )
    elif not quality.bound_holds and not (quality.late or quality.merged):
        warnings.append(
            "the reconstruction exceeds the decoder's bound, because a taxel that waits for the link looks like one "
            "whose window has closed; choose --encoding lcs"
            if config.encoder.windowed
            else "the reconstruction exceeds the decoder's bound; lower --scale"
        )
    if quality.events and not chosen and config.has_polarity and quality.snr_db < LOW_SNR_DB:
        warnings.append(f"the reconstruction has {quality.snr_db:.1f} dB; raise --resolution or --scale")
    return tuple(warnings)
