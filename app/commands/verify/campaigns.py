"""The command soak: a campaign of a given length (docs/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from eskin.app.commands import common
from eskin.app.options import opt, out_file, out_folder, parse_fields, parse_number
from eskin.base.errors import InputError
from eskin.base.files import origin, write_json


def soak(
    hours: float = opt(0.1, "hours after which no further run starts, of 2 million clocks at most"),
    seed: int = opt(0, "seed of the first configuration; each further one adds 1"),
    clocks: int = opt(20_000_000, "clocks of each configuration, or of the run given by --only"),
    simulator: str = opt("verilator", "--sim", "verilator or icarus"),
    only: int | None = opt(None, "SEED", "play one run of this seed, as printed by a failure"),
    run: int = opt(0, "number of the run of --only"),
    set_: list[str] | None = opt(
        None, "--set", "NAME=VALUE", "fix a parameter of the run of --only, instead of drawing it; repeatable"
    ),
    keep: Path | None = out_file(None, "--keep", "JSON file for the totals of all runs in --out"),
    out: Path = out_folder(Path("out/soak"), "folder of the results; a restarted soak continues there"),
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
    with common.failing_on(campaign.SoakFailed, line="MISMATCH"):
        campaign.soak(plan, _tell)
    found = campaign.summary(out)
    if keep is not None:
        spent = found["seconds"] / 3600  # total of all parts of a stopped campaign
        write_json(keep, origin(common.make_line("soak", HOURS=f"{spent:.2f}", SEED=seed, CLOCKS=clocks)) | found)
    print(found["result"])


def _tell(piece: dict[str, Any]) -> None:
    """Print a line for a finished configuration."""
    fields = piece["configuration"]
    what = f"{fields['rows']}x{fields['columns']} {fields['encoding']} {fields['sample_bits']}b/{fields['resolution']}b"
    what += f" {fields['link']} {fields['frontend']} {fields['decide_every']}"
    done = f"{piece['clocks']:,} clocks, {piece['events']:,} events, {piece['seconds']} s"
    print(f"seed {piece['seed']}: {what}: {done}", flush=True)


def _parts(words: list[str]) -> dict[str, Any]:
    """Return the settings that the texts NAME=VALUE of ``--set`` give."""
    from eskin.cocotb_tests.bench.draw import FIELDS, PARTS
    from eskin.model.config import ReadoutConfig

    parts: dict[str, Any] = {}
    for word in words:
        name, separator, value = word.partition("=")
        if not separator or name not in FIELDS | set(PARTS):
            raise InputError(
                f"--set needs NAME=VALUE with a field of the configuration or {', '.join(PARTS)}, not {word!r}"
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

    with common.failing_on(MismatchFound, line="MISMATCH"):
        tally = play([Draw(seed, clocks, run, parts)], simulator)
    print(f"bit-exact: {tally.runs} runs, {tally.clocks} clocks, {tally.events} events, 0 mismatches")
