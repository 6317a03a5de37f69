"""The command soak: random runs for a given time (docs/verification.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from eskin.app.commands import common
from eskin.app.options import command, opt, out_file
from eskin.base.workers.engine import open_pool


@command(
    "Checks of the project",
    needs="sim",
    fuzz="--sim good/nothing -o new",
    idle={
        "--only": "--seed --hours --clocks --workers --scheduler --out",
    },
)
def soak(
    hours: float = opt(0.1, "hours after which no further seed starts"),
    seed: int = opt(0, "first seed, which draws ten runs; the next seeds add 1"),
    clocks: int = opt(2_000_000, "largest number of clocks of a run"),
    simulator: str = opt("verilator", "--sim", "verilator or icarus"),
    only: str | None = opt(None, "RUN", "play one run, in JSON as a difference is printed"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: Path | None = out_file(None, "JSON file for the totals; a later soak of the same RTL continues"),
) -> None:
    """Compare RTL and model on random configurations for a given time; exit code 1 on a difference.

    A difference is reduced to the smallest run, and to one command that repeats it.
    """
    from eskin.cocotb_tests.bench.random_run import RandomRun
    from eskin.cocotb_tests.runner.process import MismatchFound
    from eskin.cocotb_tests.runner.simulator import require_programs
    from eskin.verify import soak as campaign

    require_programs(simulator)  # type: ignore[arg-type]
    if only is not None:
        run = RandomRun.from_json(only)
        with common.failing_on(MismatchFound, line="MISMATCH"):
            tally = campaign.play([run], simulator)  # type: ignore[arg-type]
        print(f"bit-exact: {tally.runs} runs, {tally.clocks} clocks, {tally.events} events, 0 mismatches")
        return

    def tell(found: list[dict[str, Any]]) -> None:
        for run in found:
            print(f"{' '.join(run['values'].values())}: {run['clocks']:,} clocks, {run['events']:,} events", flush=True)

    plan = campaign.Plan(3600 * hours, seed, clocks, simulator, out)  # type: ignore[arg-type]
    with (
        common.failing_on(campaign.SoakFailed, line="MISMATCH"),
        open_pool(workers, scheduler, campaign.NEEDS) as pool,
    ):
        totals = campaign.soak(plan, pool, tell)
    print(totals["result"])
