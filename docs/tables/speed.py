"""Tables of speed, scaling and link load."""

import statistics
from typing import Any

from docs.tables.write import Rows, digits, filled, only, read, source, table
from eskin.model.encoders import registry

SCALE = "docs/data/asic/scale-{}lcs-digital-ihp.json"


def bench(name: str) -> list[dict[str, Any]]:
    """Return the results of a benchmark."""
    return list(read(f"benchmarks/results/{name}.json")["results"])


def speed_cosim() -> None:
    """Print the speed of co-simulation and model relative to a bare Verilator loop, for every encoder and scene."""
    rows: dict[str, dict[str, str]] = {}
    for found in bench("cosim"):
        cell = filled("{of_bare_loop:x}", found)
        rows.setdefault(found["contender"], {})[f"{found['encoding']} {found['scene']}"] = cell
    columns = list(dict.fromkeys(column for row in rows.values() for column in row))
    titles = {encoder.name: encoder.title for encoder in registry.ENCODERS}
    heads = [f"{titles[encoding]}, {scene}" for encoding, scene in (column.split() for column in columns)]
    table(["", *heads], [[name, *(row.get(column, "") for column in columns)] for name, row in rows.items()])
    source(read("benchmarks/results/cosim.json"), "")


def speed_encoders() -> Rows:
    """Yield the speed of encoders relative to a plain copy."""
    texts = {e.name: e.title + (" (4,096 signals)" if e.leaks else "") for e in registry.ENCODERS} | {
        "copy": "copy",
        "lcs, counts per taxel only": "LCS, events per taxel only",
        "lcs, numpy over time": "LCS, NumPy over the taxels, Python over time",
        "snntorch delta": "snnTorch `spikegen.delta` (1,024 signals)",
    }
    for many in bench("encoder"):
        one = only(bench("encoder_64"), name=many["name"])
        yield many | {"text": texts[many["name"]], "one": one["times_the_copy"]}


def speed_layer() -> None:
    """Print CPU time in ms of one training step, for every candidate."""
    results = sorted(bench("network"), key=lambda r: (r["rate"], r["steps"]))
    rows = []
    for name in results[0]["candidates"]:
        found = [r["candidates"][name] for r in results]
        rows.append([name, *(filled("{cpu_s[median]:1e3*.1f}", one) for one in found)])
    kernels = [r["candidates"]["this project, kernel"]["cpu_s"]["median"] for r in results]
    others = [min(c["cpu_s"]["median"] for c in r["candidates"].values() if c["library"]) for r in results]
    limits = [r["limit_cpu_s"]["median"] for r in results]
    rows.append(["matrix products alone (torch)", *(f"{1e3 * limit:.1f}" for limit in limits)])
    rows.append(["fastest library or loop / kernel", *(f"{o / k:.1f}" for o, k in zip(others, kernels, strict=True))])
    rows.append(["kernel / matrix products", *(f"{k / limit:.2f}" for k, limit in zip(kernels, limits, strict=True))])
    table(["", *(f"{r['steps']} steps, {100 * r['input_density']:.0f} % of the inputs" for r in results)], rows)
    source(read("benchmarks/results/network.json"), "")


def speed_touch() -> dict[str, Any]:
    """Return the processor time of ``touch`` at two commits."""
    report = read("benchmarks/results/touch.json")
    found = report["results"]
    one = {name: statistics.median(run[name] for run in found["seconds"]) for name in ("before", "now")}
    return report | found | {"before_s": one["before"], "now_s": one["now"]}


def leak() -> Rows:
    """Return the error of the integer leak of N-LCS against floating point, in % of the event rate."""
    return [row | {"by_bits": list(row["fractions"].values())} for row in bench("leak")]


def load() -> Rows:
    """Return the results of five arbiters at equal loads."""
    report = read("benchmarks/results/load.json")
    for line in report["results"]:
        line["title"] = f"{line['load']}, {line['asked']:.0%}" if line["arbiter"].endswith("(ours)") else ""
    return report["results"]


def udp() -> dict[str, Any]:
    """Return the loss of events over UDP."""
    report = read("benchmarks/results/udp.json")
    latency = report["result"]["host_latency_ms"]
    return report | report["result"] | {"median": latency["median"], "late": latency["99 %"]}


def scale_arrays() -> Rows:
    """Yield time for generation, lint and simulation of square arrays."""
    made = {array["taxels"]: array["synthesis_s"] for array in read(SCALE.format(""))["results"]}
    for array in bench("scale_arrays"):
        runs = {(r["simulator"], r["row_by_row"]): r for r in array["simulations"]}
        whole, flat, slow = (runs.get(run) for run in (("verilator", True), ("verilator", False), ("icarus", False)))
        per_s = whole["clocks_per_second"]

        def timed(seconds: float | None, taxels: int = array["taxels"]) -> str:
            return "" if seconds is None else f"{seconds:.1f} ({digits(1000 * seconds / taxels, 2)})"

        more = {
            "generated": timed(array["generate_s"]),
            "made": timed(made.get(array["taxels"])),
            "built": f"{whole['build_s']:.0f} | {per_s:,.0f} ({digits(per_s * array['taxels'] / 1e6, 2)})",
            "flat": filled("{build_s:.0f}; {clocks_per_second:,.0f}", flat) if flat else "",
            "slow": filled("{clocks_per_second:,.0f}", slow) if slow else "",
        }
        text = "{side} x {side} | {generated} | {made} | {verilog_bytes:1e-3*,.0f} | {lint_s:.1f} | {built}"
        yield filled(text + " | {flat} | {slow}", array | more)


def _ends(path: list[str]) -> str:
    """Return start and end of a path as block or port names."""

    def word(name: str) -> str:
        if "." in name and "taxel" not in name:
            return name.split(".")[0].split("_")[0]
        return name.split("[")[0].split(".")[-1]

    return f"{word(path[0])} to {word(path[-1])}"


def scale_wires() -> Rows:
    """Yield area and highest clock frequency of arrays with and without wires."""
    for array in read(SCALE.format(""))["results"]:
        wired = array["with_wires"]
        more = {
            "repeaters": digits(wired["repeaters"] / array["taxels"], 2),
            "lines": digits(1000 * wired["lines_m"] / array["taxels"], 2),
            "share": (wired["path_in_repeaters_s"] + wired["path_in_wires_s"]) / wired["path_s"],
            "ends": _ends(wired["path"]),
        }
        yield array | more


def scale_tiles() -> Rows:
    """Yield area and highest clock frequency of 4,096 taxels as one array and as tiles."""
    arrays = read(SCALE.format(""))["results"]
    small, large = only(arrays, rows=8, columns=8), only(arrays, rows=64, columns=64)
    for array in [small, large, *read(SCALE.format("tiles-"))["results"]]:
        more = {"cut": "one array", "relays": ""}
        if "relays" in array:
            down, across = array["rows"] // array["tile_rows"], array["columns"] // array["tile_columns"]
            more = {"cut": f"{array['tile_rows'] * array['tile_columns']} tiles of {down} x {across}"}
        for name in ("fmax_hz", "area_um2_per_taxel"):
            more[name] = array["with_wires"][name] / small["with_wires"][name]
        yield array | more | {"more_area": more["area_um2_per_taxel"] - 1, "ends": _ends(array["with_wires"]["path"])}
