"""Tables of speed, scaling and link load."""

import statistics
from typing import Any

from docs.tables.write import Rows, filled, only, read, source, table
from eskin.model.encoders import registry


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


def load(*titles: str) -> Rows:
    """Yield the results of five arbiters at each of the given loads."""
    report = read("docs/data/load.json")
    for title in titles:
        lines = [line for line in report["results"] if f"{line['load']}, {line['asked']:.0%}" == title]
        for number, line in enumerate(lines):
            yield line | {"title": "" if number else title}


def udp() -> dict[str, Any]:
    """Return the loss of events over UDP."""
    report = read("benchmarks/results/udp.json")
    latency = report["result"]["host_latency_ms"]
    return report | report["result"] | {"median": latency["median"], "late": latency["99 %"]}


def engine() -> Rows:
    """Yield the tasks of each kind of long work, and the speed-up of more workers."""
    for found in bench("engine"):
        yield found | {f"of_{workers}": speed_up for workers, speed_up in found["speed_up"].items()}
