"""Robustness: trained networks on disturbed scans, for all folds, seeds, disturbances and strengths.

The study tests the networks on events of physical scans in ``out/train*/NETWORK/TRAINING``. A scan of an image is
disturbed equally for all networks, so that their answers are paired. A stopped run continues with the missing cells.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.progress import bar
from eskin.base.workers.engine import Pool
from eskin.base.workers.store import Store
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.disturb import DISTURBANCES, record_disturbed
from eskin.snn.data.scans import ScanData, collect
from eskin.snn.exchange.weights import config_of
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.sweep import NEEDS
from studies.drawing import draw_networks, network_styles
from studies.networks import Cells, Subject, by_case, score_of, tested, trained_networks
from studies.study import Data, Result, run, work_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLEAN = "clean"
"""Name of the scans without a disturbance."""

Case = tuple[str, float]
"""Disturbance and strength."""

CASES: list[Case] = [(CLEAN, 0.0), *((name, s) for name, one in DISTURBANCES.items() for s in one.strengths)]

COLUMNS = 4
LETTERS = 34
"""Most letters of a line below a panel; a longer line would meet the next panel's."""


def compute(pool: Pool) -> Data:
    """Return accuracy and answers of every network in all cases."""
    subjects = trained_networks(scenes=True)
    with bar("cells", len(subjects) * len(CASES)) as step:
        return {"points": summarise(run_cells(subjects, CASES, pool, work_of("robustness", NEEDS), step))}


def disturbed_scans(experiment: Experiment, images: NDArray[np.int64], case: Case) -> ScanData:
    """Return the event counts of images under a disturbance, in the order of ``images``."""
    scan, config = experiment.scan_and_config()
    assert isinstance(scan, PhysicalScan)
    dataset = open_dataset(experiment.dataset)
    name, strength = case
    strengths = {} if name == CLEAN else {name: strength}
    key = [list(DISTURBANCES).index(name) if name in DISTURBANCES else len(DISTURBANCES), round(1e6 * strength)]
    recordings = [
        record_disturbed(dataset[i], dataset.name, scan, config, strengths, np.random.default_rng([*key, int(i)]))
        for i in images
    ]
    return collect(recordings, experiment.bins, dataset.class_names)


def run_cells(
    subjects: Sequence[Subject], chosen: Sequence[Case], pool: Pool, store: Store, progress: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return the test results of all networks in all cases; networks with the same scans are tested together."""
    groups: dict[str, list[Subject]] = {}
    for subject in subjects:
        groups.setdefault(subject.recorded_as, []).append(subject)
    cases = [dict(zip(("disturbance", "strength"), case, strict=True)) for case in chosen]
    found = tested(pool, store, answers, [(group, case) for case in cases for group in groups.values()], progress)
    names = [(subject.network, subject.fold, subject.seed) for subject in subjects]
    return sorted(
        found,
        key=lambda cell: (
            chosen.index((cell["disturbance"], cell["strength"])),
            names.index((cell["network"], cell["fold"], cell["seed"])),
        ),
    )


def answers(subjects: Sequence[Subject], case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the predictions of networks for the same disturbed scans."""
    from eskin.snn.train import check_fits, logits_of

    data = disturbed_scans(subjects[0].experiment, subjects[0].images, (case["disturbance"], case["strength"]))
    for subject in subjects:
        check_fits(config_of(subject.weights.network), data)
    return [
        {
            "labels": data.labels.tolist(),
            "predicted": logits_of(subject.weights.network, data).argmax(1).tolist(),
            "rate_hz": data.rate_hz,
        }
        for subject in subjects
    ]


def summarise(cells: Cells) -> list[dict[str, Any]]:
    """Return accuracy, intervals and predictions for every network, disturbance and strength."""
    found = []
    for case, parts in by_case(cells, "network", "disturbance", "strength"):
        parts.sort(key=lambda cell: (cell["fold"], cell["seed"]))
        rates_hz, sizes = [cell["rate_hz"] for cell in parts], [len(cell["images"]) for cell in parts]
        answers = [{name: cell[name] for name in ("fold", "seed", "images", "labels", "predicted")} for cell in parts]
        rate_hz = float(np.average(rates_hz, weights=sizes))
        found.append(case | score_of(parts) | {"rate_hz": rate_hz, "answers": answers})
    return found


def plot_robustness(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against disturbance strength, with intervals; one panel for each disturbance."""
    points = data["points"]
    names = [name for name in DISTURBANCES if any(point["disturbance"] == name for point in points)]
    styles = network_styles(sorted(points, key=lambda point: str(point["network"])))
    rows = max(1, -(-len(names) // COLUMNS))
    figure = new_figure(11, 1.2 + 2.3 * rows, "Trained networks under disturbances")
    panels = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False)
    for panel in panels.ravel()[len(names) :]:
        panel.set_visible(False)
    for panel, name in zip(panels.ravel(), names, strict=False):
        own = [point for point in points if point["disturbance"] == name]
        _draw(panel, name, sorted(own, key=lambda point: float(point["strength"])), styles)
        for point in points:
            if point["disturbance"] == "clean":
                colour = styles[point["network"]]["color"]
                panel.axhline(100 * point["accuracy"], color=colour, linestyle=":", linewidth=1)
    for panel in panels[:, 0]:
        panel.set_ylabel("accuracy (%)", fontsize=8.5)
    words = "bars: 95 % interval over images and seeds; dotted: undisturbed scans"
    legend_below(figure, panels[0, 0].get_legend_handles_labels(), 4, words, handlelength=3)
    save_figure(figure, path)


def _draw(panel: Axes, name: str, points: Sequence[Mapping[str, Any]], styles: Mapping[str, Mapping[str, Any]]) -> None:
    dress(panel)
    strengths = list(dict.fromkeys(point["strength"] for point in points))
    draw_networks(panel, points, lambda point: strengths.index(point["strength"]), styles)
    unit = DISTURBANCES[name].unit
    panel.set_xticks(range(len(strengths)), [f"{strength:g}" for strength in strengths])
    panel.set_xlim(-0.3, len(strengths) - 0.7)
    panel.set_xlabel(textwrap.fill(DISTURBANCES[name].help + f" ({unit})" * bool(unit), LETTERS), fontsize=8)
    panel.set_ylim(0, 103)


RESULT = Result("classifier/robustness", compute, plot_robustness, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("robustness", RESULT)
