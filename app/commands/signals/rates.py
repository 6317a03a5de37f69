"""The command rates."""

from __future__ import annotations

import json
from typing import Annotated, Any

from eskin.app.commands.signals.options import JsonOption, LimitOption, ScanOption, TauOption, TexturesOption
from eskin.app.options import check_leaks, opt, with_config
from eskin.app.tables import show_facts
from eskin.app.worker_options import Scheduler, Workers, open_pool
from eskin.base.progress import bar
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset
from eskin.skin.textures.rates import PAPER_TAU_S, measure_rates, published_rate_hz


@with_config(fields=("encoding", "resolution", "rows", "columns"))
def rates(
    config: ReadoutConfig,
    given: frozenset[str],
    preset_name: ScanOption = "paper",
    tau: TauOption = None,
    dataset: TexturesOption = None,
    limit: LimitOption = None,
    start_row: Annotated[list[float] | None, opt("PIXELS", "physical: start row, repeatable [0]")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the mean event rate of the whole array over a dataset."""
    scan = preset(preset_name)
    if tau is not None:
        check_leaks(config)
    if tau is None and not given & {"leak_shift", "leak_period"}:
        tau = PAPER_TAU_S
    config = scan.configure(config, tau)
    textures = open_dataset(dataset)
    if limit is not None:
        textures = textures.limit(limit)
    with (
        open_pool(workers, scheduler, threads=True) as pool,
        bar("scanning textures", len(textures)) as progress,
    ):
        result = measure_rates(textures, scan, config, start_row or [0.0], pool, progress)
    report = {
        "preset": scan.name,
        "encoding": config.encoding,
        "resolution": config.resolution,
        "rows": config.rows,
        "columns": config.columns,
        "sample_bits": config.sample_bits,
        "sample_rate_hz": config.sample_rate_hz,
        "dataset": textures.name,
        **vars(result),
        "published_rate_hz": published_rate_hz(textures, scan, config),
    }
    if as_json:
        print(json.dumps(report))
    else:
        _print_table(report)


def _print_table(report: dict[str, Any]) -> None:
    """Print event rates as a table."""
    rate, published, tau_s = (report[k] for k in ("population_rate_hz", "published_rate_hz", "tau_s"))
    rows = {
        "readout": f"{report['encoding']} {report['resolution']} b"
        + (f", tau {tau_s:.4g} s" if tau_s is not None else ""),
        "array": f"{report['rows']} x {report['columns']} taxels",
        "scan": f"{report['preset']}, {report['scan_s']:.4g} s, {report['sample_rate_hz']:.6g} samples/s",
        "dataset": f"{report['dataset']}, {report['images']} images, {report['scans']} scans",
        "clipped samples": f"{report['clipped_samples']:,}",
        "population rate": f"{rate:,.1f} events/s (standard deviation {report['rate_std_hz']:,.1f})",
    }
    if report["preset"] == "paper" and report["dataset"] != "kylberg":
        rows["population rate"] += f"; of {report['dataset']} images, not the paper's: give those with --dataset"
    if published is not None:
        rows["published"] = f"{published:,.1f} events/s (here {rate / published - 1:+.2%})"
    show_facts(rows)
