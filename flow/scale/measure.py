"""Measure area, highest clock frequency and synthesis time of several arrays."""

import dataclasses
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import origin, read_json, write_json
from eskin.base.outputs import has_earlier
from eskin.base.shapes import misfit
from eskin.flow.liberty.library import Library
from eskin.flow.scale.array import Array, build
from eskin.flow.scale.lines import Lines, Repeater, best_repeater
from eskin.flow.scale.placement import Placement
from eskin.flow.scale.skin import SkinPlacement, build_skin
from eskin.flow.scale.timing import Path as SlowestPath
from eskin.flow.scale.timing import Timing
from eskin.flow.wire import FARAD_PER_UM, NO_WIRE, OHM_PER_UM, PITCH_UM, Wire
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig, tiles_of

LARGEST = 64

FIELDS = ("encoding", "resolution", "frontend", "sample_bits")
"""Fields of the configuration that the user may choose."""

ARRAY = {
    "taxels": int,
    "rows": int,
    "columns": int,
    "cells_um2_per_taxel": float,
    "synthesis_s": float,
    "without_wires": {"fmax_hz": float},
    "with_wires": {"fmax_hz": float, "area_um2_per_taxel": float, "repeaters": int},
}
"""Content of a stored result of an array."""

MakePlacement = Callable[[Array, float], Placement]
"""Function that places the cells of an array for a taxel pitch."""


