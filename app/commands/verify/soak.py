"""The command soak: random configurations through RTL and model for a given time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from eskin.app.options import opt, out_file, out_folder, parse_fields, parse_number
from eskin.base.errors import InputError


def soak(
    hours: Annotated[float, opt("hours after which no further run starts, of 2 million clocks at most")] = 0.1,
    seed: Annotated[int, opt("seed of the first configuration; each further one adds 1")] = 0,
    clocks: Annotated[int, opt("clocks of each configuration, or of the run given by --only")] = 20_000_000,
    simulator: Annotated[str, opt("--sim", "verilator or icarus")] = "verilator",
    only: Annotated[int | None, opt("SEED", "play one run of this seed, as printed by a failure")] = None,
    run: Annotated[int, opt("number of the run of --only")] = 0,
    set_: Annotated[
        list[str] | None,
        opt("--set", "NAME=VALUE", "fix a parameter of the run of --only, instead of drawing it; repeatable"),
    ] = None,
    keep: Annotated[Path | None, out_file("--keep", "JSON file for the totals of all runs in --out")] = None,
    out: Annotated[Path, out_folder("folder of the results; a restarted soak continues there")] = Path("out/soak"),
) -> None:
    """Compare RTL and model on random configurations for a given time; exit code 1 on a difference.

    A difference is reduced to one command that repeats it. Several processes may share the same --out.
    """
    from eskin.cocotb_tests.runner.simulator import require_programs
    from eskin.verify.soak import campaign

    require_programs(simulator)  # type: ignore[arg-type]
    if only is not None:
        _one(only, run, clocks, _parts(set_ or []), simulator)
        return
    plan = campaign.Plan(3600 * hours, seed, clocks, simulator, out)  # type: ignore[arg-type]
    try:
        campaign.soak(plan, _tell)
    except campaign.SoakFailed as failed:
        print(f"{failed}\nMISMATCH")
        raise typer.Exit(1) from None
    found = campaign.summary(out)
    if keep is not None:
        from eskin.base.files import origin, write_json

        spent = found["seconds"] / 3600  # in all, however often it was stopped
        begun = f" SEED={seed}" if seed else ""
        write_json(keep, origin(f"make soak HOURS={spent:.2f}{begun} CLOCKS={clocks}") | found)
    print(found["result"])


def _tell(piece: dict[str, Any]) -> None:
    """Print a line for a finished configuration."""
    fields = piece["configuration"]
    what = f"{fields['rows']}x{fields['columns']} {fields['encoding']} {fields['sample_bits']}b/{fields['resolution']}b"
    what += f" {fields['link']} {fields['frontend']} {fields['decide_every']}"
    done = f"{piece['clocks']:,} clocks, {piece['events']:,} events, {piece['seconds']} s"
    print(f"seed {piece['seed']}: {what}: {done}", flush=True)


def _parts(words: list[str]) -> dict[str, Any]:
    """Return the fixed settings of a configuration, with integers converted."""
    from eskin.cocotb_tests.bench.draw import FIELDS, PARTS
    from eskin.model.config import ReadoutConfig

    parts: dict[str, Any] = {}
    for word in words:
        name, separator, value = word.partition("=")
        if not separator or name not in FIELDS | set(PARTS):
            raise InputError(
                f"--set takes NAME=VALUE, a field of the configuration or {', '.join(PARTS)}, not {word!r}"
            )
        if name in FIELDS:
            parts |= parse_fields(ReadoutConfig, {name: value})
        elif name == "share":
            parts[name] = parse_number("--set share", float, value)
        else:
            parts[name] = int(value) if value.isdecimal() else value
    return parts


def _one(seed: int, run: int, clocks: int, parts: dict[str, Any], simulator: Any) -> None:
    """Simulate one random run, and print its result."""
    from eskin.cocotb_tests.bench.draw import Draw
    from eskin.cocotb_tests.runner.process import MismatchFound
    from eskin.verify.soak.play import play

    try:
        tally = play([Draw(seed, clocks, run, parts)], simulator)
    except MismatchFound as found:
        print(f"{found}\nMISMATCH")
        raise typer.Exit(1) from None
    print(f"bit-exact: {tally.runs} runs, {tally.clocks} clocks, {tally.events} events, 0 mismatches")
