"""``python -m flow``: proofs of the RTL."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from model.cli.app import make_app, run
from model.errors import InputError

app = make_app("Design flow of the readout: proofs of its RTL.")


@app.callback()
def group() -> None:
    """Keep the name of a single command."""


@app.command()
def formal(
    block: Annotated[
        str, typer.Option(help="only this block: arbiter, link, window, taxel, frame_readout, readout")
    ] = "",
    small: Annotated[bool, typer.Option(help="only one small configuration of each block")] = False,
    limit: Annotated[int, typer.Option(min=1, metavar="SECONDS", help="most that one proof may take")] = 300,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="file for the results, JSON")] = None,
) -> None:
    """Prove the properties of every block; the last line says how many hold."""
    from flow.formal.engine import solve
    from flow.formal.plan import proofs
    from flow.formal.report import write
    from flow.formal.run import closing_line, outcomes

    known = sorted({proof.block for proof in proofs()})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")
    chosen = [p for p in proofs() if (not block or p.block == block) and (not small or p.small)]
    verdicts = []
    for proof in chosen:
        verdicts.append((proof, solve(proof.checker(proof.config), proof.depth, limit)))
        said = verdicts[-1][1]
        print(f"{proof.block:<10}{proof.size:<28}{len(said.proved):>3} proved{said.seconds:>7.1f} s", flush=True)
    results = outcomes(verdicts, whole=not small)
    for outcome in results:
        for problem in outcome.problems:
            print(f"{outcome.block}: {outcome.property.name}: {problem}")
    if out:
        write(results, out, "make formal")
    print(closing_line(results))
    if any(outcome.problems for outcome in results):
        raise typer.Exit(1)


def main() -> None:
    """Run the command line of the design flow."""
    run(app, "python -m flow")


if __name__ == "__main__":
    main()
