"""The command study (docs/guide/recordings.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from eskin.app.commands import common
from eskin.app.commands.signals.recordings import named_place
from eskin.app.options import opt
from eskin.app.tables import filled, print_report, print_table
from eskin.base.errors import InputError
from eskin.base.figures.files import DEFAULT_OUT
from eskin.base.progress import bar
from eskin.model.encoders import registry


def study(
    data: Path | None = opt(
        None, "DIR|finger", "class folders of your own recordings [generated slow signals]", callback=named_place
    ),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: common.Out = DEFAULT_OUT,
    as_json: common.Json = False,
) -> None:
    """Compare SNR and data rate of every encoder with uniform sampling at no higher rate, on slow signals."""
    from eskin.skin.figures.study import plot_study
    from eskin.skin.recordings.study import RESOLUTIONS, study_data

    if data is not None and not data.exists():
        raise InputError(f"{data} does not exist; give a folder of class folders, or leave --data out")
    points = len(registry.NAMES) * len(RESOLUTIONS)
    with common.open_pool(workers, scheduler, threads=True) as pool, bar("encoding", points) as progress:
        found = study_data(data, pool, progress)
    common.store(out, "study", found, plot_study, quiet=as_json)
    print_report(found, as_json, _print)


def _print(found: dict[str, Any]) -> None:
    """Print the study of slow signals as a table."""
    print_table(
        "encoder | N | events/s | kbit/s | SNR dB | uniform dB | its bits | its rate/s | clock kHz",
        [point | {"title": registry.named(point["encoding"]).title} for point in found["points"]],
        "{title} | {resolution} | {events_per_s:,.0f} | {data_rate_bps:1e-3*.3g} | {snr_db:.1f}"
        " | {?uniform[snr_db]:.1f} | {?uniform[bits]} | {?uniform[frame_rate_hz]:.3g} | {clock_hz:1e-3*.3g}",
        filled("{source}: {recordings} recordings, {rows} x {columns} taxels, {rate_hz:g} samples/s", found),
        least_width=92,
    )
