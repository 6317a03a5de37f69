"""Measure the engine: processor time of one and two workers, bytes of a task, and where more workers stop helping.

``python benchmarks/engine.py formal`` measures one kind of work, ``python benchmarks/engine.py`` all of them.

All times are processor seconds, so that other work on the machine counts little. The time with two workers is that of
the busier one with its start, plus what this process itself computes. The time with one is that of all tasks and one
start. The time with more workers comes from a simulation of the
scheduler's queue: it hands out one task after the other, each to the next free worker, and every task takes as long as
one that was measured.
"""

import heapq
import json
import os
import pickle
import random
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import distributed
import typer
from distributed.protocol.pickle import dumps
from measure import RESULTS, JsonFile, versions, write

from eskin.base.progress import processor_s
from eskin.base.workers.engine import Cluster, Local, Needs, Shared, each

NOTHING = 2000
"""Tasks that do nothing, for the time that the scheduler takes for one."""

WORKERS = (2, 8, 64, 512)
ENOUGH = 0.9
"""Part of the highest speed-up that counts as reached."""

Job = tuple[Callable[..., Any], list[tuple[Any, ...]], Shared | None, int]
"""Work, arguments of the measured tasks, shared value, and number of tasks of the whole campaign."""


def metered(*arguments: Any) -> tuple[int, float, float, int]:
    """Run a task; return process, processor seconds of task and process, and bytes of the result."""
    *arguments, work = arguments
    before = processor_s()
    result = work(*arguments)
    return os.getpid(), processor_s() - before, processor_s(), len(pickle.dumps(result))


def formal() -> Job:
    """Return proofs of every sixth configuration."""
    from eskin.verify.proofs.plan import proofs
    from eskin.verify.proofs.run import prove

    whole = proofs()
    return prove, [(proof, 300) for proof in whole[::6]], None, len(whole)


def coverage() -> Job:
    """Return coverage runs of four readouts."""
    from eskin.verify.coverage.plan import runs
    from eskin.verify.coverage.run import _played

    whole = runs()
    return _played, [(run,) for run in whole[2:6]], None, len(whole)


def soak() -> Job:
    """Return seeds of short random runs, built for Icarus; a campaign is of an hour."""
    from eskin.verify.soak import play_seed

    return play_seed, [(seed, 20_000, "icarus") for seed in range(6)], None, 360


def faults() -> Job:
    """Return small trials of upsets."""
    from eskin.verify.faults.plan import surroundings, trials
    from eskin.verify.faults.run import outcomes_of

    return outcomes_of, [(trial,) for trial in trials(small=True)[:12]], None, len(trials()) + len(surroundings())


def crossval() -> Job:
    """Return short trainings on the embedded textures, of which a sweep has 18 at each point."""
    from eskin.snn.experiments.crossval import run_alone
    from eskin.snn.experiments.experiment import Experiment
    from eskin.snn.training import TrainConfig

    experiment = Experiment(dataset="embedded", network={"hidden": 64}, train=TrainConfig(epochs=30))
    scans = Shared.of("scans", experiment.data(lambda: None))
    return run_alone, [(experiment, fold, seed, 4) for seed in range(3) for fold in range(4)], scans, 10_000


def replay() -> Job:
    """Return parts of one scan; a part of a whole replay has 32."""
    from eskin.cocotb_tests.runner.chunk import play_part
    from eskin.cocotb_tests.runner.replay import plan_textures
    from eskin.model.config import ReadoutConfig

    plan = plan_textures(ReadoutConfig(), "embedded", "physical", 0.0, 8, None, RESULTS)
    return play_part, [(plan.scans([name], every_clock=""),) for name in plan.names], None, 4 * 240


