"""The command sim: run scenarios and texture scans, or a user's recordings, through RTL and model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from eskin.app.cli import asked_for, echo
from eskin.app.commands import common
from eskin.app.commands.signals.recordings import OwnData, check_alone, own_recordings, warn, with_preparation
from eskin.app.options import command, opt, out_file, out_folder, with_config
from eskin.base.files import origin, write_json
from eskin.base.progress import bars
from eskin.model.cases import axes, cases
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.process import Tally
    from eskin.cocotb_tests.runner.sim import Plan


@command(
    "RTL against model",
    needs="sim",
    fuzz="--only no-such-texture",
    idle={
        "--only": "--seed --textures",
        "--data": "--seed",
        "no --dut": "--top",
    },
)
@with_config(every=True)
@with_preparation
def sim(
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    data: OwnData = None,
    dataset: str | None = opt(None, "texture folder, or 'embedded'"),
    simulator: str = opt("verilator", "--sim", "verilator or icarus"),
    waves: bool = opt(False, "write a waveform"),
    textures: int = opt(3, "scans or recordings per encoding, from alternating classes"),
    only: str | None = opt(None, "one texture or recording, by name, without scenarios"),
    ticks: int | None = opt(None, "largest number of sample ticks per scan [all]"),
    seed: int = opt(0, "seed of the scenarios"),
    dut: list[Path] | None = opt(None, "Verilog to compare with the model instead of the RTL; may be repeated"),
    top: str = opt("eskin_readout", "module of --dut that has the readout's ports"),
    keep: Path | None = out_file(None, "--keep", "JSON file for the totals"),
    out: Path = out_folder(Path("out/sim"), "folder for pictures and event files"),
) -> None:
    """Compare RTL and model on test scenarios and texture scans, or on your recordings; exit code 1 if they differ.

    Without an encoding in --encoding or --config, all encoders are compared; with --dut, only LCS.
    """
    from eskin.cocotb_tests.runner import sim as session
    from eskin.cocotb_tests.runner.inputs import Own, named
    from eskin.cocotb_tests.runner.process import Tally

    check_alone(data, prepared, {"--dataset": dataset, "--dut": dut or None})
    encodings: list[str] = [config.encoding]
    if not ("encoding" in given or dut):
        encodings = [one.encoding for one in cases(config, **axes("encoding"))]
    total = Tally()
    if data is None:
        plan = session.plan(simulator, waves, seed, textures, only, ticks, dataset, out)
        if dut:
            plan = session.with_dut(plan, config, dut, top)
        echo(
            f"{', '.join(map(str, dut or [])) or 'RTL'}, {config.rows} x {config.columns} taxels, link {config.link}: "
            f"{plan.runs(config) - len(plan.names)} scenarios and {len(plan.names)} scans for each of "
            f"{', '.join(encodings)}"
        )
        configs = [config.replace(encoding=encoding) for encoding in encodings]
        with bars() as show, session.built_ahead(plan, configs if not dut else ()) as wait:
            for one in configs:
                _play(plan, one, show, total, bool(dut), wait)
    else:
        session.check_own(simulator, textures, ticks)
        for encoding in encodings:
            wanted = config.replace(encoding=encoding)
            material = Own(own_recordings(data, prepared, wanted, given, again=total.runs > 0), data)
            names = material.one_class_after_the_other(textures) if only is None else [named(material, only)]
            plan = session.Plan(simulator, waves, material, names, ticks, out)  # type: ignore[arg-type]
            with bars() as show:
                _play(plan, material.recordings.config, show, total)
    result = common.bit_exact(total)
    if keep is not None:
        write_json(keep, origin(asked_for()) | {"result": result})
    print(result)


def _play(
    plan: Plan,
    config: ReadoutConfig,
    show: Any,
    total: Tally,
    foreign: bool = False,
    wait: Callable[[ReadoutConfig], None] = lambda config: None,
) -> None:
    """Run scenarios, scans or recordings on the RTL or on a user's readout; exit with 1 at the first difference."""
    from eskin.cocotb_tests.runner import sim as session
    from eskin.cocotb_tests.runner.process import MismatchFound

    step, say = show(config.encoding, plan.runs(config))
    if warning := plan.warning(config):
        if plan.material.preset:
            warning = f"{config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels: {warning}"
        warn([warning])
    wave = plan.waveform(config) if plan.waves else None
    equal = True
    covered: list[str] = []

    def finished(run: dict[str, Any]) -> None:
        step()
        covered.extend([run["covered"]] if "covered" in run else [])

    try:
        total += session.play(plan, config, finished, lambda stage: say(f"{config.encoding}: {stage}"), wait)
    except MismatchFound as mismatch:
        equal = False
        total += mismatch.before
        report = plan.running(config) / "mismatch.txt"
        print(f"{mismatch}\nMISMATCH; equal runs before it: {total.runs}; report: {report}")
    for line in covered:
        echo(line)
    if wave is not None:
        echo(f"waveform: {wave}; open it with: gtkwave {wave}")
    if not equal:
        if foreign and not total.runs:
            print(session.configuration_hint(config))
        raise typer.Exit(1)
    if picture := plan.picture(config):
        echo(f"picture: {picture}; event files: {picture.parent / 'events'}")
