"""The commands formal, faults, coverage, properties, crosscheck and crossproof (docs/design/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eskin.app.commands.outcome import conclude, failing_on, make_line
from eskin.app.options import LOGIC, opt, out_file, out_folder, with_config
from eskin.base.errors import InputError
from eskin.base.files import Pieces, atomic_write, pieces_of
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.verify.proofs.plan import Proof


def formal(
    block: Annotated[
        str,
        opt(
            "only this block: arbiter, link, merge, relay, fields, window, taxel, frame_readout, readout, spi, "
            "registers, pattern, classifier"
        ),
    ] = "",
    small: Annotated[bool, opt("only one small configuration of each block")] = False,
    mutants: Annotated[bool, opt("also check that every property fails for generated mutants")] = False,
    limit: Annotated[int, opt("SECONDS", "time limit of one proof", min=1)] = 300,
    out: Annotated[Path | None, out_file("file for the results, JSON")] = None,
) -> None:
    """Prove the properties of every block by property-directed reachability.

    The last line gives the number of proved properties. With --mutants and --out, a stopped search for mutants
    continues. With --block, the file keeps its results for other blocks.
    """
    from eskin.verify.proofs.engine import solve
    from eskin.verify.proofs.run import (
        YOSYS,
        Hunt,
        closing_line,
        earlier,
        hunts,
        judge,
        mutants_line,
        outcomes,
        write,
    )

    chosen, verdicts = _chosen(block, small), []
    if block:
        earlier(out)  # damaged results are refused before the proofs
    for proof in chosen:
        verdicts.append((proof, solve(proof.checker(proof.config), proof.depth, limit)))
        said = verdicts[-1][1]
        print(f"{proof.block:<15}{proof.size:<28}{len(said.proved):>3} proved{said.seconds:>7.1f} s", flush=True)
    results = outcomes(verdicts, whole=not small)
    pieces, found = Pieces(out, YOSYS), list[Hunt]()
    for name in sorted({proof.block for proof in chosen}) if mutants else []:
        of_block = []
        for one in hunts(name, _chosen(name, small=False), pieces):
            print(f"{name:<15}{one.size:<28}{one.killed:>3} of {len(one.mutants)} mutants killed", flush=True)
            of_block.append(one)
        judge([outcome for outcome in results if outcome.block == name], of_block)
        found += of_block
    if out:
        write(results, found, out, make_line("formal", BLOCK=block, SMALL=small, MUTANTS=mutants), block)
        pieces_of(out).unlink(missing_ok=True)
    for outcome in results:
        for problem in outcome.problems:
            print(f"{outcome.block}: {outcome.name}: {problem}")
    if mutants:
        print(mutants_line(results, found))
    print(closing_line([outcome.problems for outcome in results]))
    if any(outcome.problems for outcome in results):
        raise typer.Exit(1)


def faults(
    small: Annotated[bool, opt("only a few readouts, with few bit flips per flop")] = False,
    out: Annotated[Path | None, out_file("file for the results, JSON")] = None,
) -> None:
    """Inject bit flips into every flop, and test hostile inputs.

    Exit code 1 if an effect exceeds the documented ones. With --out, a stopped run continues.
    """
    from eskin.verify.faults.run import campaign, closing_line, write

    done = campaign(small, out, lambda line: print(line, flush=True))
    if out:
        write(out, make_line("faults", SMALL=small), done)
    unlike = any(line["as stated"] < line["runs"] for line in done.cases)
    conclude(done.problems, closing_line(done), mark="", failed=unlike)


def coverage(
    small: Annotated[bool, opt("run only a few simulations")] = False,
    only: Annotated[str, opt("run only simulations whose names begin with this text")] = "",
    out: Annotated[Path, out_folder("folder for the results")] = Path("out/coverage"),
) -> None:
    """Measure the coverage of Verilog and specification by simulations that are compared with the model.

    A stopped run continues with the missing simulations.
    """
    from eskin.verify.coverage.plan import runs
    from eskin.verify.coverage.run import closing_line, judge, play, write
    from eskin.verify.coverage.waivers import waivers

    chosen = [run for run in runs() if (run.small or not small) and run.name.startswith(only)]
    if not chosen:
        raise InputError(f"no run begins with {only!r}; the name of the first run is {runs()[0].name!r}")

    def tell(name: str, total: int, hit: int) -> None:
        print(f"{name:<45}{hit:>6} of {total:<6} constructs", flush=True)

    reached = play(chosen, out, tell)
    verdict = judge(reached, waivers(), whole=not (small or only))
    command = make_line("coverage", SMALL=small, ONLY=only and repr(only))
    write(out / "coverage.json", command, reached, verdict)
    conclude(verdict.problems, closing_line(reached, verdict), mark="")


@with_config(fields=LOGIC)
def properties(config: ReadoutConfig, out: Annotated[Path, out_folder("output folder, created if missing")]) -> None:
    """Write eskin_readout_properties.sv, SystemVerilog assertions bound to the modules of eskin_readout.v."""
    from eskin.verify.proofs.bind import properties as text

    out.mkdir(parents=True, exist_ok=True)
    path = out / "eskin_readout_properties.sv"
    with atomic_write(path) as file:
        file.write(text(config).encode())
    print(path)


@with_config
def crosscheck(
    config: ReadoutConfig,
    texture: Annotated[int, opt("number of the embedded texture", min=0)] = 0,
    ticks: Annotated[int | None, opt("largest number of sample ticks of the scan [all]", min=1)] = None,
    out: Annotated[Path | None, out_file("file for the results, JSON")] = None,
) -> None:
    """Simulate the delivered Verilog in CXXRTL, a third simulator, and lint all files with slang."""
    from dataclasses import asdict

    from eskin.base.files import origin, write_json
    from eskin.verify.crosscheck.check import Mismatch, play, texts

    with failing_on(Mismatch):
        played = play(config, texture, ticks)
    said = [problem for problems in texts(config).values() for problem in problems]
    if out:
        command = make_line("crosscheck", ROWS=config.rows, COLUMNS=config.columns, ENCODING=config.encoding)
        write_json(out, {**origin(command), "config": config.to_dict(), **asdict(played), "slang": said})
    conclude(
        said,
        f"crosscheck: {played.runs} runs, {played.clocks} clocks, {played.events} events in CXXRTL as in the model, "
        f"{played.of_texture} of a texture; slang: {len(said)} problems",
        mark="",
    )


def crossproof(
    block: Annotated[str, opt("only this block, as in make formal")] = "",
    small: Annotated[bool, opt("only one small configuration of each block")] = False,
    mutants: Annotated[bool, opt("compare generated mutants too")] = False,
    out: Annotated[Path | None, out_file("file for the results, JSON")] = None,
) -> None:
    """Repeat the bounded search of make formal with z3, and compare the first clocks of both solvers.

    With --out a stopped run continues.
    """
    from eskin.verify.crosscheck.prove import campaign, closing_line, write

    chosen, found = _chosen(block, small), []
    grounds = [proof for proof in _chosen(block, False) if proof.hunts] if mutants else []
    for one in campaign(chosen, grounds, out):
        found.append(one)
        what = f"{one.block:<15}{one.size:<28}{one.mutant:<80}"
        print(f"{what.rstrip():<45}{one.properties:>3} properties{one.seconds:>7.1f} s", flush=True)
        for problem in one.problems:
            print(f"PROBLEM: {problem}")
    if out:
        write(found, out, make_line("crossproof", BLOCK=block, SMALL=small, MUTANTS=mutants))
    print(closing_line(found))
    if any(one.problems for one in found):
        raise typer.Exit(1)


def _chosen(block: str, small: bool) -> list[Proof]:
    """Return the proofs of one or all blocks, optionally without large configurations."""
    from eskin.verify.proofs.plan import proofs

    known = sorted({proof.block for proof in proofs()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    return [p for p in proofs() if (not block or p.block == block) and (not small or p.small)]
