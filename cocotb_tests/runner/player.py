"""Cocotb test that plays the runs of another process on the harness."""

import dataclasses
import itertools
import json
import os
import time
from pathlib import Path
from typing import Any

import cocotb

from eskin.cocotb_tests.bench.readout import go

RUN, OUTCOME, END = "run.json", "outcome.json", "end"
"""Files of a run and of its outcome, which complete a folder, and the file after the last run."""

RECORDED = ("events.bin", "events.txt", "classes.txt", "spikes.txt", "decisions.txt", "miso.txt")
"""Files that the harness may write."""

POLL_S = 0.005


@cocotb.test()
async def play(dut: Any) -> None:
    """Play the runs in the folders 0, 1, ... until the other process writes the file ``end``."""
    here, parent = Path.cwd(), os.getppid()
    for number in itertools.count():
        place = here / str(number)
        while not (place / RUN).exists():
            if (here / END).exists() and not (place / RUN).exists():
                return
            if os.getppid() != parent:  # the other process was killed
                raise SystemExit(1)
            time.sleep(POLL_S)
        given = [path for path in place.iterdir() if path.name != RUN]
        for path in given:
            path.rename(here / path.name)
        outcome = await go(dut, json.loads((place / RUN).read_text())["skip"])
        for path in given:
            (here / path.name).unlink()
        for name in RECORDED:
            if (here / name).exists():
                (here / name).rename(place / name)
        write_whole(place / OUTCOME, dataclasses.asdict(outcome))


def write_whole(path: Path, content: dict[str, Any]) -> None:
    """Write a JSON file that other processes see whole or not at all."""
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(content))
    draft.rename(path)
