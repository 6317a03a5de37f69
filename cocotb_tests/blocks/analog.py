"""Compare RTL and model for comparators with offset, noise, hysteresis and overdrive."""

from __future__ import annotations

import json
import random
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.analog import FRACTION_BITS, Comparators
from eskin.cocotb_tests.bench.block import JOB, job, report
from eskin.cocotb_tests.bench.readout import Bench, Mismatch
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.model.address_events import Events
    from eskin.model.readout import Stimulus

CLOCKS = 4000


def drive(config: ReadoutConfig, samples: np.ndarray, seed: int) -> Stimulus:
    """Return a stimulus with a sample tick every eight clocks, and a sink with random stalls."""
    from eskin.cocotb_tests.bench.stimuli import READY, ack_delays
    from eskin.model.readout import Stimulus

    rng = np.random.default_rng(seed)
    ticks = np.resize(samples, (CLOCKS // 8, config.taxels))
    return Stimulus.from_samples(
        config, ticks, clocks_per_sample=8, ready=READY["random"](rng), ack_delay=ack_delays("always", rng)
    )


def never_off_the_scale(config: ReadoutConfig, events: Events, counts: Counter[str]) -> None:
    """Check from the events that the references of LCS stay within full scale."""
    for y, x in np.ndindex(config.rows, config.columns):
        own = events["p"][(events["y"] == y) & (events["x"] == x)]
        levels = config.reference_reset + config.step * np.cumsum(np.where(own, 1, -1))
        if not ((levels >= -config.full_scale) & (levels < config.full_scale)).all():
            raise Mismatch(f"the reference of taxel ({y}, {x}) leaves the scale: {levels.tolist()}")
        counts["OnScale"] += 1
        counts["ends"] += int((levels == -config.full_scale).sum())
        counts["ends"] += int((levels == config.full_scale - config.step).sum())


@cocotb.test()
async def comparators_with_faults(dut: Any) -> None:
    """Play signals beyond full scale, slow signals with noise and offset, and pure noise."""
    config, rng = job()
    bench = Bench(dut, config, Path.cwd())
    counts: Counter[str] = Counter()
    code, high = 1 << FRACTION_BITS, config.full_scale
    offset = np.array([[rng.randint(-3 * code, 3 * code) for _ in range(config.taxels)] for _ in range(2)])
    angle = np.linspace(0, 6, CLOCKS // 8)[:, None] + np.arange(config.taxels)
    square = np.where(np.sin(angle) > 0, 2 * high, -2 * high - 1)
    runs = {
        "slow": (
            1.1 * high * np.sin(angle),
            Comparators(offset, noise=config.step * code, hysteresis=2 * code, seed=7),
        ),
        "over": (square, Comparators(offset, noise=code, seed=3)),
        "nothing but noise": (0 * angle, Comparators(noise=4 * high * code, seed=rng.randint(1, 1 << 30))),
    }
    for name, (signal, comparators) in runs.items():
        stimulus = drive(config, np.rint(signal).astype(np.int64), seed=len(name))
        events, given = await bench.check_given(name, stimulus, comparators)
        assert given.decisions is not None
        counts["events"] += len(events)
        counts["random"] += int((np.diff(given.decisions.astype(int), axis=0) != 0).sum())
        counts["both"] += int((given.decisions == 3).sum())
        if not config.encoder.late:
            never_off_the_scale(config, events, counts)
    report(counts)


@cocotb.test()
async def one_code_over_the_ends(dut: Any) -> None:
    """Hold a signal just beyond each end of the scale, and check the number of events."""
    config, _ = job()
    bench = Bench(dut, config, Path.cwd())
    counts: Counter[str] = Counter()
    high, step = config.full_scale, config.step
    for level, steps in ((high, high // step - 1), (-high - step - 1, high // step)):
        stimulus = drive(config, np.full((1, config.taxels), level), seed=1)
        events = await bench.check(f"{level} codes for ever", stimulus)
        if len(events) != steps * config.taxels:
            raise Mismatch(f"{len(events)} events at {level} codes, not {steps * config.taxels}")
        counts["NoneAtTheEnd"] += 1
    report(counts)


def run(config: ReadoutConfig, simulator: Any, test: str, folder: Path) -> dict[str, int]:
    """Run a test of this file in the harness; return its counts."""
    from eskin.cocotb_tests.runner.simulator import build

    work = {"config": config.to_dict(), "seed": random.Random(config.to_json()).randrange(1000)}
    build(config, simulator).test(__name__, folder, test, {JOB: json.dumps(work)})
    return dict(json.loads((folder / "counts.json").read_text()))
