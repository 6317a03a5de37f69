"""Test worker pools: equal results in every kind of pool, in order, also after crashes."""

import os
import signal
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any

import distributed
import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.base.workers.engine import Cluster, Local, Needs, Shared, each, version
from eskin.base.workers.store import Store


def scaled(values: np.ndarray, factor: float, number: int) -> np.ndarray:
    return values * factor + number


def refuse(number: int) -> int:
    if number == 3:
        raise InputError("number 3 is wrong; take another")
    return number


def die_once(marker: Path, number: int) -> int:
    """Kill the process at the first attempt at number 2."""
    if number == 2 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize(
    "name", ["properties.toml", "points/merge.sv", "eskin_registers.rdl", "run.py", "event_rates.json"]
)
def test_a_version_is_of_all_that_determines_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    package = ModuleType("eskin.drawn")
    package.__file__ = str(tmp_path / "__init__.py")
    monkeypatch.setitem(sys.modules, "eskin.drawn", package)
    found = set()
    for text in ("1", "2"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
        found.add(version.__wrapped__(Needs(("drawn",), ())))
    assert len(found) == 2


@pytest.mark.parametrize(("workers", "threads"), [(1, False), (2, False), (3, True)])
def test_all_pools_give_the_same_in_the_order_of_the_jobs(workers: int, threads: bool) -> None:
    values = np.linspace(0, 1, 1000)
    with Local(workers, threads) as pool:
        found = list(each(pool, scaled, ((1 / (k + 1), k) for k in range(12)), Shared.of("values", values)))
    assert [f.tobytes() for f in found] == [scaled(values, 1 / (k + 1), k).tobytes() for k in range(12)]


@pytest.mark.parametrize(("workers", "threads"), [(1, False), (2, True)])
def test_the_error_of_a_task_is_the_error_of_all_tasks(workers: int, threads: bool) -> None:
    with pytest.raises(InputError, match=r"^number 3 is wrong; take another$"), Local(workers, threads) as pool:
        list(each(pool, refuse, ((k,) for k in range(6))))


def test_a_process_that_dies_costs_nothing_but_time(tmp_path: Path) -> None:
    marker: Any = tmp_path / "died"
    with Local(2) as pool:
        assert list(each(pool, die_once, ((marker, k) for k in range(8)))) == [k * k for k in range(8)]
    assert marker.exists()


def test_work_that_always_kills_its_process_is_given_up_with_a_sentence() -> None:
    with pytest.raises(InputError, match=r"^a worker process died, .*; use fewer --workers$"), Local(2) as pool:
        list(each(pool, die, [(1,)]))


def note(values: list[int], folder: Path, number: int) -> list[int]:
    """Write that a task began, and return a result that JSON can hold."""
    with (folder / "began").open("a") as file:
        file.write(f"{number}\n")
    time.sleep(0.05)  # both runs ask for it meanwhile
    return [values[number], number]


def test_two_runs_on_a_cluster_compute_equal_tasks_once(tmp_path: Path) -> None:
    needs, shared = Needs(("base",), ("dask",)), Shared.of("digest of the values", [5, 6, 7])
    options: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(host="127.0.0.1", protocol="tcp", **options) as cluster, ExitStack() as stack:
        pools = [stack.enter_context(Cluster(cluster.scheduler_address, needs)) for _ in range(2)]
        jobs = [(tmp_path, number) for number in range(3)]
        stores = [Store(tmp_path / "found.json", "1") for _ in pools]
        runs = [
            each(pool, note, jobs, shared, store, name=lambda _, number: str(number))
            for pool, store in zip(pools, stores, strict=True)
        ]
        assert [found for pair in zip(*runs, strict=True) for found in pair] == [[5, 0]] * 2 + [[6, 1]] * 2 + [
            [7, 2]
        ] * 2
        assert sorted((tmp_path / "began").read_text().split()) == ["0", "1", "2"]
        again = each(pools[0], note, jobs, shared)  # without a store a task has no key
        assert list(again) == [[5, 0], [6, 1], [7, 2]]
    assert len((tmp_path / "began").read_text().split()) == 6
