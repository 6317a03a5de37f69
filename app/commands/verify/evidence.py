"""The commands formal, coverage and properties (docs/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from eskin.app.commands import common
from eskin.app.options import LOGIC, command, opt, out_file, out_folder, with_config
from eskin.base.errors import InputError
from eskin.base.files import Pieces, atomic_write, origin, pieces_of, write_json
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.verify.proofs.plan import Proof


@command("Checks of the project")
def formal(
    block: str = opt(
        "",
        "only this block: arbiter, link, axi_stream, axi_lite, merge, relay, fields, window, decay, taxel, "
        "frame_readout, readout, spi, registers, host, pattern, classifier",
    ),
    small: bool = opt(False, "only one small configuration of each block"),
    mutants: bool = opt(False, "also check that every property fails for generated mutants"),
    limit: int = opt(300, "SECONDS", "time limit of one proof", min=1),
    out: Path | None = out_file(None, "file for the results, JSON"),
) -> None:
    """Prove the properties of every block by property-directed reachability.

    The last line gives the number of proved properties. With --mutants and --out, a stopped search for mutants
    continues. With --block, the file keeps its results for other blocks.
    """
    from eskin.verify.proofs import run
    from eskin.verify.proofs.engine import solve

    chosen, verdicts = _chosen(block, small), []
    if block:
        run.earlier(out)  # damaged results are refused before the proofs
    for proof in chosen:
        verdicts.append((proof, solve(proof.checker(proof.config), proof.depth, limit)))
        said = verdicts[-1][1]
        print(f"{proof.block:<15}{proof.size:<28}{len(said.proved):>3} proved{said.seconds:>7.1f} s", flush=True)
    results = run.outcomes(verdicts, whole=not small)
    pieces, found = Pieces(out, run.YOSYS), list[run.MutantRun]()
    for name in sorted({proof.block for proof in chosen}) if mutants else []:
        of_block = []
        for one in run.hunts(name, _chosen(name, small=False), pieces):
            print(f"{name:<15}{one.size:<28}{one.killed:>3} of {len(one.mutants)} mutants killed", flush=True)
            of_block.append(one)
        run.judge([outcome for outcome in results if outcome.block == name], of_block)
        found += of_block
    if out:
        run.write(results, found, out, common.make_line("formal", BLOCK=block, SMALL=small, MUTANTS=mutants), block)
        pieces_of(out).unlink(missing_ok=True)
    for outcome in results:
        for problem in outcome.problems:
            print(f"{outcome.block}: {outcome.name}: {problem}")
    if mutants:
        print(run.mutants_line(results, found))
    problems = [outcome.problems for outcome in results]
    common.conclude((), run.closing_line(problems), failed=any(problems))


@command("Checks of the project", needs="sim dev registers")
def coverage(
    small: bool = opt(False, "run only a few simulations"),
    only: str = opt("", "run only simulations whose names begin with this text"),
    out: Path = out_folder(Path("out/coverage"), "folder for the results"),
) -> None:
    """Measure the coverage of Verilog and specification by simulations that are compared with the model.

    A stopped run continues with the missing simulations.
    """
    from eskin.verify.coverage.plan import runs
    from eskin.verify.coverage.run import closing_line, judge, play, summary
    from eskin.verify.coverage.waivers import waivers

    chosen = [run for run in runs() if (run.small or not small) and run.name.startswith(only)]
    if not chosen:
        raise InputError(f"no run begins with {only!r}; the name of the first run is {runs()[0].name!r}")

    def tell(name: str, total: int, hit: int) -> None:
        print(f"{name:<45}{hit:>6} of {total:<6} constructs", flush=True)

    reached = play(chosen, out, tell)
    verdict = judge(reached, waivers(), whole=not (small or only))
    command = common.make_line("coverage", SMALL=small, ONLY=only and repr(only))
    write_json(out / "coverage.json", origin(command) | summary(reached, verdict))
    common.conclude(verdict.problems, closing_line(reached, verdict), mark="")


@command("Checks of the project", variables="OUT=out/verilog")
@with_config(fields=LOGIC)
def properties(config: ReadoutConfig, out: Path = out_folder(..., "output folder, created if missing")) -> None:
    """Write eskin_readout_properties.sv, SystemVerilog assertions bound to the modules of eskin_readout.v."""
    from eskin.verify.proofs.bind import properties as text

    out.mkdir(parents=True, exist_ok=True)
    path = out / "eskin_readout_properties.sv"
    with atomic_write(path) as file:
        file.write(text(config).encode())
    print(path)


def _chosen(block: str, small: bool) -> list[Proof]:
    """Return the proofs of one or all blocks, optionally without large configurations."""
    from eskin.verify.proofs.plan import proofs

    known = sorted({proof.block for proof in proofs()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    return [p for p in proofs() if (not block or p.block == block) and (not small or p.small)]
