"""The command ``frames``: what spiking readouts and frame readout send, on the same scans (docs/reference/frame.md)."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, get_args

import typer

from model.cli.config_options import with_config
from model.cli.crew_options import Scheduler, Workers, open_crew
from model.cli.field_options import with_fields
from model.cli.progress import bar
from model.cli.tables import new_table, show
from model.config import Encoding, ReadoutConfig
from model.errors import InputError
from model.frame_config import FrameConfig
from model.textures.dataset import open_dataset
from model.textures.presets import Scan, preset
from model.textures.rates import PAPER_TAU_S, Rates, measure_rates

READOUTS = {"lcs": "LCS", "cw-lcs": "CW-LCS", "nlcs": "N-LCS"}


def spiking_traffic(config: ReadoutConfig, rates: Rates, frame: FrameConfig) -> dict[str, Any]:
    """Return what a spiking readout sends.

    Parameters
    ----------
    config : ReadoutConfig
    rates : Rates
        Its mean event rate over some scans.
    frame : FrameConfig
        The frame readout beside it.

    Returns
    -------
    dict
        ``events_per_s``, ``bits_per_event``, ``bits_per_s``, ``events_per_taxel_per_s``; ``ratio_to_frame`` of the
        bits; and ``equal_frame_rate_hz``, the frame rate at which frames of the same N need as many bits.
    """
    bits = rates.population_rate_hz * config.event_bits
    return {
        "events_per_s": rates.population_rate_hz,
        "bits_per_event": config.event_bits,
        "bits_per_s": bits,
        "events_per_taxel_per_s": rates.population_rate_hz / config.taxels,
        "ratio_to_frame": bits / frame.bit_rate_hz,
        "equal_frame_rate_hz": bits / (frame.resolution * frame.taxels),
    }


def frame_traffic(frame: FrameConfig) -> dict[str, Any]:
    """Return what the frame readout sends: N bits per taxel and frame, whatever the signal does.

    Returns
    -------
    dict
        ``words_per_s``, ``bits_per_word``, ``bits_per_s`` (samples) and ``word_bits_per_s`` (with the filling of each
        frame's last word), ``conversions_per_taxel_per_s``, ``frame_rate_hz``, ``words_per_frame``, ``clock_hz``.
    """
    return {
        "words_per_s": frame.word_rate_hz,
        "bits_per_word": frame.word_bits,
        "bits_per_s": frame.bit_rate_hz,
        "word_bits_per_s": frame.word_rate_hz * frame.word_bits,
        "conversions_per_taxel_per_s": frame.frame_rate_hz,
        "frame_rate_hz": frame.frame_rate_hz,
        "words_per_frame": frame.words_per_frame,
        "clock_hz": frame.clock_hz,
    }


@with_config(fields=("resolution", "rows", "columns"))
@with_fields(FrameConfig, ("word_bits",), "own")
def frames(
    config: ReadoutConfig,
    given: frozenset[str],
    own: dict[str, Any],
    stored: dict[str, Any],
    frame_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help=f"frames per second [{ReadoutConfig().sample_rate_hz:g}]")
    ] = None,
    tau: Annotated[float | None, typer.Option(metavar="SECONDS", help=f"nlcs: time constant [{PAPER_TAU_S}]")] = None,
    dataset: Annotated[
        str | None,
        typer.Option(metavar="DIR|embedded", help="textures [$ESKIN_DATA, data/kylberg, else embedded]"),
    ] = None,
    preset_name: Annotated[
        str, typer.Option("--preset", metavar="paper|physical", help="constants of the texture scan")
    ] = "paper",
    limit: Annotated[int | None, typer.Option(metavar="K", help="only K images, evenly spread")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Compare events and frames on the same scans: bits per second and activity."""
    scan = preset(preset_name)
    if frame_rate is not None and not (math.isfinite(frame_rate) and frame_rate > 0):
        raise InputError(f"--frame-rate must be a positive number of hertz, not {frame_rate!r}")
    readout = config if frame_rate is None else config.replace(sample_rate_hz=frame_rate)
    frame = FrameConfig(readout=readout, **(stored | own))
    if tau is None and not given & {"leak_shift", "leak_period"}:
        tau = PAPER_TAU_S
    configs = _configurations(config, scan, tau)
    textures = open_dataset(dataset)
    if limit is not None:
        textures = textures.limit(limit)
    with (
        open_crew(workers, scheduler, threads=True) as crew,
        bar("scanning textures", len(configs) * len(textures)) as progress,
    ):
        results = {
            encoding: spiking_traffic(
                config, measure_rates(textures, scan, config, crew=crew, progress=progress), frame
            )
            for encoding, config in configs.items()
        }
    report = {
        "dataset": textures.name,
        "images": len(textures),
        "preset": scan.name,
        "rows": config.rows,
        "columns": config.columns,
        "resolution": config.resolution,
        "tau_s": configs["nlcs"].tau_s,
        **results,
        "frame": frame_traffic(frame),
    }
    if as_json:
        print(json.dumps(report))
    else:
        _print_table(report)


def _configurations(base: ReadoutConfig, scan: Scan, tau_s: float | None) -> dict[str, ReadoutConfig]:
    """Return the configuration of every encoding as a scan wants it."""
    return {
        encoding: scan.configure(base.replace(encoding=encoding), tau_s if encoding == "nlcs" else None)
        for encoding in get_args(Encoding)
    }


def _print_table(report: dict[str, Any]) -> None:
    """Print a report as a table on standard output, a line for each readout."""
    frame = report["frame"]
    title = (
        f"{report['rows']} x {report['columns']} taxels, {report['resolution']} b, tau {report['tau_s']:.3g} s, "
        f"{report['dataset']} ({report['preset']}), {report['images']} images"
    )
    table = new_table(("readout", "sent/s", "bits each", "bits/s", "to frame", "taxel/s", "frames/s"), title)
    for encoding, name in READOUTS.items():
        r = report[encoding]
        table.add_row(
            name,
            f"{r['events_per_s']:,.0f}",
            f"{r['bits_per_event']}",
            f"{r['bits_per_s']:,.0f}",
            f"{r['ratio_to_frame']:.3g}",
            f"{r['events_per_taxel_per_s']:,.0f}",
            f"{r['equal_frame_rate_hz']:,.1f}",
        )
    table.add_row(
        "frame",
        f"{frame['words_per_s']:,.0f}",
        f"{frame['bits_per_word']}",
        f"{frame['bits_per_s']:,.0f}",
        "1",
        f"{frame['conversions_per_taxel_per_s']:,.0f}",
        f"{frame['frame_rate_hz']:,.1f}",
    )
    show(table)
    print(
        "sent: events or words; taxel: events or samples of one taxel; "
        "frames: the frame rate at which frames need as many bits"
    )
