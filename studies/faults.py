"""Invert every flop of small designs, one in each simulation, and play hostile inputs to readouts.

``python studies/faults.py --out docs/data/verification`` takes hours; a stopped study continues.
"""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from matplotlib import pyplot

from eskin.base.files import Pieces, origin, pieces_of, write_json
from eskin.base.workers.cluster import Needs, version
from eskin.model.config import ReadoutConfig
from eskin.verify.faults import plan
from eskin.verify.faults.cases import cases
from eskin.verify.faults.outcomes import CLASSES, NEVER
from eskin.verify.faults.run import run

CODE = Needs(packages=("base", "model", "rtl", "verify.faults"))
"""Packages that determine the results."""


def upset(trial: plan.Trial) -> dict[str, Any]:
    """Return the outcomes of a trial by block, and the effects beyond the stated limits."""
    blocks, problems = run(trial)
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


def draw(blocks: list[dict[str, Any]], path: Path) -> None:
    """Draw the share of each outcome for every block."""
    names = list(dict.fromkeys(line["block"] for line in blocks if line["upsets"]))
    totals = [sum(line["upsets"] for line in blocks if line["block"] == name) for name in names]
    figure, axes = pyplot.subplots(figsize=(7, 0.3 * len(names) + 1.2), layout="constrained")
    start = [0.0] * len(names)
    for outcome in CLASSES:
        counts = [sum(line[outcome] for line in blocks if line["block"] == name) for name in names]
        shares = [100 * count / total for count, total in zip(counts, totals, strict=True)]
        axes.barh(names, shares, left=start, label=outcome)
        start = [before + share for before, share in zip(start, shares, strict=True)]
    axes.set_xlabel("upsets (%)")
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=3)
    figure.savefig(path)
    pyplot.close(figure)


def study(out: Path) -> None:
    """Write faults.json and faults.svg into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "faults.json"
    pieces = Pieces(path, version(CODE))
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
    write_json(path, {**origin("python studies/faults.py"), "result": result, **found})
    pieces_of(path).unlink(missing_ok=True)
    draw(found["blocks"], out / "faults.svg")
    print(result)


def main(out: Annotated[Path, typer.Option(help="folder for the data and the figure")] = Path("out/faults")) -> None:
    study(out)


if __name__ == "__main__":
    typer.run(main)
