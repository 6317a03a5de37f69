"""The commands mutants and model-mutants (docs/design/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from model.cli.crew_options import Scheduler, open_crew
from model.errors import InputError

if TYPE_CHECKING:
    from flow.mutants.judge import Finding


def mutants(
    block: Annotated[str, typer.Option(help="only this block: arbiter, link, window, taxel, ...")] = "",
    share: Annotated[float, typer.Option(min=0.0, max=1.0, help="share of all edits that is tried")] = 0.36,
    seed: Annotated[int, typer.Option(min=0, help="of the edits that are drawn")] = 1,
    again: Annotated[bool, typer.Option(help="judge anew what the quick check left: tests are new")] = False,
    limit: Annotated[int | None, typer.Option(min=1, help="mutants at most [all]")] = None,
    judging: Annotated[bool, typer.Option("--judge/--no-judge", help="judge, or report what was found")] = True,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="pieces side by side on this machine [none: all in turn]")
    ] = None,
    scheduler: Scheduler = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for what is found")] = Path("out/mutants"),
) -> None:
    """Mutate the RTL's source, and see which mutants the tests and proofs kill; goes on where it was stopped.

    With --workers or --scheduler it is judged in pieces, and goes on behind the last whole one.
    """
    from flow.mutants.campaign import chosen, closing_line, summary, unfit, write
    from flow.mutants.campaign import run as judge
    from flow.mutants.pieces import NEEDS, spread
    from flow.mutants.plan import GROUNDS

    known = sorted({ground.block for ground in GROUNDS.values()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    picked = chosen({block} if block else known, share, seed)[:limit]
    command = " ".join(["make mutants", *([f"BLOCK={block}"] if block else []), f"SHARE={share:g} SEED={seed}"])
    print(f"{len(picked)} edits drawn with SEED={seed}")

    def tell(finding: Finding) -> None:
        print(f"{finding.verdict:<11}{'quick' if finding.quick else '':<6}{finding.name}", flush=True)

    if judging and (workers or scheduler):
        with open_crew(workers, scheduler, NEEDS, threads=True) as crew:
            spread(picked, out, seed, tell, again, crew)
        again = False
    found = judge(picked, out, seed, tell, again, judging)
    silent = unfit(out)
    write(out / "mutants.json", command, summary(found, len(picked), silent))
    for name, why in silent.items():
        print(f"not asked: {name}: {why}")
    print(closing_line(found, len(picked), len(silent)))
    if silent or len(found) < len(picked) or any(finding.verdict == "alive" for finding in found):
        raise typer.Exit(1)


def model_mutants(
    share: Annotated[float, typer.Option(min=0.0, max=1.0, help="share of all places that is tried")] = 0.07,
    seed: Annotated[int, typer.Option(min=0, help="of the edits that are drawn")] = 1,
    again: Annotated[bool, typer.Option(help="judge anew what is alive: tests are new")] = False,
    judging: Annotated[bool, typer.Option("--judge/--no-judge", help="judge, or report what was found")] = True,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for what is found")] = Path("out/mutants"),
) -> None:
    """Mutate a sample of places of model/ and snn/, each before the tests of its file; goes on where it was stopped."""
    from flow.mutants.campaign import OF_MODEL, write
    from flow.mutants.model.sampled import closing_line, drawn, judge, summary

    picked, places = drawn(share, seed)
    print(f"{len(picked)} edits drawn with SEED={seed}, of {sum(places.values())} places")

    def tell(finding: Finding) -> None:
        print(f"{finding.verdict:<8}{finding.name}", flush=True)

    found = judge(picked, out, again, tell, judging)
    write(
        out / "mutants.json",
        f"make mutants MODEL=1 SHARE={share:g} SEED={seed}",
        summary(found, len(picked), places),
        OF_MODEL,
    )
    print(closing_line(found, len(picked)))
    if any(finding.verdict == "alive" for finding in found):
        raise typer.Exit(1)
