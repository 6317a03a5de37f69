"""Options and words that all commands on a user's own recordings share."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from model.recordings.options import Preparation

if TYPE_CHECKING:
    from model.recordings.folder import RecordingSet
    from model.recordings.quality import Quality

PREPARATION = tuple(field.name for field in dataclasses.fields(Preparation))
"""Fields of Preparation, all of which are options."""


def print_notes(notes: Iterable[str]) -> None:
    """Print what was taken for what."""
    for note in notes:
        print(f"note: {note}")


def warn(warnings: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)


def print_set(recordings: RecordingSet) -> None:
    """Print what a set of recordings is and the configuration that suits it."""
    config = recordings.config
    print_notes(recordings.notes)
    classes = sorted({source.class_name for source in recordings.sources if source.class_name is not None})
    of = (
        f" of {len(classes)} classes ({', '.join(classes[:8])}{', ...' if len(classes) > 8 else ''})" if classes else ""
    )
    print(f"{recordings.name}: {len(recordings.sources)} recordings{of}")
    print(
        f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels at "
        f"{config.sample_rate_hz:g} samples/s, {config.clocks_per_sample} clocks per sample, "
        f"clock {config.clock_hz:g} Hz, scale {recordings.scale:.4g}"
    )


def quality_text(quality: Quality) -> str:
    """Return load, late and merged decisions, SNR and bound in one line."""
    bound = "holds" if quality.bound_holds else "does not hold"
    return (
        f"link busy {quality.load:.2%}, {quality.peak_load:.0%} at most; {quality.late} events late, "
        f"{quality.merged} decisions merged; reconstruction {quality.snr_db:.1f} dB, the decoder's bound {bound}"
    )
