"""The command pair (docs/guide/classifier.md)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

from eskin.app.cli import printable
from eskin.app.options import arg, opt, out_file
from eskin.base.errors import InputError
from eskin.base.files import write_json

POINT = "SWEEP:POINT, such as rates-cnn:lcs-4; SWEEP is a file or a sweep of the project"


def pair(
    first: Annotated[str, arg("A", POINT)],
    second: Annotated[str, arg("B", "SWEEP:POINT to compare with")],
    reading: Annotated[str, opt("last|selected", "epoch to evaluate")] = "last",
    out: Annotated[Path | None, out_file("FILE", "JSON file for the results")] = None,
) -> None:
    """Compare the predictions of two sweep points image by image with McNemar's exact test."""
    from eskin.snn.experiments.pairs import find_point
    from eskin.snn.experiments.pairs import pair as compare
    from eskin.snn.experiments.points import READINGS
    from eskin.snn.figures.fig9 import KEPT

    if reading not in READINGS:
        raise InputError(f"reading must be one of {', '.join(READINGS)}, not {reading!r}")
    found = compare(find_point(first, KEPT), find_point(second, KEPT), reading)
    print(printable(f"A: {first}, B: {second}, {READINGS[reading]}, {found.images} images"))
    rows = zip(found.accuracy_first, found.accuracy_second, found.only_first, found.only_second, found.p, strict=True)
    for seed, (a, b, only_a, only_b, p) in enumerate(rows):
        print(f"seed {seed}: A {a:.1%}, B {b:.1%}; only A right {only_a}, only B right {only_b}, McNemar p {p:.2g}")
    low, high = found.interval
    print(
        f"B - A: {100 * found.difference:+.1f} points, 95 % interval over images and seeds {100 * low:+.1f} to "
        f"{100 * high:+.1f}"
    )
    if out is not None:
        write_json(out, {"first": first, "second": second, "reading": reading} | dataclasses.asdict(found))
        print(printable(f"result: {out}"))
