"""Measure the difference between the integer leak of N-LCS and float models, in % of the event rate.

``python benchmarks/leak.py --json benchmarks/results/leak.json`` measures the table of docs/reference/encoders.md.

``fractions``: constant inputs, integers with F fraction bits against the same leak ticks in floating point;
the worst of many inputs from 1.5 D to full scale. ``exponential``: the same inputs, the leak ticks in float
against the period tau ln(x / (x - D)) of a continuous leak; least and most. ``moving``: texture-like
signals, the default fraction bits against a float model that leaks at every sample.
"""

import json
import math
from typing import Annotated, Any

import numpy as np
import typer
from encoder import texture_like
from measure import JsonFile, write
from numba import njit

from eskin.model.config import ReadoutConfig
from eskin.model.taxel import count_events

RESOLUTIONS = (4, 6, 8, 10)
FRACTIONS = (4, 6, 8, 10, 12)
LEAKS = ((6, 63), (5, 127))
"""``leak_shift`` and ``leak_period`` of leaks with a time constant close to 0.2 s at 20 kS/s."""


@njit
def float_events(x: Any, step: float, keep: float, period: int) -> int:
    """Return the events of a float N-LCS taxel whose reference is multiplied by ``keep`` once per period."""
    u, events = 0.0, 0
    for tick in range(len(x)):
        leak = u * (1.0 - keep) if tick % period == 0 else 0.0
        if x[tick] - u > step:
            u += step
            events += 1
        u -= leak
        more = max(math.ceil((x[tick] - u) / step) - 1, 0)
        u += more * step
        events += more
    return events


def leaky(resolution: int, shift: int, period: int, **parameters: Any) -> ReadoutConfig:
    """Return the configuration of one N-LCS taxel."""
    leak = {"leak_shift": shift, "leak_period": period, "clocks_per_sample": 2**16}
    return ReadoutConfig(rows=1, columns=1, encoding="nlcs", resolution=resolution, **leak, **parameters)


def constant_inputs(resolution: int, shift: int, leaks: int) -> dict[str, Any]:
    """Return the differences for constant inputs."""
    config = leaky(resolution, shift, 1)
    levels = np.unique(np.geomspace(1.5 * config.step, config.full_scale - 1, 25).round().astype(np.int16))
    worst = dict.fromkeys(FRACTIONS, 0.0)
    ideal = []
    for level in levels[levels > config.step].tolist():
        x = np.full((leaks, 1), level, np.int16)
        floats = float_events(x[:, 0], float(config.step), 1 - 2.0**-shift, 1)
        tau = config.tau_s * config.sample_rate_hz
        ideal.append(100 * (floats / (leaks / (tau * math.log(level / (level - config.step)))) - 1))
        for bits in FRACTIONS:
            integers = int(count_events(config.replace(fraction_bits=bits), x)[0])
            worst[bits] = max(worst[bits], abs(100 * (integers / floats - 1)))
    return {"fractions": worst, "exponential": [min(ideal), max(ideal)]}


def moving_inputs(resolution: int, shift: int, period: int, ticks: int) -> float:
    """Return the difference to a leak at every sample for texture-like signals, in % of all events."""
    config = leaky(resolution, shift, period)
    signals = texture_like(ticks, 16, config, seed=1)
    keep = math.exp(-1 / (config.tau_s * config.sample_rate_hz))
    floats = sum(float_events(line.copy(), float(config.step), keep, 1) for line in signals.T)
    integers = sum(int(count_events(config, line[:, None])[0]) for line in signals.T)
    return 100 * (integers / floats - 1)


def main(
    json_file: JsonFile = None,
    ticks: Annotated[int, typer.Option(min=1000, help="leaks, or samples, of every input")] = 200_000,
) -> None:
    """Compare the event rates of integer N-LCS with those of float models."""
    results = []
    for resolution in RESOLUTIONS:
        for shift, period in LEAKS:
            found = constant_inputs(resolution, shift, ticks)
            found |= {"resolution": resolution, "leak_shift": shift, "leak_period": period}
            found["moving"] = moving_inputs(resolution, shift, period, ticks)
            results.append(found)
            print(json.dumps(found), flush=True)
    write(json_file, "leak", f"--ticks {ticks}", {"ticks": ticks, "sample_bits": 12, "results": results})


if __name__ == "__main__":
    typer.run(main)
