"""Faults: every flop of small designs inverted, one in each simulation, and hostile inputs to readouts.

The study takes hours; a stopped run continues.
"""

from functools import partial
from pathlib import Path
from typing import Any

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.workers.cluster import Needs, version
from eskin.model.config import ReadoutConfig
from eskin.verify.faults import plan
from eskin.verify.faults.cases import cases
from eskin.verify.faults.outcomes import CLASSES, NEVER
from eskin.verify.faults.run import run as run_trial
from studies.study import Data, Result, run, work_of

CODE = Needs(packages=("base", "model", "rtl", "verify.faults"))
"""Packages that determine the results."""


def upset(trial: plan.Trial) -> dict[str, Any]:
    """Return the outcomes of a trial by block, and the effects beyond the stated limits."""
    blocks, problems = run_trial(trial)
    print(f"{trial.name:<70}{sum(line['upsets'] for line in blocks):>8} upsets{len(problems):>4} problems", flush=True)
    return {"blocks": blocks, "cases": [], "problems": problems}


def surround(config: ReadoutConfig) -> dict[str, Any]:
    """Return the results of all hostile inputs of a readout."""
    readout, met = f"{config.rows} x {config.columns}, {config.encoding}, {config.link}, {config.frontend}", []
    for case in cases(config):
        good, runs = case.holds(config)
        met.append({"case": case.name, "stated": case.stated, "readout": readout, "runs": runs, "as stated": good})
        print(f"{readout:<36}{case.name:<42}{good:>4} of {runs} as stated", flush=True)
    return {"blocks": [], "cases": met, "problems": []}


def compute() -> Data:
    """Return the outcomes of all trials and hostile inputs."""
    pieces = work_of("faults", version(CODE))
    jobs = [(str(trial), partial(upset, trial)) for trial in plan.trials()]
    jobs += [(str(config), partial(surround, config)) for config in plan.surroundings()]
    found: dict[str, list[Any]] = {"blocks": [], "cases": [], "problems": []}
    for name, job in jobs:
        piece = pieces.of(name, job)
        for kind, lines in found.items():
            lines += piece[kind]
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


RESULT = Result("verification/faults", compute, plot_faults, long=True)

if __name__ == "__main__":
    run("faults", RESULT)