def measure(job: Job) -> dict[str, Any]:
    """Return processor and elapsed times with two workers, the time of one, and the bytes of a task."""
    work, jobs, shared, campaign = job
    found: dict[str, Any] = {"tasks": len(jobs), "load_average": round(os.getloadavg()[0], 1)}
    own, began = time.process_time(), time.monotonic()
    with Local(2) as pool:
        done = list(each(pool, metered, ((*one, work) for one in jobs), shared))
    own, found["wall_s_2"] = time.process_time() - own, round(time.monotonic() - began, 1)
    whole = {pid: until for pid, _, until, _ in done}  # of the last task of each process
    seconds = [task for _, task, _, _ in done]
    start_s = (sum(whole.values()) - sum(seconds)) / len(whole)
    found["start_s"] = round(start_s, 2)
    found["cpu_s"] = {"1": round(own + start_s + sum(seconds), 2), "2": round(own + max(whole.values()), 2)}
    found["speed_up_2"] = round(found["cpu_s"]["1"] / found["cpu_s"]["2"], 2)
    found["task_s"] = {"mean": round(sum(seconds) / len(seconds), 2), "most": round(max(seconds), 2)}
    sent = [len(dumps((work, one))) for one in jobs]
    found["sent_bytes"] = {"mean": round(sum(sent) / len(sent)), "most": max(sent)}
    found["result_bytes"] = max(size for *_, size in done)
    found["shared_bytes"] = len(shared.packed) if shared else 0
    return found | {"campaign_tasks": campaign, "seconds": [round(one, 3) for one in seconds]}


def dispatch_s() -> float:
    """Return the seconds in which the scheduler hands out one task that does nothing, to eight workers."""
    options: dict[str, Any] = {"threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    with (
        distributed.LocalCluster(8, host="127.0.0.1", protocol="tcp", **options) as cluster,
        Cluster(cluster.scheduler_address, Needs(("base",), ("dask",))) as pool,
    ):
        list(each(pool, abs, ((n,) for n in range(100))))
        began = time.monotonic()
        list(each(pool, abs, ((n,) for n in range(NOTHING))))
        return (time.monotonic() - began) / NOTHING


def simulated(seconds: Sequence[float], tasks: int, workers: int, each_s: float) -> float:
    """Return the end of a campaign: the scheduler hands out tasks in turn, each to the worker that is free first."""
    drawn, free = random.Random(0), [0.0] * workers
    clock = 0.0
    for _ in range(tasks):
        clock = max(clock + each_s, free[0])
        heapq.heapreplace(free, clock + drawn.choice(seconds))
    return max(free)


def scaled(found: dict[str, Any], each_s: float) -> dict[str, Any]:
    """Return the simulated speed-ups, and the number of workers from which on more workers hardly help."""
    run = partial(simulated, found["seconds"], found["campaign_tasks"], each_s=each_s)
    alone = run(1)
    best = alone / run(4096)
    enough = next(workers for workers in (2**k for k in range(13)) if alone / run(workers) >= ENOUGH * best)
    return {"speed_up": {workers: round(alone / run(workers), 1) for workers in WORKERS}, "enough_workers": enough}


KINDS: dict[str, Callable[[], Job]] = {job.__name__: job for job in (formal, coverage, soak, faults, crossval, replay)}


def main(
    kind: Annotated[str, typer.Argument(help="kind of work to measure; all kinds if empty")] = "", out: JsonFile = None
) -> None:
    """Measure the engine; the file keeps the results of other kinds, by default benchmarks/results/engine.json."""
    path = out or RESULTS / "engine.json"
    kept = {one["kind"]: one for one in json.loads(path.read_text())["results"]} if path.exists() else {}
    scheduler_s = dispatch_s()
    for name in [kind] if kind else KINDS:
        kept[name] = {"kind": name} | measure(KINDS[name]())
        kept[name] |= scaled(kept[name], scheduler_s)
        print(json.dumps(kept[name]), flush=True)
        content = {"versions": versions("distributed"), "dispatch_s": round(scheduler_s, 5)}
        write(path, "engine", kind, content | {"results": list(kept.values())})


if __name__ == "__main__":
    typer.run(main)
