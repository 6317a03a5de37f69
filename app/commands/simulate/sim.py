"""The command sim: run scenarios and texture scans, or a user's recordings, through RTL and model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eskin.app.cli import asked_for, echo
from eskin.app.commands.outcome import bit_exact
from eskin.app.commands.signals.recordings import OwnData, check_alone, own_recordings, warn, with_preparation
from eskin.app.options import opt, out_file, out_folder, with_config
from eskin.base.files import origin, write_json
from eskin.base.progress import bar, bars
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.process import MismatchFound, Tally


@with_config(every=True)
@with_preparation
def sim(
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    data: OwnData = None,
    dataset: Annotated[str | None, opt("texture folder, or 'embedded'")] = None,
    simulator: Annotated[str, opt("--sim", "verilator or icarus")] = "verilator",
    waves: Annotated[bool, opt("write a waveform")] = False,
    textures: Annotated[int, opt("scans or recordings per encoding, from alternating classes")] = 3,
    only: Annotated[str | None, opt("one texture or recording, by name, without scenarios")] = None,
    ticks: Annotated[int | None, opt("largest number of sample ticks per scan [all]")] = None,
    seed: Annotated[int, opt("seed of the scenarios")] = 0,
    dut: Annotated[
        list[Path] | None, opt("Verilog to compare with the model instead of the RTL; may be repeated")
    ] = None,
    top: Annotated[str, opt("module of --dut that has the readout's ports")] = "eskin_readout",
    keep: Annotated[Path | None, out_file("--keep", "JSON file for the totals")] = None,
    out: Annotated[Path, out_folder("folder for pictures and event files")] = Path("out/sim"),
) -> None:
    """Compare RTL and model on test scenarios and texture scans, or on your recordings; exit code 1 if they differ.

    Without an encoding in --encoding or --config, all encoders are compared; with --dut, only LCS.
    """
    from eskin.cocotb_tests.runner.process import Tally

    check_alone(data, prepared, {"--dataset": dataset, "--dut": dut or None})
    alone = "encoding" in given or dut
    encodings: list[str] = [config.encoding] if alone else [*registry.NAMES]
    total = Tally()
    if data is not None:
        for encoding in encodings:
            wanted = config.replace(encoding=encoding)
            _play_own(data, wanted, given, prepared, (simulator, waves, textures, only, ticks, out), total)
    else:
        asked = (simulator, waves, seed, textures, only, ticks, dataset, out)
        _play_textures(config, encodings, asked, dut or [], top, total)
    result = bit_exact(total)
    if keep is not None:
        write_json(keep, origin(asked_for()) | {"result": result})
    print(result)


def _play_textures(
    config: ReadoutConfig,
    encodings: list[str],
    asked: tuple[Any, ...],
    dut: list[Path],
    top: str,
    total: Tally,
) -> None:
    """Run scenarios and scans with each encoding on the RTL or on a user's readout."""
    from eskin.cocotb_tests.runner import sim as session
    from eskin.cocotb_tests.runner.process import MismatchFound

    plan = session.plan(*asked)
    if dut:
        plan = session.with_dut(plan, config, dut, top)
    runs = f"{plan.runs(config) - len(plan.names)} scenarios and {len(plan.names)} scans"
    what = f"{', '.join(map(str, dut)) or 'RTL'}, {config.rows} x {config.columns} taxels, link {config.link}"
    echo(f"{what}: {runs} for each of {', '.join(encodings)}")
    with bars() as show:
        for encoding in encodings:
            chosen = config.replace(encoding=encoding)
            step, say = show(encoding, plan.runs(chosen))
            if warning := plan.warning(chosen):
                warn([f"{chosen.encoding} {chosen.resolution} b, {chosen.rows} x {chosen.columns} taxels: {warning}"])
            try:
                total += session.play(
                    plan,
                    chosen,
                    lambda _, step=step: step(),  # type: ignore[misc]
                    lambda stage, say=say, encoding=encoding: say(f"{encoding}: {stage}"),  # type: ignore[misc]
                )
            except MismatchFound as mismatch:
                wave = plan.waveform(chosen) if plan.waves else None
                hint = session.configuration_hint(chosen) if dut and not (total.runs + mismatch.before.runs) else ""
                _differ(mismatch, total, plan.running(chosen), wave, hint)
            if plan.waves:
                wave = plan.waveform(chosen)
                echo(f"waveform: {wave}; open it with: gtkwave {wave}")
            if picture := plan.picture(chosen):
                echo(f"picture: {picture}; event files: {picture.parent / 'events'}")


def _play_own(
    place: Path,
    config: ReadoutConfig,
    given: frozenset[str],
    prepared: dict[str, Any],
    asked: tuple[str, bool, int, str | None, int | None, Path],
    total: Tally,
) -> None:
    """Run a user's recordings through RTL and model."""
    from eskin.cocotb_tests.runner import sim as session
    from eskin.cocotb_tests.runner.inputs import Own, named
    from eskin.cocotb_tests.runner.process import MismatchFound

    simulator, waves, count, only, ticks, out = asked
    session.check_own(simulator, count, ticks)
    material = Own(own_recordings(place, prepared, config, given, again=total.runs > 0), place)
    names = material.one_class_after_the_other(count) if only is None else [named(material, only)]
    plan = session.Plan(simulator, waves, material, names, ticks, out)  # type: ignore[arg-type]
    config = material.recordings.config
    warn(filter(None, [plan.warning(config)]))
    with bar(f"{config.encoding}: RTL against model", len(names)) as progress:
        try:
            total += session.play(plan, config, lambda _: progress(), lambda stage: None)
        except MismatchFound as mismatch:
            _differ(mismatch, total, plan.running(config))
    echo(f"picture: {plan.picture(config)}; event files: {plan.place(config) / 'events'}")


def _differ(mismatch: MismatchFound, total: Tally, folder: Path, wave: Path | None = None, hint: str = "") -> None:
    """Print the first difference, and where its report is; exit with 1."""
    total += mismatch.before
    print(f"{mismatch}\nMISMATCH; equal runs before it: {total.runs}; report: {folder / 'mismatch.txt'}")
    if wave is not None:
        echo(f"waveform: {wave}; open it with: gtkwave {wave}")
    if hint:
        print(hint)
    raise typer.Exit(1) from None
