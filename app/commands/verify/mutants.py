"""The command mutants (docs/design/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eskin.app.options import opt, out_folder
from eskin.app.worker_options import Scheduler, Workers, open_pool
from eskin.base.errors import InputError

if TYPE_CHECKING:
    from eskin.verify.mutants.campaign import Finding


def mutants(
    model: Annotated[bool, opt("mutate the model and the network instead of the RTL")] = False,
    block: Annotated[str, opt("only this block or room: arbiter, link, taxel, classifier, ...")] = "",
    share: Annotated[
        float | None, opt("fraction of the source places to mutate [0.3, with --model 0.07]", min=0.0, max=1.0)
    ] = None,
    seed: Annotated[int, opt("seed of the random edits", min=0)] = 1,
    apart_from: Annotated[int | None, opt("leave out mutants that this seed draws at the same share", min=0)] = None,
    again: Annotated[bool, opt("test survivors again, after new tests were added")] = False,
    limit: Annotated[int | None, opt("largest number of mutants [all]", min=1)] = None,
    judging: Annotated[bool, opt("--judge/--no-judge", "test mutants, or only report earlier results")] = True,
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[Path, out_folder("folder for the results")] = Path("out/mutants"),
) -> None:
    """Mutate the source code, and report which mutants the tests and proofs kill.

    A stopped run continues with the missing mutants.
    """
    from eskin.verify.mutants.campaign import MODEL, NEEDS, RTL, Plan, closing_line, run, write
    from eskin.verify.mutants.questions import mutated_files

    packages = MODEL if model else RTL
    share = share if share is not None else 0.07 if model else 0.3
    known = sorted({Path(file).with_suffix("").parts[1] for file in mutated_files(packages)})
    if block and block not in known:
        raise InputError(f"--block must be one of {', '.join(known)}, not {block!r}")

    def tell(finding: Finding) -> None:
        print(f"{finding.verdict:<11}{finding.name}{f' by {finding.by}' if finding.by else ''}", flush=True)

    with open_pool(workers, scheduler, NEEDS) as pool:
        done = run(Plan(packages, share, seed, block, limit, apart_from), out, pool if judging else None, again, tell)
    options = {"MODEL": 1 if model else "", "BLOCK": block, "SHARE": f"{share:g}", "SEED": str(seed)}
    options |= {"APART_FROM": "" if apart_from is None else str(apart_from), "LIMIT": limit or ""}
    command = " ".join(["make mutants", *(f"{name}={value}" for name, value in options.items() if value)])
    write(out / "mutants.json", command, done, "model" if model else "rtl")
    for test in sorted(done.skipped):
        print(f"fails without a mutant: {test}")
    print(closing_line(done))
    if done.skipped or len(done.findings) < done.planned or any(one.verdict == "alive" for one in done.findings):
        raise typer.Exit(1)
