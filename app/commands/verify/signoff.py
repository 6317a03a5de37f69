"""The command signoff (docs/verification.md)."""

from __future__ import annotations

from pathlib import Path

from eskin.app.cli import asked_for, echo
from eskin.app.commands import common
from eskin.app.options import command, opt, out_folder
from eskin.app.tables import print_table
from eskin.base.files import origin, write_json
from eskin.base.progress import note, reported


@command("Checks of the project", needs="sim dev registers", idle={"--small": "--hours --dataset --publish"})
def signoff(
    small: bool = opt(False, "only a few configurations of each check; takes minutes"),
    hours: float = opt(1.0, "hours of random runs"),
    dataset: str | None = opt(None, "texture folder for the replays [$ESKIN_DATA, data/kylberg, else embedded]"),
    publish: bool = opt(False, "copy the reports to docs/data/verification, and rewrite the tables of the documents"),
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    out: Path = out_folder(Path("out/signoff"), "folder for reports and logs"),
) -> None:
    """Run all checks: proofs with mutants, coverage, random runs, faults, and replays of all encoders.

    A stopped sign-off continues. It takes 20 minutes on two cores, and the time of the random runs.
    """
    from eskin.verify import signoff as session

    plan = session.Plan(out, small, hours, dataset, workers, scheduler)
    found = {}
    with common.resumable(out), reported("sign-off"):
        for name, step in session.sign_off(plan, lambda name: note(f"{name} ...")):
            found[name] = step
            print(f"{name:<22}{step['seconds']:>9.1f} s  {step['result']}", flush=True)
    table = list(session.rows(out))
    write_json(out / "signoff.json", origin(asked_for()) | {"steps": found, "rows": table})
    print_table(
        "kind | what was checked | result | commit | date", table, "{kind} | {what} | {result} | {commit} | {date}"
    )
    failed = [name for name, step in found.items() if step["failed"]]
    if publish and not failed:
        session.publish(out)
    echo(f"reports: {out}")
    seconds, spent = (sum(step[name] for step in found.values()) for name in ("seconds", "cpu_s"))
    said = f"sign-off: {len(found) - len(failed)} of {len(found)} steps passed, "
    common.conclude((), f"{said}{seconds:.0f} s, {spent:.0f} s of a processor", failed=any(failed))
