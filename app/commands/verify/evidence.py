"""The commands formal, coverage and properties (docs/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from eskin.app.commands import common
from eskin.app.options import LOGIC, command, opt, out_file, out_folder, with_config
from eskin.base.errors import InputError
from eskin.base.files import atomic_write, origin, write_json
from eskin.base.workers.engine import open_pool
from eskin.base.workers.store import Store
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
    small: bool = opt(False, "only small configurations, at least one of each block"),
    mutants: bool = opt(False, "also check that every property fails for generated mutants"),
    limit: int = opt(300, "SECONDS", "time limit of one proof", min=1),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: Path | None = out_file(None, "file for the results, JSON"),
) -> None:
    """Prove the properties of every block by property-directed reachability.

    The last line gives the number of proved properties. With --out, a stopped run continues, and a later run proves
    only what has changed. With --block, the file keeps its results for other blocks.
    """
    from eskin.verify.proofs import run

    chosen, verdicts = _chosen(block, small), []
    if block:
        run.earlier(out)  # damaged results are refused before the proofs
    store, found = Store(out, run.YOSYS), list[run.MutantRun]()
    with open_pool(workers, scheduler, run.NEEDS) as pool:
        for proof, said in run.verdicts(chosen, limit, pool, store):
            print(f"{proof.block:<15}{proof.size:<28}{len(said.proved):>3} proved{said.seconds:>7.1f} s", flush=True)
            verdicts.append((proof, said))
        blocks = {proof.block for proof in chosen}
        hunting = [proof for proof in _chosen("", small=False) if proof.block in blocks]
        for one in run.hunts(hunting, pool, store) if mutants else ():
            print(f"{one.block:<15}{one.size:<28}{one.killed:>3} of {len(one.mutants)} mutants killed", flush=True)
            found.append(one)
    results = run.outcomes(verdicts, whole=not small)
    found.sort(key=lambda one: one.block)
    for name in sorted(blocks) if mutants else ():
        run.judge([outcome for outcome in results if outcome.block == name], [m for m in found if m.block == name])
    if out:
        run.write(results, found, out, common.make_line("formal", BLOCK=block, SMALL=small, MUTANTS=mutants), block)
    for outcome in results:
        for problem in outcome.problems:
            print(f"{outcome.block}: {outcome.name}: {problem}")
    if mutants:
        print(run.mutants_line(results, found))
    problems = [outcome.problems for outcome in results]
    if small:
        print(f"small: {len(chosen)} of {len(_chosen(block, small=False))} configurations")
    common.conclude((), run.closing_line(problems), failed=any(problems))


@command("Checks of the project", needs="sim dev registers")
def coverage(
    small: bool = opt(False, "run only a few simulations"),
    only: str = opt("", "run only simulations whose names begin with this text"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: Path = out_folder(Path("out/coverage"), "folder for the results"),
) -> None:
    """Measure the coverage of Verilog and specification by simulations that are compared with the model.

    A stopped run continues with the missing simulations.
    """
    from eskin.verify.coverage.plan import runs
    from eskin.verify.coverage.run import NEEDS, closing_line, judge, play, summary
    from eskin.verify.coverage.waivers import waivers

    chosen = [run for run in runs() if (run.small or not small) and run.name.startswith(only)]
    if not chosen:
        raise InputError(f"no run begins with {only!r}; the name of the first run is {runs()[0].name!r}")

    def tell(name: str, total: int, hit: int) -> None:
        print(f"{name:<45}{hit:>6} of {total:<6} constructs", flush=True)

    with open_pool(workers, scheduler, NEEDS) as pool:
        reached = play(chosen, out, pool, tell)
    verdict = judge(reached, waivers(), whole=not (small or only))
    command = common.make_line("coverage", SMALL=small, ONLY=only and repr(only))
    write_json(out / "coverage.json", origin(command) | summary(reached, verdict))
    if len(chosen) < len(runs()):
        print(f"small: {len(chosen)} of {len(runs())} simulations")
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
