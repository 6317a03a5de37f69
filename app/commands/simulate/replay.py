"""The commands replay and touch: a whole dataset, or all recordings of a user, through RTL and model."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.cli import asked_for, echo
from eskin.app.commands import common
from eskin.app.commands.signals.recordings import OwnData, check_alone, own_recordings, warn, with_preparation
from eskin.app.options import command, opt, out_file, out_folder, with_config
from eskin.base.files import origin, write_json
from eskin.base.outputs import has_earlier
from eskin.base.progress import bars, reported
from eskin.base.shapes import read_shaped
from eskin.base.workers.engine import open_pool
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import EMBEDDED

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.replay import Plan
    from eskin.cocotb_tests.touch.plan import Plan as TouchPlan

MAX_LINES = 20  # largest number of printed answers
KEPT = {"runs": [{"configuration": {"encoding": str}}]}
"""Shape of the file of --keep."""


@command(
    "RTL against model",
    needs="sim",
    fuzz="--dataset good/images --only no-such-texture",
    idle={
        "--preset=paper": "--sample-rate --decide-every --reference-reset --start-row",
        "--only": "--limit",
    },
)
@with_config
@with_preparation
def replay(
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    dataset: str | None = opt(None, "texture folder, or 'embedded' [$ESKIN_DATA, data/kylberg, ...]"),
    data: OwnData = None,
    preset: str | None = opt(None, "physical or paper [physical]"),
    start_row: float | None = opt(None, "image row where the array starts (physical) [0]"),
    limit: int | None = opt(None, "number of textures or recordings, evenly spread [all]"),
    only: str | None = opt(None, "only one texture or recording, by name"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    keep: Path | None = out_file(
        None, "--keep", "JSON file for the totals of this encoder; the file keeps the totals of other encoders"
    ),
    out: Path = out_folder(Path("out/replay"), "folder for the event files"),
) -> None:
    """Run a whole dataset or your recordings through RTL and model, compare every event, and store the events.

    A stopped run continues with the missing recordings.
    """
    from eskin.cocotb_tests.runner import replay as session
    from eskin.cocotb_tests.runner.inputs import Own, chosen
    from eskin.cocotb_tests.runner.process import MismatchFound
    from eskin.cocotb_tests.runner.simulator import require_programs

    check_alone(data, prepared, {"--dataset": dataset, "--preset": preset, "--start-row": start_row})
    with open_pool(workers, scheduler, session.NEEDS, threads=True) as pool, bars() as show:
        if data is not None:
            require_programs("verilator")
            material = Own(own_recordings(data, prepared, config, given), data)
            plan = session.Plan(material.recordings.config, material, chosen(material, limit, only), out)
        else:
            plan = session.plan_textures(config, dataset, preset or "physical", start_row or 0.0, limit, only, out)
        print(f"building {plan.array} for Verilator", file=sys.stderr)
        with reported(f"building {plan.array}"):
            missing = plan.missing()
        started = time.monotonic()
        step, _ = show(f"{plan.material.name}, {plan.config.encoding} {plan.config.resolution} b", len(missing))
        with common.failing_on(MismatchFound, line="MISMATCH"):
            total = session.play(plan, missing, pool, step)
    now = {"clocks": total.clocks, "seconds": round(time.monotonic() - started, 1), "workers": pool.workers}
    _conclude(plan, len(missing), now, keep)


def _conclude(plan: Plan, played: int, now: dict[str, Any], keep: Path | None) -> None:
    """Write and print the totals of all recordings; exit with 1 if recordings are missing or no event occurred."""
    from eskin.cocotb_tests.runner.replay import summarise

    summary, count = summarise(plan), len(plan.names)
    if (absent := summary.pop("missing")) or not summary["events"]:
        common.fail(f"FAILED: {absent} of {count} recordings are missing, {summary['events']} events")
    noun = "images" if plan.material.preset else "recordings"
    summary["played_now"] = {noun: played} | now
    summary["configuration"] = plan.config.to_dict()
    write_json(plan.folder / "summary.json", summary)
    if keep is not None:
        kept = read_shaped(keep, "the kept sums", KEPT)["runs"] if has_earlier(keep) else []
        runs = {run["configuration"]["encoding"]: run for run in [*kept, origin(asked_for()) | summary]}
        write_json(keep, {"runs": list(runs.values())})
    echo(f"events per {noun[:-1]}: {plan.events}; played now: {played} {noun} in {now['seconds']:.0f} s")
    print(f"bit-exact: {count} runs, {summary['clocks']} clocks, {summary['events']} events, 0 mismatches")


@command("RTL against model", needs="sim", fuzz="--only no-such-texture", idle={"--only": "--limit"})
def touch(
    weights: Path | None = opt(
        None, "integer network, or a folder with one for each fold [the project's own; --data: from eskin quantise]"
    ),
    dataset: str | None = opt(None, "texture folder, or 'embedded' [embedded]"),
    data: OwnData = None,
    limit: int | None = opt(None, "number of textures or recordings, evenly spread [all]", min=1),
    only: str | None = opt(None, "only one texture or recording, by name"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: Path = out_folder(Path("out/touch"), "folder for results and picture"),
) -> None:
    """Run textures or your recordings through the RTL of readout and classifier, and compare with the models.

    Every image is classified by a network that was not trained on this image. A stopped run continues with the
    missing images.
    """
    from eskin.cocotb_tests.runner import replay
    from eskin.cocotb_tests.runner.process import MismatchFound
    from eskin.cocotb_tests.touch import plan as session

    check_alone(data, {}, {"--dataset": dataset})
    plan = session.plan(weights, data, dataset or EMBEDDED, limit, only, out)
    if only is None and limit is None and (learned := len(plan.material.names) - len(plan.names)):
        print(f"{learned} left out, because every network was trained on them")
    used = plan.networks[plan.names[0]]
    if data is not None and weights is None:
        echo(f"network: {used.path}, trained on {used.notes.dataset}")
    known = used.weights.class_names
    folders = {name.split("/")[0] for name in plan.material.names if "/" in name}
    if data is not None and (others := sorted(folders - set(known))):
        warn([f"the network has the classes {', '.join(known)}; it was not trained on {', '.join(others)}"])
    with open_pool(workers, scheduler, replay.NEEDS, threads=True) as pool, bars() as show:
        print("building the chip for Verilator", file=sys.stderr)
        with reported("building the chip"):
            missing = [name for name in plan.names if plan.finished(name) is None]
        started = time.monotonic()
        step, _ = show(f"{plan.material.name}: samples to class", len(missing))
        with common.failing_on(MismatchFound, line="MISMATCH"):
            session.play(plan, pool, step)
    now = {"images": len(missing), "seconds": round(time.monotonic() - started, 1), "workers": pool.workers}
    _conclude_touch(plan, now, "images" if data is None else "recordings")


def _conclude_touch(plan: TouchPlan, now: dict[str, Any], noun: str) -> None:
    """Write and print the totals of all results; exit with 1 if results are missing or no event occurred."""
    from eskin.cocotb_tests.touch.picture import draw
    from eskin.cocotb_tests.touch.plan import summarise
    from eskin.snn.figures.over_time import over_time, plot_over_time, write_over_time

    summary = summarise(plan)
    if summary["missing"] or not summary["events"]:
        common.fail(f"FAILED: {summary['missing']} results are missing, {summary['events']} events")
    summary = origin(plan.repeat_command) | summary | {"played_now": now}
    for name, answer in list(summary["answers"].items())[:MAX_LINES]:
        judged = "" if answer["true"] is None else ", right" if answer["class"] == answer["true"] else ", wrong"
        echo(f"{name}: {answer['class']}{judged}{common.early_text(answer)}")
    if (more := len(summary["answers"]) - MAX_LINES) > 0:
        print(f"... and {more} more, in summary.json")
    write_json(plan.folder / "summary.json", summary)
    picture = draw(plan, summary, plan.folder / "touch.png")
    if summary["float_known"]:
        print(f"float network: {summary['right_float']} of {summary['float_known']} right")
    if "right_early" in summary:
        print(
            f"early decisions: {summary['right_early']} of {summary['labelled']} right after "
            f"{summary['early_share']:.0%} of the bins on average; {summary['decided']} reached the margin"
        )
    print(
        f"the classifier stalled the readout in {summary['stalls'] / summary['clocks']:.1%} of the clocks, which "
        f"changed {summary['images'] - summary['as_ideal_bins']} classes; {summary['overruns']} scans with an overrun; "
        f"at most {summary['latency_clocks']} clocks from bin end to class"
    )
    echo(f"answers: {plan.folder / 'summary.json'}" + (f"; picture: {picture}" if picture else ""))
    windows = over_time(
        [a | {"name": n, "predicted": a["class"], "class": a["true"]} for n, a in summary["answers"].items()]
    )
    if windows:
        table, drawn = plan.folder / "over_time.csv", plan.folder / "over_time.png"
        write_over_time(windows, table)
        plot_over_time(windows, plan.networks[plan.names[0]].weights.class_names, drawn)
        echo(f"classes over time: {table}, {drawn}")
    judged = f"{summary['right']} right" if summary["labelled"] else "true classes not known"
    print(
        f"touch to class: {summary['images']} {noun}, {summary['events']} events, {summary['mismatches']} mismatches, "
        f"{judged}"
    )
