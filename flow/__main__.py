"""``python -m flow``: proofs of the RTL, properties for others' tools, and what becomes of it in gates."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flow.scale.wire import FARAD_PER_UM, OHM_PER_UM, PITCH_UM, SIZES, Wire
from model.cli.app import make_app, run
from model.cli.config_options import with_config
from model.cli.field_options import with_fields
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import atomic_write
from model.frame_config import OWN_FIELDS, FrameConfig

if TYPE_CHECKING:
    from flow.formal.mutants import Mutant
    from flow.mutants.judge import Finding

app = make_app("Design flow of the readout: proofs of its RTL, and its netlist.")


@app.command()
def formal(
    block: Annotated[
        str,
        typer.Option(
            help="only this block: arbiter, link, merge, relay, window, taxel, frame_readout, readout, spi, registers, "
            "pattern"
        ),
    ] = "",
    small: Annotated[bool, typer.Option(help="only one small configuration of each block")] = False,
    mutants: Annotated[bool, typer.Option(help="plant bugs too, and see the properties fail")] = False,
    limit: Annotated[int, typer.Option(min=1, metavar="SECONDS", help="most that one proof may take")] = 300,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="file for the results, JSON")] = None,
) -> None:
    """Prove the properties of every block; the last line says how many hold."""
    from flow.formal.engine import solve
    from flow.formal.plan import proofs
    from flow.formal.report import write
    from flow.formal.run import closing_line, judge, outcomes

    known = sorted({proof.block for proof in proofs()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    chosen = [p for p in proofs() if (not block or p.block == block) and (not small or p.small)]
    verdicts = []
    for proof in chosen:
        verdicts.append((proof, solve(proof.checker(proof.config), proof.depth, limit)))
        said = verdicts[-1][1]
        print(f"{proof.block:<15}{proof.size:<28}{len(said.proved):>3} proved{said.seconds:>7.1f} s", flush=True)
    results = outcomes(verdicts, whole=not small)
    command = f"make formal{' MUTANTS=1' if mutants else ''}"
    if out:
        write(results, out, command)
    for name in sorted({proof.block for proof in chosen}) if mutants else []:
        judge([outcome for outcome in results if outcome.block == name], _hunt(name))
        if out:  # kept block by block: all of them take a quarter of an hour
            write(results, out, command)
    for outcome in results:
        for problem in outcome.problems:
            print(f"{outcome.block}: {outcome.property.name}: {problem}")
    print(closing_line(results))
    if any(outcome.problems for outcome in results):
        raise typer.Exit(1)


@app.command()
def faults(
    small: Annotated[bool, typer.Option(help="only a few readouts, and few upsets of each flop")] = False,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="file for the results, JSON")] = None,
) -> None:
    """Turn every flop over, one at a time, and meet hostile surroundings; with --out it goes on where it was stopped.

    Exit code 1 if more breaks than is stated.
    """
    from flow.faults.run import campaign, closing_line, write

    done = campaign(small, out, lambda line: print(line, flush=True))
    for problem in done.problems:
        print(problem)
    if out:
        write(out, f"make faults{' SMALL=1' if small else ''}", done)
    print(closing_line(done))
    if done.problems or any(line["as stated"] < line["runs"] for line in done.cases):
        raise typer.Exit(1)


@app.command()
def coverage(
    small: Annotated[bool, typer.Option(help="only a few runs")] = False,
    only: Annotated[str, typer.Option(help="runs whose names begin so")] = "",
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for what is found")] = Path("out/coverage"),
) -> None:
    """Count what runs that are held to the models reach, of Verilog and specification; goes on where it was stopped."""
    from flow.coverage.plan import runs
    from flow.coverage.run import closing_line, judge, play, write
    from flow.coverage.waivers import waivers

    chosen = [run for run in runs() if (run.small or not small) and run.name.startswith(only)]
    if not chosen:
        raise InputError(f"no run begins with {only!r}; one of them is {runs()[0].name!r}")

    def tell(name: str, total: int, hit: int) -> None:
        print(f"{name:<45}{hit:>6} of {total:<6} constructs", flush=True)

    reached = play(chosen, out, tell)
    verdict = judge(reached, waivers(), whole=not (small or only))
    for problem in verdict.problems:
        print(problem)
    command = " ".join(["make coverage", *["SMALL=1"] * small, *([f"ONLY={only!r}"] if only else [])])
    write(out / "coverage.json", command, reached, verdict)
    print(closing_line(reached, verdict))
    if verdict.problems:
        raise typer.Exit(1)


@app.command()
@with_config
def properties(
    config: ReadoutConfig,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder to write to, made if need be")],
) -> None:
    """Write eskin_readout_properties.sv: the properties as assertions, bound to the modules of eskin_readout.v."""
    from flow.formal.bind import properties as text

    out.mkdir(parents=True, exist_ok=True)
    path = out / "eskin_readout_properties.sv"
    with atomic_write(path) as file:
        file.write(text(config).encode())
    print(path)


@app.command()
def mutants(
    block: Annotated[str, typer.Option(help="only this block: arbiter, link, window, taxel, ...")] = "",
    share: Annotated[float, typer.Option(min=0.0, max=1.0, help="share of all edits that is tried")] = 0.36,
    seed: Annotated[int, typer.Option(min=0, help="of the edits that are drawn")] = 1,
    again: Annotated[bool, typer.Option(help="judge anew what the quick check left: tests are new")] = False,
    limit: Annotated[int | None, typer.Option(min=1, help="mutants at most [all]")] = None,
    judging: Annotated[bool, typer.Option("--judge/--no-judge", help="judge, or report what was found")] = True,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for what is found")] = Path("out/mutants"),
) -> None:
    """Mutate the RTL's source, and see which mutants the tests and proofs kill; goes on where it was stopped."""
    from flow.mutants.campaign import chosen, closing_line, summary, write
    from flow.mutants.campaign import run as judge
    from flow.mutants.plan import GROUNDS

    known = sorted({ground.block for ground in GROUNDS.values()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    picked = chosen({block} if block else known, share, seed)[:limit]
    command = " ".join(["make mutants", *([f"BLOCK={block}"] if block else []), f"SHARE={share:g} SEED={seed}"])
    print(f"{len(picked)} edits drawn with SEED={seed}")

    def tell(finding: Finding) -> None:
        print(f"{finding.verdict:<11}{'quick' if finding.quick else '':<6}{finding.name}", flush=True)

    found = judge(picked, out, seed, tell, again, judging)
    write(out / "mutants.json", command, summary(found, len(picked)))
    print(closing_line(found, len(picked)))
    if len(found) < len(picked) or any(finding.verdict == "alive" for finding in found):
        raise typer.Exit(1)


@app.command()
def model_mutants(
    share: Annotated[float, typer.Option(min=0.0, max=1.0, help="share of all places that is tried")] = 0.07,
    seed: Annotated[int, typer.Option(min=0, help="of the edits that are drawn")] = 1,
    again: Annotated[bool, typer.Option(help="judge anew what is alive: tests are new")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for what is found")] = Path("out/mutants"),
) -> None:
    """Mutate a sample of places of model/ and snn/, each before the tests of its file; goes on where it was stopped."""
    from flow.mutants.campaign import OF_MODEL, write
    from flow.mutants.model.sampled import closing_line, drawn, judge, summary

    picked, places = drawn(share, seed)
    print(f"{len(picked)} edits drawn with SEED={seed}, of {sum(places.values())} places")
    found = judge(picked, out, again, lambda finding: print(f"{finding.verdict:<8}{finding.name}", flush=True))
    write(
        out / "mutants.json",
        f"make mutants MODEL=1 SHARE={share:g} SEED={seed}",
        summary(found, len(picked), places),
        OF_MODEL,
    )
    print(closing_line(found, len(picked)))
    if any(finding.verdict == "alive" for finding in found):
        raise typer.Exit(1)


@app.command()
@with_config
def crosscheck(
    config: ReadoutConfig,
    texture: Annotated[int, typer.Option(min=0, help="number of the embedded texture")] = 0,
    ticks: Annotated[int | None, typer.Option(min=1, help="sample ticks of the scan at most [all]")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="file for the results, JSON")] = None,
) -> None:
    """Play the delivered Verilog in CXXRTL, a third simulator, against the model, and lint all texts with slang."""
    from dataclasses import asdict

    from flow.cross.check import Mismatch, play, texts
    from model.files import origin, write_json

    try:
        played = play(config, texture, ticks)
    except Mismatch as wrong:
        print(wrong)
        raise typer.Exit(1) from None
    said = [problem for problems in texts(config).values() for problem in problems]
    for problem in said:
        print(problem)
    if out:
        command = f"make crosscheck ROWS={config.rows} COLUMNS={config.columns} ENCODING={config.encoding}"
        write_json(out, {**origin(command), "config": config.to_dict(), **asdict(played), "slang": said})
    print(
        f"crosscheck: {played.runs} runs, {played.clocks} clocks, {played.events} events in CXXRTL as in the model, "
        f"{played.of_texture} of a texture; slang: {len(said)} problems"
    )
    if said:
        raise typer.Exit(1)


@app.command()
@with_config
def gatesim(
    config: ReadoutConfig,
    lib: Annotated[Path, typer.Option(help="cell library (.lib) of the netlist")],
    simulator: Annotated[str, typer.Option("--sim", help="icarus or verilator")] = "icarus",
    waves: Annotated[bool, typer.Option(help="leave a waveform")] = False,
    seed: Annotated[int, typer.Option(help="seed of the scenarios")] = 0,
    textures: Annotated[int, typer.Option(help="scans of the encoding, one class after the other")] = 1,
    only: Annotated[str | None, typer.Option(help="one texture, by its name, and no scenarios")] = None,
    ticks: Annotated[int | None, typer.Option(help="sample ticks of a scan at most [all]")] = None,
    dataset: Annotated[str | None, typer.Option(help="texture folder, or 'embedded'")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for netlist, pictures, events")] = Path("out/gates"),
) -> None:
    """Hold the gated netlist to the model, as make sim does the RTL; exit code 1 if they differ or reset leaves X."""
    from cocotb_tests.session import sim as session
    from cocotb_tests.session.session import MismatchFound
    from flow.gates.sim import play, prepare

    plan = session.plan(simulator, waves, seed, textures, only, ticks, dataset, out)
    gates = prepare(config, lib, out)
    print(gates.netlist, gates.cells, sep="\n")
    unknown = gates.unknown
    if not unknown.clean:
        left = [*unknown.in_reset, *unknown.after, *unknown.outputs]
        print(f"UNKNOWN after reset with all inputs unknown: {len(left)} of {unknown.flops} flops, {left[:3]}")
        raise typer.Exit(1)
    print(f"known from reset on, all inputs unknown: {unknown.flops} flops")
    try:
        tally = play(plan, gates, config, f"GATES=1 LIB={lib}", lambda stage: print(f"{config.encoding}: {stage}"))
    except MismatchFound as mismatch:
        print(f"{mismatch}\nMISMATCH; log: {plan.running(config)}")
        raise typer.Exit(1) from None
    if not tally.events or not tally.drained:
        print(f"FAILED: {tally.events} events were compared, {tally.drained} runs left nothing outstanding")
        raise typer.Exit(1)
    print(f"bit-exact: {tally.runs} runs, {tally.clocks} clocks, {tally.events} events, 0 mismatches")


@app.command()
@with_config
@with_fields(FrameConfig, OWN_FIELDS, "own")
def asic(
    config: ReadoutConfig,
    own: dict[str, Any],
    stored: dict[str, Any],
    lib: Annotated[Path, typer.Option(help="cell library (.lib) at the typical corner")],
    slow: Annotated[Path | None, typer.Option(help="the same cells at the slow corner")] = None,
    fast: Annotated[Path | None, typer.Option(help="the same cells at the fast corner")] = None,
    readout: Annotated[str, typer.Option(metavar="spiking|frame", help="which readout")] = "spiking",
    name: Annotated[str, typer.Option(help="of the run and its folder [made of the configuration]")] = "",
    power: Annotated[bool, typer.Option(help="idle power and energies too, by simulation of the netlist")] = True,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder of the run's folder")] = Path("out/asic"),
) -> None:
    """Make a gated netlist of a cell library, prove and check it, and say what it costs; exit code 1 if a check fails.

    OUT/NAME gets the netlist, its constraints (.sdc) and report.json.
    """
    from flow.asic import report
    from flow.power.measure import APART

    if readout not in ("spiking", "frame"):
        raise InputError(f"--readout must be one of spiking, frame, not {readout!r}")
    own = stored | own
    if own and readout != "frame":
        raise InputError(f"--{next(iter(own)).replace('_', '-')} belongs to the frame readout; add --readout frame")
    if name != Path(name).name or name.startswith("."):
        raise InputError(f"--name must be the plain name of a folder, not {name!r}")
    chosen = FrameConfig(readout=config, **own) if readout == "frame" else config
    corners = {"typical": lib} | {corner: at for corner, at in (("slow", slow), ("fast", fast)) if at}
    found = report.run(chosen, corners, name, lambda stage: print(stage, flush=True), power)
    print(found.write(out, report.command_of(chosen, corners, power)))
    proof = found.equivalence
    print(f"equivalent to the RTL: {proof.proved} of {proof.of} points proved")
    if apart := found.more.get("with_wires", {}).get(APART):
        print(f"no power with wires: {apart}")
    _conclude(found.problems, found.closing_line())


@app.command()
@with_config(fields=("encoding", "resolution", "frontend", "sample_bits"), file=False)
def asic_scale(
    config: ReadoutConfig,
    lib: Annotated[Path, typer.Option(help="cell library (.lib)")],
    sizes: Annotated[str, typer.Option(metavar="RxC,...", help="rows and columns of the arrays")] = SIZES,
    tiles: Annotated[str, typer.Option(metavar="RxC,...", help="cut each array into tiles, with their merge")] = "",
    relays: Annotated[str, typer.Option(metavar="N,...", help="relay stations between each tile and the merge")] = "",
    pitch_um: Annotated[float, typer.Option("--pitch", min=0.0, metavar="UM", help="of the taxels")] = PITCH_UM,
    ohm: Annotated[float, typer.Option(min=0.0, metavar="PER_UM", help="resistance of a wire")] = OHM_PER_UM,
    farad: Annotated[float, typer.Option(min=0.0, metavar="PER_UM", help="capacitance of a wire")] = FARAD_PER_UM,
    out: Annotated[Path, typer.Option("-o", "--out", help="file for the results, JSON")] = Path("out/asic/scale.json"),
) -> None:
    """Estimate area and highest clock as the array grows, with wires of its size and repeaters in them."""
    from flow.asic.library import read
    from flow.scale.measure import designs_of, measure
    from model.cli.tables import new_table, show

    chosen, library = designs_of(config, sizes, tiles, relays), read(lib)
    heads = (
        "taxels",
        "tiles",
        "relays",
        "um2 a taxel",
        "with lines",
        "MHz without wires",
        "MHz with wires",
        "repeaters",
        "synthesis, s",
    )
    table = new_table(heads, "Area and highest clock as the array grows")
    out.parent.mkdir(parents=True, exist_ok=True)
    measure(chosen, library, Wire(ohm, farad), pitch_um, out, lambda found: table.add_row(*_scale_row(found)))
    show(table)
    print(out)


def _scale_row(result: dict[str, Any]) -> list[str]:
    """Return a line of the table of an array."""
    without, wired = result["without_wires"], result["with_wires"]
    tiles = f"{result['tile_rows']} x {result['tile_columns']}" if "relays" in result else ""
    return [
        f"{result['rows']} x {result['columns']}",
        tiles,
        f"{result.get('relays', '')}",
        f"{result['cells_um2_per_taxel']:.0f}",
        f"{wired['area_um2_per_taxel']:.0f}",
        f"{without['fmax_hz'] / 1e6:.0f}",
        f"{wired['fmax_hz'] / 1e6:.0f}",
        f"{wired['repeaters']}",
        f"{result['synthesis_s']:.1f}",
    ]


@app.command()
@with_config
def power(
    config: ReadoutConfig,
    lib: Annotated[list[Path], typer.Option(help="cell library (.lib), once for each")],
    three: Annotated[bool, typer.Option("--three", help="analog LCS, N-LCS and frames of this array instead")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for the results, JSON")] = Path("out/gatepower"),
) -> None:
    """Power of gated netlists from what they do in simulation, without and with wires, computed in two ways."""
    from flow.asic.report import words_of
    from flow.power.bench import Mismatch
    from flow.power.measure import Disagreement
    from flow.power.results import designs, write
    from model.cli.tables import new_table, show
    from model.files import origin

    chosen: dict[str, ReadoutConfig | FrameConfig] = {str(config.encoding): config}
    if three:
        chosen = designs(config)
    words = [*(f"LIB={path.name}" for path in lib), *words_of(config), *["THREE=1"] * three]
    heads = ("readout", "library", "wires", "idle nW", "leakage nW", "pJ an event", "lone", "texture", "OpenSTA/tables")
    table = new_table(heads, "Power of the logic: per taxel, and per event beside that")
    said = origin(" ".join(["make gatepower", *words]))
    try:
        for path in lib:
            write(chosen, path, out, said, lambda result: table.add_row(*_power_row(result)))
    except (Disagreement, Mismatch) as wrong:
        print(wrong)
        raise typer.Exit(1) from None
    show(table)


@app.command()
@with_config
def layout(
    config: ReadoutConfig,
    name: Annotated[str, typer.Option(help="of the run and its folder [made of the configuration]")] = "",
    compare: Annotated[bool, typer.Option(help="compare the netlist in the layout with the cells' too")] = True,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder of the run's folder")] = Path("out/layout"),
) -> None:
    """Lay a readout out in SkyWater 130 nm rules and check it; exit code 1 if a check fails.

    OUT/NAME gets GDS, DEF, a picture and report.json. Needs KLayout and the packages that make layout installs.
    """
    from flow.layout import report, run
    from flow.layout.cells import WrongCell
    from flow.layout.environment import Crashed

    if name != Path(name).name or name.startswith("."):
        raise InputError(f"--name must be the plain name of a folder, not {name!r}")
    try:
        found = run.run(config, name, out, compare, lambda stage: print(stage, flush=True))
    except (WrongCell, Crashed) as wrong:
        print(wrong)
        raise typer.Exit(1) from None
    print(report.write(found, out, report.command_of(config, compare)))
    _conclude(found.problems, found.closing_line())


@app.command()
def fpga(
    board: Annotated[
        str, typer.Option(help="ulx3s (the one with 85 k LUTs), ulx3s-45f, ulx3s-25f, ulx3s-12f")
    ] = "ulx3s",
    weights: Annotated[
        Path | None, typer.Option(help="integer network whose chip is built [the embedded textures', fold 0]")
    ] = None,
    receiver: Annotated[bool, typer.Option("--receiver", help="the receiver of a foreign chip's AER instead")] = False,
    alone: Annotated[
        int | None,
        typer.Option(
            metavar="BITS", min=2, max=8, help="only the classifier 128-256-6, weights of BITS, on an ECP5-25"
        ),
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder of the board's folder")] = Path("out/fpga"),
) -> None:
    """Make a bitstream for a board, and say what it takes and how fast it is; exit code 1 below 50 MHz.

    OUT/BOARD gets eskin_board.bit and report.json. The same design gives the same bytes.
    """
    from flow.fpga import report
    from flow.fpga.build import build, build_classifier, design_of
    from model.files import origin

    if sum((receiver, weights is not None, alone is not None)) > 1:
        raise InputError("--weights, --receiver and --alone each say what is built; give one of them")
    if alone is not None:
        name, built = f"classifier-{alone}b", build_classifier(report.plain_classifier(alone))
        said = {"design": "classifier"} | origin(f"make fpga ALONE={alone}")
        aims = report.classifier_aims(built, alone)
    else:
        config = design_of(weights, receiver)
        name, built = board, build(config, board)
        words = [f"BOARD={board}"] + ([f"WEIGHTS={weights.name}"] if weights else []) + ["RECEIVER=1"] * receiver
        said = {"design": config.design, "identity": f"{config.identity:08x}"} | origin(" ".join(["make fpga", *words]))
        aims = [report.clock_aim(built)]
    print(report.write(out, name, built, said, aims))
    for aim in aims:
        print(aim)
    print(report.closing_line(name, built))
    if not aims[0].met:
        raise typer.Exit(1)


def _power_row(result: dict[str, Any]) -> list[str]:
    """Return a line of the table of a result."""
    energies = [result.get(f"energy_per_{name}event_j") for name in ("", "lone_", "texture_")]
    ratios = [stretch["agreement"] for stretch in result["scenarios"].values()]
    return [
        f"{result['readout']} {result['frontend']}".strip(),
        result["process"],
        "estimated" if result["pitch_um"] else "none",
        f"{1e9 * result['idle_w_per_taxel']:.1f}",
        f"{1e9 * result['leakage_w_per_taxel']:.1f}",
        *("" if energy is None else f"{1e12 * energy:.2f}" for energy in energies),
        f"{min(ratios):.3f} to {max(ratios):.3f}",
    ]


def _hunt(block: str) -> Iterator[tuple[Mutant, set[str]]]:
    """Plant the bugs of a block; print a line for each."""
    from flow.formal.plan import proofs
    from flow.formal.run import hunt

    for mutant, failed in hunt(block, proofs()):
        print(f"{block:<15}{mutant.name:<45}{len(failed):>3} fail", flush=True)
        yield mutant, failed


def _conclude(problems: list[str], line: str) -> None:
    """Print the problems and the closing line; leave with 1 if there are any."""
    for problem in problems:
        print(f"PROBLEM: {problem}")
    print(line)
    if problems:
        raise typer.Exit(1)


def main() -> None:
    """Run the command line of the design flow."""
    run(app, "python -m flow")


if __name__ == "__main__":
    main()
