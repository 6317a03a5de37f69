"""Test worker pools: equal results in every kind of pool, in order, also after crashes."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.base.workers.pool import Local, Shared, each


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
