"""Area, highest clock and cost of synthesis of one array after the other, as data."""

from __future__ import annotations

import copy
import dataclasses
import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flow.asic.library import Library
from flow.gates.liberty import CellLibrary
from flow.scale.array import Array, build
from flow.scale.delays import kind_of
from flow.scale.lines import Lines, Repeater, best_repeater
from flow.scale.places import Places
from flow.scale.timing import Path as SlowestPath
from flow.scale.timing import Timing
from flow.scale.wire import FARAD_PER_UM, NO_WIRE, OHM_PER_UM, PITCH_UM, Wire
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import origin, read_json, write_json

LARGEST = 64

FIELDS = ("encoding", "resolution", "frontend", "sample_bits")
"""Of the configuration, that the user may choose."""


def sizes_of(text: str) -> list[tuple[int, int]]:
    """Return rows and columns of arrays, ``8x8,12x16``.

    Raises
    ------
    InputError
        If one of them is no size.

    Examples
    --------
    >>> sizes_of("8x8,12x16")
    [(8, 8), (12, 16)]
    """
    found = []
    for word in text.split(","):
        rows, mark, columns = word.strip().partition("x")
        if not (mark and rows.isdigit() and columns.isdigit() and 1 <= int(rows) <= 64 and 1 <= int(columns) <= 64):
            raise InputError(
                f"--sizes must be sizes of 1 to {LARGEST} rows and columns such as 8x8,12x16, not {word!r}"
            )
        found.append((int(rows), int(columns)))
    return found


def measure(
    config: ReadoutConfig,
    sizes: list[tuple[int, int]],
    library: Library,
    wire: Wire,
    pitch_um: float,
    out: Path,
    on_array: Callable[[dict[str, Any]], None],
) -> None:
    """Write what is found of some arrays into a file, anew after each; those that it has, of the same commit, stay.

    Parameters
    ----------
    config : ReadoutConfig
        Of any size.
    sizes : list of (int, int)
        Rows and columns of each array.
    library : Library
    wire : Wire
    pitch_um : float
        Of the taxels.
    out : Path
        JSON.
    on_array : callable
        Called with what was found of each array.
    """
    words = ["make asic SCALE=1", f"LIB={library.path.name}", *_words(config, wire, pitch_um)]
    tables = CellLibrary.read(library.path)
    repeater = best_repeater((kind_of(tables, tables.cells[cell.name]) for cell in library.buffers), wire)
    fixed = {
        "commit": origin("")["commit"],
        "library": library.path.name,
        "configuration": {name: getattr(config, name) for name in FIELDS},
        "pitch_um": pitch_um,
        **dataclasses.asdict(wire),
        "repeater": dataclasses.asdict(repeater),
    }
    found = _kept(out, fixed)
    for rows, columns in sizes:
        if (rows, columns) not in found:
            found[rows, columns] = _measured(
                config.replace(rows=rows, columns=columns), library, wire, pitch_um, repeater
            )
            said = origin(" ".join([*words, "SIZES=" + ",".join(f"{r}x{c}" for r, c in found)]))
            results = sorted(found.values(), key=lambda array: array["taxels"])
            write_json(out, said | fixed | {"results": results})
        on_array(found[rows, columns])


def _words(config: ReadoutConfig, wire: Wire, pitch_um: float) -> list[str]:
    """Return what of a run is not by default, as variables of make."""
    own = {name: getattr(config, name) for name in FIELDS if getattr(config, name) != getattr(ReadoutConfig(), name)}
    usual = {
        "pitch": (pitch_um, PITCH_UM),
        "ohm": (wire.ohm_per_um, OHM_PER_UM),
        "farad": (wire.farad_per_um, FARAD_PER_UM),
    }
    own |= {name: f"{value:g}" for name, (value, default) in usual.items() if value != default}
    return [f"{name.upper()}={value}" for name, value in own.items()]


def _kept(out: Path, fixed: dict[str, Any]) -> dict[tuple[int, int], dict[str, Any]]:
    """Return the arrays that a file has, if it was made in the same way."""
    if not out.exists():
        return {}
    kept = read_json(out, "the estimate", dict)
    if any(kept.get(name) != value for name, value in fixed.items()):
        return {}
    return {(array["rows"], array["columns"]): array for array in kept["results"]}


def _measured(
    config: ReadoutConfig, library: Library, wire: Wire, pitch_um: float, repeater: Repeater
) -> dict[str, Any]:
    """Return what is found of an array, and the processor seconds of its synthesis."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    array = build(config, library)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return estimate(array, wire, pitch_um, repeater) | {"synthesis_s": round(seconds, 2)}


def estimate(array: Array, wire: Wire, pitch_um: float, repeater: Repeater) -> dict[str, Any]:
    """Return area and highest clock of an array, without wires and with them; repeaters are in both."""
    config = array.config
    found: dict[str, Any] = {
        "rows": config.rows,
        "columns": config.columns,
        "taxels": config.taxels,
        "cells_um2_per_taxel": array.area_um2() / config.taxels,
        "taxel_um2": array.taxel_area_um2,
    }
    for name, kind in (("without_wires", NO_WIRE), ("with_wires", wire)):
        drawn = lines(copy.deepcopy(array), kind, pitch_um, repeater)
        path = Timing(drawn.array, drawn).worst()
        found[name] = {
            "fmax_hz": 1 / path.period_s,
            "area_um2_per_taxel": drawn.array.area_um2() / config.taxels,
            "repeaters": drawn.added,
            "lines_m": drawn.length_um * 1e-6,
            **_of_path(path),
        }
    return found


def lines(array: Array, wire: Wire, pitch_um: float, repeater: Repeater) -> Lines:
    """Return the lines of an array, drawn; their repeaters are cells of it."""
    drawn = Lines(array, Places(array, pitch_um), wire, repeater)
    drawn.draw()
    return drawn


def _of_path(path: SlowestPath) -> dict[str, Any]:
    """Return what is said of the path that sets the period."""
    in_repeaters = in_wires = before = 0.0
    for stage in path.stages:
        own = stage.arrival_s - before
        in_repeaters += own - stage.wire_s if stage.name.startswith("repeater_") else 0.0
        in_wires += stage.wire_s
        before = stage.arrival_s
    logic = [stage for stage in path.stages if not stage.name.startswith("repeater_")]
    return {
        "path_s": before,
        "path_in_repeaters_s": in_repeaters,
        "path_in_wires_s": in_wires,
        "logic_depth": len(logic),
        "path": [path.start, *(stage.name for stage in logic), path.end],
    }
