"""The command frames: data rates of spiking readouts and frame readout on equal scans."""

from __future__ import annotations

import json
from typing import Annotated, Any

from eskin.app.commands.signals.options import JsonOption, LimitOption, ScanOption, TauOption, TexturesOption
from eskin.app.options import opt, with_config, with_fields
from eskin.app.tables import CELLS, filled, print_table
from eskin.app.worker_options import Scheduler, Workers, open_pool
from eskin.base.progress import bar
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset
from eskin.skin.textures.rates import PAPER_TAU_S
from eskin.skin.textures.traffic import compare_traffic


@with_config(fields=("resolution", "rows", "columns"), every=True)
@with_fields(FrameConfig, ("word_bits",), "own")
def frames(
    config: ReadoutConfig,
    given: frozenset[str],
    own: dict[str, Any],
    stored: dict[str, Any],
    frame_rate: Annotated[float | None, opt("HZ", f"frames per second [{ReadoutConfig().sample_rate_hz:g}]")] = None,
    tau: TauOption = None,
    dataset: TexturesOption = None,
    preset_name: ScanOption = "paper",
    limit: LimitOption = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    as_json: JsonOption = False,
) -> None:
    """Compare data rate and activity of events and frames on the same scans."""
    scan = preset(preset_name)
    readout = config if frame_rate is None else config.replace(sample_rate_hz=frame_rate)
    frame = FrameConfig(readout=readout, **(stored | own))
    if tau is None and not given & {"leak_shift", "leak_period"}:
        tau = PAPER_TAU_S
    textures = open_dataset(dataset)
    if limit is not None:
        textures = textures.limit(limit)
    with (
        open_pool(workers, scheduler, threads=True) as pool,
        bar("scanning textures", len(registry.NAMES) * len(textures)) as progress,
    ):
        report = compare_traffic(textures, scan, config, frame, tau, pool, progress)
    if as_json:
        print(json.dumps(report))
    else:
        _print_table(report)


def _print_table(report: dict[str, Any]) -> None:
    """Print data rates as a table, one row per readout."""
    cells = "{title} | {events_per_s:,.0f} | {bits_per_event} | {bits_per_s:,.0f} | {ratio_to_frame:.3g}"
    cells += " | {events_per_taxel_per_s:,.0f} | {equal_frame_rate_hz:,.1f}"
    frame = "frame | {words_per_s:,.0f} | {bits_per_word} | {bits_per_s:,.0f} | 1"
    frame += " | {conversions_per_taxel_per_s:,.0f} | {frame_rate_hz:,.1f}"
    rows = [CELLS.cells(cells, report[encoder.name] | {"title": encoder.title}) for encoder in registry.ENCODERS]
    print_table(
        "readout | sent/s | bits each | bits/s | to frame | taxel/s | frames/s",
        [*rows, CELLS.cells(frame, report["frame"])],
        title=filled(
            "{rows} x {columns} taxels, {resolution} b, tau {tau_s:.3g} s, {dataset} ({preset}), {images} images",
            report,
        ),
    )
    print(
        "sent: events or words; taxel: events or samples of one taxel; "
        "frames: the frame rate at which frames need as many bits"
    )
