"""What runs inside the simulator: one cocotb test of the project again and again, for the original and every mutant."""

from __future__ import annotations

import importlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import cocotb
from cocotb.task import Task
from cocotb.triggers import SimTimeoutError, Timer, with_timeout
from cocotb.utils import get_sim_time

JOB = "ESKIN_MUTANTS_JOB"
"""Environment variable with the job, as JSON: module and name of the test, numbers of the mutants."""

VERDICTS = "verdicts.jsonl"
SLOWER = 3
"""Times the original's time that a mutant may take before it counts as endless."""

LEFT = ("counts.json", "progress.jsonl")
"""What a test leaves for the one who called it: in the end that of the original."""


@cocotb.test()
async def all_mutants(dut: Any) -> None:
    """Run the test with the original, then with one mutant after the other; a line of VERDICTS for each."""
    job = json.loads(os.environ[JOB])
    test = getattr(importlib.import_module(job["module"]), job["test"]).func
    number = dut.mutant if hasattr(dut, "mutant") else dut.dut.mutant
    tasks: list[Task[Any]] = []
    start_soon = cocotb.start_soon

    def started(coroutine: Any) -> Any:
        tasks.append(start_soon(coroutine))
        return tasks[-1]

    cocotb.start_soon = started  # type: ignore[assignment]
    longest = 0.0
    with Path(VERDICTS).open("w", buffering=1) as verdicts:
        for mutant in [0, *job["mutants"]]:
            verdicts.write(json.dumps({"begins": mutant}) + "\n")
            if hasattr(dut, "clk") and hasattr(dut, "mutant"):
                dut.clk.value = 0
            number.value = mutant
            await Timer(10, "ns")
            begun = get_sim_time("ns")
            verdict, why = "passed", ""
            try:
                await (with_timeout(test(dut), longest * SLOWER, "ns", round_mode="ceil") if mutant else test(dut))
            except SimTimeoutError:
                verdict = "endless"
            except BaseException as error:
                verdict, why = "failed", str(error)[:200]
            for task in tasks:
                task.cancel()
            tasks.clear()
            verdicts.write(json.dumps({"mutant": mutant, "verdict": verdict, "why": why}) + "\n")
            if not mutant:
                if verdict != "passed":
                    return
                longest = get_sim_time("ns") - begun + 1000
                for name in filter(os.path.exists, LEFT):
                    shutil.copy(name, f"{name}.original")
            elif verdict == "endless" and not hasattr(dut, "mutant"):  # the harness is in the middle of a run
                break
    for name in LEFT:
        if os.path.exists(f"{name}.original"):
            shutil.copy(f"{name}.original", name)
    Path("mismatch.txt").unlink(missing_ok=True)