def sizes_of(text: str) -> list[tuple[int, int]]:
    """Return the array sizes for a text such as ``8x8,12x16``.

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


def designs_of(config: ReadoutConfig, sizes: str, tiles: str = "", relays: str = "") -> list[ReadoutConfig]:
    """Return the designs to measure: every size as one array, or divided into the given tiles with relay stations.

    Examples
    --------
    >>> [(d.rows, d.tiles, d.relays) for d in designs_of(ReadoutConfig(), "64x64", "2x2,4x4", "0,1")]
    [(64, 4, 0), (64, 4, 1), (64, 16, 0), (64, 16, 1)]
    """
    arrays = [config.replace(rows=rows, columns=columns) for rows, columns in sizes_of(sizes)]
    if not tiles:
        if relays:
            raise InputError("--relays needs tiles; add --tiles, or leave --relays out")
        return arrays
    numbers = relays.split(",") if relays else ["0"]
    for number in numbers:
        if not number.strip().isdecimal():
            raise InputError(f"--relays must be numbers of stations such as 0,1,2, not {number!r}")
    return [
        TilesConfig(**array.to_dict(), tile_rows=down, tile_columns=across, relays=int(number))
        for array in arrays
        for down, across in map(tiles_of, tiles.split(","))
        for number in numbers
    ]


def measure(
    designs: list[ReadoutConfig],
    library: Library,
    wire: Wire,
    pitch_um: float,
    out: Path,
) -> list[dict[str, Any]]:
    """Return the results of several arrays, and write them to a file after each array.

    ``designs``: arrays, or skins of tiles, alike but for their sizes.
    """
    first = designs[0]
    words = ["make asic SCALE=1", f"LIB={library.path.name}", *_words(first, wire, pitch_um)]
    repeater = best_repeater(library.buffers, wire)
    fixed = {
        "commit": origin("")["commit"],
        "library": library.path.name,
        "configuration": {name: getattr(first, name) for name in FIELDS},
        "pitch_um": pitch_um,
        **dataclasses.asdict(wire),
        "repeater": dataclasses.asdict(repeater),
    }
    wanted = {_key(_shape(config)) for config in designs}
    tiled = isinstance(first, TilesConfig)  # the file contains only the results of its command
    found = {key: r for key, r in _kept(out, fixed).items() if key in wanted or not (tiled or "relays" in r)}
    for config in designs:
        key = _key(_shape(config))
        if key not in found:
            found[key] = _measured(config, library, wire, pitch_um, repeater)
            results = sorted(found.values(), key=lambda array: (array["taxels"], _key(array)))
            said = origin(" ".join([*words, *_cut(results)]))
            write_json(out, said | fixed | {"results": results})
    return [found[_key(_shape(config))] for config in designs]


def _shape(config: ReadoutConfig) -> dict[str, Any]:
    """Return rows, columns and tiles of a design."""
    shape = {"rows": config.rows, "columns": config.columns, "taxels": config.taxels}
    if isinstance(config, TilesConfig):
        shape |= {name: getattr(config, name) for name in ("tile_rows", "tile_columns", "relays")}
    return shape


def _key(shape: dict[str, Any]) -> tuple[int, ...]:
    return tuple(shape.get(name, 0) for name in ("rows", "columns", "tile_rows", "tile_columns", "relays"))


def _cut(results: list[dict[str, Any]]) -> list[str]:
    """Return sizes, tiles and relay stations of results as make variables."""
    tiled = [r for r in results if "relays" in r]
    words = {
        "SIZES": ["{rows}x{columns}".format(**r) for r in results],
        "TILES": ["{tile_rows}x{tile_columns}".format(**r) for r in tiled],
        "RELAYS": [f"{r['relays']}" for r in tiled],
    }
    return [f"{name}={','.join(dict.fromkeys(values))}" for name, values in words.items() if values]


def _words(config: ReadoutConfig, wire: Wire, pitch_um: float) -> list[str]:
    """Return non-default options of a run as make variables."""
    own = {name: getattr(config, name) for name in FIELDS if getattr(config, name) != getattr(ReadoutConfig(), name)}
    usual = {
        "pitch": (pitch_um, PITCH_UM),
        "ohm": (wire.ohm_per_um, OHM_PER_UM),
        "farad": (wire.farad_per_um, FARAD_PER_UM),
    }
    own |= {name: f"{value:g}" for name, (value, default) in usual.items() if value != default}
    return [f"{name.upper()}={value}" for name, value in own.items()]


def _kept(out: Path, fixed: dict[str, Any]) -> dict[tuple[int, ...], dict[str, Any]]:
    """Return the stored results that were measured with equal options."""
    if not has_earlier(out):
        return {}
    kept = read_json(out, "the estimate", dict)
    if any(kept.get(name) != value for name, value in fixed.items()):
        return {}
    if wrong := misfit(kept, {"results": [ARRAY]}):
        raise InputError(f"the estimate {out} is damaged: {wrong}; remove the file")
    return {_key(array): array for array in kept["results"]}


def _measured(
    config: ReadoutConfig, library: Library, wire: Wire, pitch_um: float, repeater: Repeater
) -> dict[str, Any]:
    """Return the results of an array, and the processor time of its synthesis."""
    before = time.process_time()
    if isinstance(config, TilesConfig):
        array, tile, spots = build_skin(config, library)
        places: MakePlacement = partial(SkinPlacement, tile=tile, spots=spots)
    else:
        array, places = build(config, library), Placement
    seconds = time.process_time() - before
    return estimate(array, wire, pitch_um, repeater, places) | {"synthesis_s": round(seconds, 2)}


def estimate(
    array: Array, wire: Wire, pitch_um: float, repeater: Repeater, places: MakePlacement = Placement
) -> dict[str, Any]:
    """Return area and highest clock frequency of an array with repeaters, without and with wires."""
    config = array.config
    found: dict[str, Any] = {
        **_shape(config),
        "cells_um2_per_taxel": array.area_um2() / config.taxels,
        "taxel_um2": array.taxel_area_um2,
    }
    for name, kind in (("without_wires", NO_WIRE), ("with_wires", wire)):
        own = array.copy()
        drawn = Lines(own, places(own, pitch_um), kind, repeater)
        timing = Timing(own, drawn)
        path = timing.worst()
        found[name] = {
            "fmax_hz": 1 / path.period_s,
            "between_flops_hz": 1 / timing.worst(ports=False).period_s,
            "area_um2_per_taxel": own.area_um2() / config.taxels,
            "repeaters": drawn.added,
            "lines_m": drawn.length_um * 1e-6,
            **_of_path(path),
        }
    return found


def _of_path(path: SlowestPath) -> dict[str, Any]:
    """Return a description of the critical path."""
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
