"""Load: throughput, waiting time and fairness of five arbiters at equal loads (docs/results/load.md).

Ours is ``eskin.model.arbiter``, the one that the RTL equals. The others are written for comparison: a tree with fixed
priority (the lowest index first), a flat round robin over all taxels, a binary AER tree whose nodes of two toggle
(the side that was served last yields), and greedy rows, as a fabricated chip can be set: the row that was served last
keeps the bus as long as it has requests, and sends its highest address first. They are idealised: each chooses among
all requests within a clock, whatever its depth and wires. In each a taxel has one request at most, a request is seen
in the clock after it is raised, what is chosen leaves one clock later, and its taxel may raise the next request with
the clock of the choice.

A load is a list of clocks, for each taxel, at which it has one more event to send. A wait is counted from the first
clock in which a request is high to the transfer; requests that never left count with what they had waited at the end.
``jain`` is (sum s)^2 / (n sum s^2) of the served shares s of the taxels that had anything to send: 1 where all got the
same share. ``by_address`` is the mean wait of the address that waits least, and of the one that waits longest.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.figures.style import GREY, PALETTE, dress, legend_below, new_figure, save_figure
from eskin.base.files import forget_stale_kernels
from eskin.cocotb_tests.bench.textures import scan
from eskin.model import arbiter
from eskin.model.arbiter import ROW_DTYPE, new_state
from eskin.model.config import ReadoutConfig
from eskin.model.taxel import encode_timed, uncontended_events
from studies.study import Data, Result, run

SIDE, CLOCKS, SEED = 16, 50_000, 0
"""Rows and columns of the array, clocks of every load, and seed of the random loads."""

ARBITERS = ("rows round robin (ours)", "fixed priority", "flat round robin", "binary AER tree", "greedy rows")
OURS, FIXED, FLAT, TREE, GREEDY = range(5)
COLOURS = [PALETTE[name] for name in ("blue", "orange", "grey", "black", "sky")]

forget_stale_kernels(Path(__file__), [Path(__file__), Path(arbiter.__file__)])


@njit(cache=True)
def choose(kind: int, pending: Any, last: int, toggles: Any, columns: int) -> int:
    """Return the taxel chosen by an arbiter that sends one event per clock, or -1.

    ``pending``, ``last``: requests, shape (taxels,), and taxel of the last choice.
    ``toggles``: shape (taxels,); for every node of the tree, from 1 on, the side that goes first; changed in place.
    """
    n = len(pending)
    if kind == GREEDY:
        rows = n // columns
        for i in range(rows):
            row = (max(last, 0) // columns + i) % rows
            for column in range(columns - 1, -1, -1):
                if pending[row * columns + column]:
                    return row * columns + column
        return -1
    if kind != TREE:
        start = 0 if kind == FIXED else last + 1
        for i in range(n):
            taxel = (start + i) % n
            if pending[taxel]:
                return taxel
        return -1
    asks = np.zeros(2 * n, np.bool_)
    asks[n:] = pending
    for node in range(n - 1, 0, -1):
        asks[node] = asks[2 * node] or asks[2 * node + 1]
    if not asks[1]:
        return -1
    node = 1
    while node < n:
        side = toggles[node] if asks[2 * node + toggles[node]] else 1 - toggles[node]
        toggles[node] = 1 - side
        node = 2 * node + side
    return node - n


@njit(cache=True)
def serve(kind: int, due: Any, first: Any, clocks: int, state: Any, rows: Any) -> Any:
    """Return the clocks of request and transfer of every event.

    ``due``: clocks at which the taxels have an event, rising, taxel after taxel; shape (events,).
    ``first``: index of the first event of each taxel; shape (taxels + 1,).
    ``state``, ``rows``: of ``eskin.model.arbiter``, after reset.

    Returns
    -------
    ndarray of int64, shape (2, events)
        -1 where it did not come to that.
    """
    n = len(first) - 1
    columns = n // len(rows)
    log = np.full((2, len(due)), -1, np.int64)
    sent = first[:-1].copy()  # the event that a taxel sends next, or that waits
    pending = np.zeros(n, np.bool_)
    latched = np.full(n, -1, np.int64)
    last, leaving = -1, -1
    toggles = np.zeros(n, np.int64)
    for t in range(clocks):
        taken = -1
        if kind == OURS:
            if arbiter.offers(state):
                log[1, latched[arbiter.take(state, columns) >> 1]] = t
            row = arbiter.grant(state, rows)
            for column in range(columns if row >= 0 else 0):
                taxel = row * columns + column
                if pending[taxel]:
                    latched[taxel], pending[taxel] = sent[taxel], False
                    sent[taxel] += 1
        else:
            if leaving >= 0:
                log[1, leaving] = t
            taken = choose(kind, pending, last, toggles, columns)
            leaving = -1
            if taken >= 0:
                leaving, last, pending[taken] = sent[taken], taken, False
                sent[taken] += 1
        for taxel in range(n):
            if not pending[taxel] and sent[taxel] < first[taxel + 1] and due[sent[taxel]] <= t:
                pending[taxel] = True
                log[0, sent[taxel]] = t + 1
                if kind == OURS:
                    row = taxel // columns
                    rows[row].pending |= arbiter.ONE << np.uint64(taxel % columns)
                    arbiter.request(state, row)
    return log


Load = tuple[str, float, list[NDArray[np.int64]]]


def loads(side: int, clocks: int, seed: int) -> list[Load]:
    """Return the name of each load, its share of the link's capacity, and the event times of every taxel."""
    rng = np.random.default_rng(seed)
    n = side * side

    def random(rates: NDArray[np.float64]) -> list[NDArray[np.int64]]:
        return [np.flatnonzero(rng.random(clocks) < rate) for rate in rates]

    row, column = np.divmod(np.arange(n), side)
    hot = (abs(row - side // 2) < side // 8 + 1) & (abs(column - side // 2) < side // 8 + 1)
    found: list[Load] = [recorded(side, clocks, share) for share in (0.5, 0.9)]
    found += [("uniform", share, random(np.full(n, share / n))) for share in (0.5, 0.9, 1.2)]
    for share in (0.9, 1.2):
        rates = np.where(hot, 0.8 * share / hot.sum(), 0.2 * share / (~hot).sum())
        found.append(("hot spot", share, random(rates)))
    for share in (0.9, 1.2):
        found.append(("all at once", share, [np.arange(0, clocks, int(n / share))] * n))
    return found


def recorded(side: int, clocks: int, share: float) -> Load:
    """Return the events of a scan over an embedded photograph, at the scan speed for a given link load."""
    config = ReadoutConfig(rows=side, columns=side, clocks_per_sample=2**20)
    counts, late = encode_timed(config, scan(side, side, config.sample_bits, 0))
    events = uncontended_events(config, counts, late)
    tick, number = np.divmod(events["t"], config.clocks_per_sample)
    begin = len(counts) // 4  # the sensor has settled
    clocks_per_sample = (tick >= begin).sum() / ((len(counts) - begin) * share)
    at = ((tick - begin) * clocks_per_sample).astype(np.int64) + number - 3
    taxel = events["y"].astype(np.int64) * side + events["x"]
    kept = (tick >= begin) & (at < clocks)
    return "recorded scan", share, [np.sort(at[kept & (taxel == i)]) for i in range(side * side)]


def served(load: Load, kind: int, side: int, clocks: int) -> dict[str, Any]:
    """Return the results of an arbiter at a given link load."""
    name, share, lists = load
    due = np.concatenate(lists)
    first = np.concatenate([[0], np.cumsum([len(times) for times in lists])])
    raised, left = serve(kind, due, first, clocks, new_state(), np.zeros(side, ROW_DTYPE))
    address = np.repeat(np.arange(side * side), np.diff(first))
    gone, asked = left >= 0, raised >= 0
    wait = np.where(gone, left, clocks) - raised
    served = np.array([gone[address == i].sum() for i in range(side * side)])
    demand = np.diff(first)
    shares = served[demand > 0] / demand[demand > 0]
    means = np.array([wait[asked & (address == i)].mean() for i in np.flatnonzero(demand)])
    return {
        "load": name,
        "asked": share,
        "arbiter": ARBITERS[kind],
        "events": int(gone.sum()),
        "throughput": gone.sum() / clocks,
        "mean_wait": wait[asked].mean(),
        "wait_99": float(np.percentile(wait[asked], 99)),
        "worst_wait": int(wait[asked].max()),
        "jain": shares.sum() ** 2 / (len(shares) * (shares**2).sum()),
        "least_share": shares.min(),
        "by_address": [round(float(means.min()), 2), round(float(means.max()), 2)],
    }


def compute() -> Data:
    """Return the results of every arbiter at every load."""
    results = []
    for load in loads(SIDE, CLOCKS, SEED):
        for kind in range(len(ARBITERS)):
            found = served(load, kind, SIDE, CLOCKS)
            results.append({name: round(v, 4) if isinstance(v, float) else v for name, v in found.items()})
    about = {"rows": SIDE, "columns": SIDE, "clocks": CLOCKS, "seed": SEED, "bound": (SIDE + 1) * SIDE + 2}
    return about | {"results": results}


def plot_load(data: Data, path: Path) -> None:
    """Plot the waiting times at every arbiter against the load."""
    by_load: dict[str, list[Data]] = {}
    for line in data["results"]:
        by_load.setdefault(f"{line['load']}, {line['asked']:.0%}", []).append(line)
    figure = new_figure(9.0, 4.8, "Waits at arbiters, by load of the link")
    worst, bias = figure.subplots(1, 2, sharey=True)
    dress(worst, "worst wait", "wait (clocks)")
    dress(bias, "mean wait, from the best to the worst address", "wait (clocks)")
    for number, name in enumerate(line["arbiter"] for line in next(iter(by_load.values()))):
        lines = [next(line for line in found if line["arbiter"] == name) for found in by_load.values()]
        heights = [place + 0.15 * (number - 2) for place in range(len(by_load))]
        colour = COLOURS[number]
        worst.plot([line["worst_wait"] for line in lines], heights, "osD^v"[number], color=colour, markersize=4)
        low, high = zip(*(line["by_address"] for line in lines), strict=True)
        bias.hlines(heights, low, high, color=colour, linewidth=2.5, label=name)
    worst.axvline(data["bound"], color=GREY, linewidth=1)
    place = (data["bound"], -0.5)
    worst.annotate(f"bound {data['bound']}", place, (4, 0), textcoords="offset points", color=GREY, fontsize=8)
    worst.set_ylim(len(by_load) - 0.4, -1.0)
    worst.set_yticks(range(len(by_load)), [text.replace("%", " %") for text in by_load])
    for axis in (worst, bias):
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(lambda clocks, _: f"{clocks:,g}")
    legend_below(figure, bias.get_legend_handles_labels(), 5)
    save_figure(figure, path)


RESULT = Result("load", compute, plot_load)

if __name__ == "__main__":
    run("load", RESULT)
