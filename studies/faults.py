"""Faults: every flop of small designs inverted, one in each simulation, and hostile inputs to readouts.

The study takes hours; a stopped run continues.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.workers.engine import Needs, Pool, each
from eskin.base.workers.store import Store
from eskin.model.config import ReadoutConfig
from eskin.verify.faults import plan
from eskin.verify.faults.cases import cases
from eskin.verify.faults.outcomes import CLASSES, NEVER
from eskin.verify.faults.run import run as run_trial
from studies.study import Data, Result, run, work_of

NEEDS = Needs(packages=("base", "model", "rtl", "verify.faults"))
"""Packages and libraries that determine the results."""

Part = plan.Trial | ReadoutConfig
"""A trial of upsets, or a readout whose surroundings are hostile."""


def outcomes_of(part: Part) -> dict[str, Any]:
    """Return outcomes of a trial by block with effects beyond the stated limits, or results of hostile inputs."""
    if isinstance(part, plan.Trial):
        blocks, problems = run_trial(part)
        return {"blocks": blocks, "cases": [], "problems": problems}
    readout, met = f"{part.rows} x {part.columns}, {part.encoding}, {part.link}, {part.frontend}", []
    for case in cases(part):
        good, runs = case.holds(part)
        met.append({"case": case.name, "stated": case.stated, "readout": readout, "runs": runs, "as stated": good})
    return {"blocks": [], "cases": met, "problems": []}


def compute(pool: Pool) -> Data:
    """Return the outcomes of all trials and hostile inputs."""
    return found_in([*plan.trials(), *plan.surroundings()], pool, work_of("faults", NEEDS))


def found_in(parts: Sequence[Part], pool: Pool, store: Store) -> Data:
    """Return the outcomes of trials and hostile inputs, and print each."""
    found: dict[str, list[Any]] = {"blocks": [], "cases": [], "problems": []}
    for piece in each(pool, outcomes_of, ((part,) for part in parts), store=store, name=str):
        for kind, lines in found.items():
            lines += piece[kind]
        if piece["blocks"]:
            trial, upsets = piece["blocks"][0]["trial"], sum(line["upsets"] for line in piece["blocks"])
            print(f"{trial:<70}{upsets:>8} upsets{len(piece['problems']):>4} problems", flush=True)
        for case in piece["cases"]:
            words = f"{case['as stated']:>4} of {case['runs']} as stated"
            print(f"{case['readout']:<36}{case['case']:<42}{words}", flush=True)
    upsets, never = (sum(line[name] for line in found["blocks"]) for name in ("upsets", NEVER))
    runs, good = (sum(line[name] for line in found["cases"]) for name in ("runs", "as stated"))
    result = f"faults: {upsets} upsets, {never} of them for good, {runs} hostile runs, "
    result += f"{len(found['problems']) + runs - good} beyond what is stated"
    print(result)
    return {"result": result, **found}


def plot_faults(data: Data, path: Path) -> None:
    """Plot the share of each outcome for every block."""
    blocks = [line for line in data["blocks"] if line["upsets"]]
    names = list(dict.fromkeys(line["block"] for line in blocks))
    totals = [sum(line["upsets"] for line in blocks if line["block"] == name) for name in names]
    figure = new_figure(7, 0.3 * len(names) + 1.2, "Outcomes of upsets")
    panel = figure.subplots()
    dress(panel, "", "upsets (%)")
    start = [0.0] * len(names)
    for outcome in CLASSES:
        counts = [sum(line[outcome] for line in blocks if line["block"] == name) for name in names]
        shares = [100 * count / total for count, total in zip(counts, totals, strict=True)]
        panel.barh(names, shares, left=start, label=outcome)
        start = [before + share for before, share in zip(start, shares, strict=True)]
    panel.invert_yaxis()
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    save_figure(figure, path)


RESULT = Result("verification/faults", compute, plot_faults, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("faults", RESULT)
