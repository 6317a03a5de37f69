"""The power model: parts, ratios, corrections."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from docs.tables.written import digits, markdown, read, table


@table
def power_parts() -> str:
    """Fig. 6, mode ``paper``, at the least and the most noise."""
    data = read("docs/data/fig6.json")
    names = {"nlcs": "N-LCS", "lcs": "LCS", "frame": "frame"}
    rows = [
        [f"{1e3 * data['noise_v_rms'][i]:g} mV", names[readout]]
        + [f"{data['modes']['paper'][i][readout][part]:.3e}" for part in ("afe", "converter", "io", "total")]
        for i in (0, 2)
        for readout in names
    ]
    return markdown(["v_n", "readout", "AFE", "converter", "I/O", "total"], rows)


def by_resolution(values: dict[str, Any], show: Callable[[float | None], str]) -> str:
    """Return a table of LCS and of N-LCS with its time constants over the resolutions."""
    named = {"LCS": values["lcs"]}
    named |= {f"N-LCS {1e3 * float(tau_s):.0f} ms": row for tau_s, row in values["nlcs"].items()}
    return markdown(["N", *map(str, range(1, 11))], [[name, *map(show, row)] for name, row in named.items()])


@table
def power_crossover() -> str:
    """Crossover in mV, mode ``paper``."""
    values = read("docs/data/fig7.json")["modes"]["paper"]["crossover"]
    return by_resolution(values, lambda v: "-" if v is None else digits(1e3 * v, 4))


@table
def power_ratio() -> str:
    """Spiking over frame power at 1 mV, mode ``consistent``."""
    values = read("docs/data/fig7.json")["modes"]["consistent"]["ratio"]
    return by_resolution(values, lambda v: digits(float(v or 0), 3))


@table
def power_sensitivity() -> str:
    """Every correction alone, all but one, and the variants."""
    data = read("docs/data/sensitivity.json")
    rows = []
    for row in data["rows"]:
        bold = "**" if row["case"] == "all (consistent)" else ""
        cells = [row["case"]]
        for readout in ("nlcs", "lcs"):
            crossing = row["crossover"][readout]
            noise = crossing["noise_v_rms"]
            cells += [f"{ratio:.3g}" for ratio in row["ratio"][readout]]
            cells.append(crossing["spikes_win"] + ("" if noise is None else f" {digits(1e3 * noise, 3)}"))
        rows.append([f"{bold}{cell}{bold}" for cell in cells])
    noises = [f"{1e3 * noise:.3g} mV" for noise in data["noise_v_rms"]]
    columns = [[f"{name} {noises[0]}", *noises[1:], "spikes win"] for name in ("N-LCS", "LCS")]
    return markdown(["corrections", *columns[0], *columns[1]], rows)
