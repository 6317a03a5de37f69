"""The commands rates and frames: events and data rates of textures."""

from typing import Any

from eskin.app.commands import common
from eskin.app.options import check_leaks, command, opt, with_config, with_fields
from eskin.app.tables import CELLS, filled, print_report, print_table, show_facts
from eskin.base.progress import bar
from eskin.base.workers.engine import open_pool
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset
from eskin.skin.textures.rates import PAPER_TAU_S, compare_traffic, measure_rates, published_rate_hz


@command("Power and data rate", fuzz="--dataset good/images --limit 1", idle={"--preset=paper": "--start-row"})
@with_config(fields=("encoding", "resolution", "rows", "columns"))
def rates(
    config: ReadoutConfig,
    given: frozenset[str],
    preset_name: common.Scan = "paper",
    tau: common.Tau = None,
    dataset: common.Textures = None,
    limit: common.Limit = None,
    start_row: list[float] | None = opt(None, "PIXELS", "physical: start row, repeatable [0]"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    as_json: common.Json = False,
) -> None:
    """Measure the mean event rate of the whole array over a dataset."""
    scan = preset(preset_name)
    if tau is not None:
        check_leaks(config)
    if tau is None and not given & {"leak_shift", "leak_period"}:
        tau = PAPER_TAU_S
    config = scan.configure(config, tau)
    textures = open_dataset(dataset).limit(limit)
    with (
        open_pool(workers, scheduler, threads=True) as pool,
        bar("scanning textures", len(textures)) as progress,
    ):
        result = measure_rates(textures, scan, config, start_row or [0.0], pool, progress)
    fields = ("encoding", "resolution", "rows", "columns", "sample_bits", "sample_rate_hz")
    report = {"preset": scan.name, **{name: getattr(config, name) for name in fields}, "dataset": textures.name}
    report |= vars(result) | {"published_rate_hz": published_rate_hz(textures, scan, config)}
    print_report(report, as_json, _print_rates)


def _print_rates(report: dict[str, Any]) -> None:
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


@command("Power and data rate", fuzz="--dataset good/images --limit 1")
@with_config(fields=("resolution", "rows", "columns"), every=True)
@with_fields(FrameConfig, ("word_bits",), "own")
def frames(
    config: ReadoutConfig,
    given: frozenset[str],
    own: dict[str, Any],
    stored: dict[str, Any],
    frame_rate: float | None = opt(None, "HZ", f"frames per second [{ReadoutConfig().sample_rate_hz:g}]"),
    tau: common.Tau = None,
    dataset: common.Textures = None,
    preset_name: common.Scan = "paper",
    limit: common.Limit = None,
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    as_json: common.Json = False,
) -> None:
    """Compare data rate and activity of events and frames on the same scans."""
    scan = preset(preset_name)
    readout = config if frame_rate is None else config.replace(sample_rate_hz=frame_rate)
    frame = FrameConfig(readout=readout, **(stored | own))
    if tau is None and not given & {"leak_shift", "leak_period"}:
        tau = PAPER_TAU_S
    textures = open_dataset(dataset).limit(limit)
    scans = len(registry.NAMES) * len(textures)
    with open_pool(workers, scheduler, threads=True) as pool, bar("scanning textures", scans) as progress:
        report = compare_traffic(textures, scan, config, frame, tau, pool, progress)
    print_report(report, as_json, _print_traffic)


def _print_traffic(report: dict[str, Any]) -> None:
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
        "frames: the frame rate at which frames have the same data rate"
    )
