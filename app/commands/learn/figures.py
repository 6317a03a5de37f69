"""The commands fig8 and fig9 (docs/guide/classifier.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eskin.app.cli import asked_for, printable
from eskin.app.commands.signals.options import DataOutOption, OutOption
from eskin.app.commands.signals.recordings import named_place
from eskin.app.options import TRAINED
from eskin.base.errors import InputError
from eskin.base.figures.files import DEFAULT_OUT, write_results


def fig9(
    sweep: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE|DIR", help="sweep, repeatable [those of the project and out/sweep/sweep.json]"),
    ] = None,
    reading: Annotated[str, typer.Option(metavar="last|selected", help="epoch to evaluate")] = "last",
    confusion: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="sweep points for confusion matrices [best spiking point of each preset]"),
    ] = None,
    out: OutOption = DEFAULT_OUT,
    data_out: DataOutOption = None,
) -> None:
    """Plot figure 9, accuracy against data rate with published points, and confusion matrices."""
    from eskin.snn.experiments.points import READINGS
    from eskin.snn.figures.confusion import confusion_data, plot_confusion
    from eskin.snn.figures.fig9 import fig9_data, load_sweeps
    from eskin.snn.figures.fig9_plot import plot_fig9

    if reading not in READINGS:
        raise InputError(f"reading must be one of {', '.join(READINGS)}, not {reading!r}")
    sweeps = load_sweeps(sweep or [])
    matrices = confusion_data(sweeps, reading, confusion)
    data = fig9_data(sweeps, reading)
    print(printable(write_results(out, "fig9", data, plot_fig9, data_out, command=asked_for())))
    if matrices["points"]:
        print(printable(write_results(out, "confusion", matrices, plot_confusion, data_out, command=asked_for())))
    for point in data["left_out"]:
        print(printable(f"left out, because no seed is finished: {point}"))


def fig8(
    weights: Annotated[Path, typer.Option(metavar="FILE", help="weights from eskin train")] = TRAINED,
    result: Annotated[
        Path | None, typer.Option(metavar="FILE", help="result of the same training [result.json beside the weights]")
    ] = None,
    dataset: Annotated[
        str | None, typer.Option(metavar="DIR|embedded", help="textures [folder used in training]")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR|finger", help="your own recordings, if the network was trained on them", callback=named_place
        ),
    ] = None,
    image: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="texture or recording, such as brick/brick-00 [first correct test image]"),
    ] = None,
    out: OutOption = DEFAULT_OUT,
    data_out: DataOutOption = None,
) -> None:
    """Plot figure 8: one scan from texture through events and hidden spikes to the evidence of each class."""
    from eskin.skin.figures.scan_to_class import plot_scan
    from eskin.snn.figures.fig8_play import Places, play

    if dataset is not None and data is not None:
        raise InputError("--dataset is for textures, --data for your own recordings; give one of the two")
    played = play(weights, result or weights.parent / "result.json", Places(dataset, data), image)
    print(
        printable(
            write_results(
                out,
                "fig8",
                played.to_dict(),
                lambda _, path: plot_scan(played, path),
                data_out,
                command=asked_for(),
            )
        )
    )
    print(printable(f"{played.name}: true {played.true}, predicted {played.predicted}"))
    if played.tests:
        noun = "recordings" if played.pixels is None else "images"
        print(f"the network is right for {played.right} of {played.tests} test {noun}")
