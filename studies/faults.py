"""Faults: every flop of small designs inverted, one in each simulation, and hostile inputs to readouts.

The study takes about 20 minutes of one core; a stopped run continues.
"""

from pathlib import Path

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.workers.engine import Pool
from eskin.verify.faults import plan
from eskin.verify.faults.outcomes import CLASSES
from eskin.verify.faults.run import NEEDS, campaign
from studies.study import Data, Result, run, work_of


def compute(pool: Pool) -> Data:
    """Return the outcomes of all trials and hostile inputs."""
    return campaign([*plan.trials(), *plan.surroundings()], pool, work_of("faults", NEEDS), print)


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
