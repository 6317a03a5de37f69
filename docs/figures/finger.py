"""Draw docs/figures/finger.png: accuracy against data rate on recordings of a robot finger.

``python -m docs.figures.finger`` from the top of the project.
"""

from pathlib import Path

from docs.tables.finger import KINDS, TARGETS, accuracies, finger_report, name_of
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, save_figure
from eskin.skin.figures.readouts import look

HERE = Path(__file__)
TITLES = ("other repetition", "one speed left out (mean)", "one pressure left out (mean)")


def main() -> None:
    """Draw the figure."""
    report = finger_report()
    figure = new_figure(7.5, 4.0, "A real finger, seven fabrics: accuracy against data rate")
    panels = dict(zip(KINDS, figure.subplots(1, len(KINDS), sharey=True), strict=True))
    goals = dict(TARGETS.values())
    for (kind, panel), title in zip(panels.items(), TITLES, strict=True):
        dress(panel, title, "data rate (kb/s)")
        panel.axhline(100 * goals[kind], color=GREY, lw=1, ls=":")
        panel.annotate("target", (0, 100 * goals[kind]), (3, 3), panel.get_yaxis_transform(), "offset points",
                       fontsize=8, color=GREY)  # fmt: skip
        panel.set_xlim(0.8, 2.9)
        for point in [*report["points"], *report["level"]["points"]]:
            kept = "statistic" not in point
            style, above = look(point["readout"]), 2 + (point["readout"] != "frame")
            rate = 1e-3 * point["bits_per_s"]
            label = f"{name_of(point)}{', level' if kept else ''}"
            reached = accuracies(report, point["network"])
            place = (rate, 100 * reached[kind]) if kind in reached else ([], [])
            panel.plot(*place, style.marker, color=style.colour, mfc=style.colour if kept else "white", ms=7,
                       zorder=above, label=label)  # fmt: skip
    first = next(iter(panels.values()))
    first.set_ylabel("accuracy (%)", fontsize=8.5)
    words = "filled: the level is kept; open: the first value is subtracted"
    legend_below(figure, first.get_legend_handles_labels(), 3, words)
    save_figure(figure, HERE.with_suffix(".png"))


if __name__ == "__main__":
    main()
