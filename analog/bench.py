"""Play signals through analog taxels and the delivered Verilog together, clock by clock (runs in the simulator)."""

import json
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.analog.circuit import FrontEnd, Taxel
from eskin.analog.decision import compare
from eskin.base.files import digest
from eskin.base.workers.store import Store
from eskin.cocotb_tests.bench.block import JOB, Block
from eskin.model.classifier.words import unpacked
from eskin.model.config import ReadoutConfig

RESULT = "loop.npz"

Ask = Callable[[float, int, int], int]
"""Comparators of a taxel: signal, reference and half-width in codes -> 1 for above, plus 2 for below."""


def transistors(taxel: Taxel, gain: float, store: Store) -> Ask:
    """Return comparators of transistors. Equal inputs give equal decisions, so they are simulated once and stored."""

    def ask(x: float, reference: int, half_width: int) -> int:
        def simulated() -> int:
            above, below = compare(taxel, taxel.volts(x), reference, half_width, gain)
            return above + 2 * below

        return int(store.of(f"{x!r} {reference} {half_width}", simulated))

    return ask


def behaviour(taxel: Taxel, gain: float, noise_v: float, rng: np.random.Generator) -> Ask:
    """Return comparators that are ideal but for noise and the offsets of the taxel."""

    def ask(x: float, reference: int, half_width: int) -> int:
        inputs_v = taxel.inputs_v(taxel.volts(x), reference, half_width, gain)
        noisy = inputs_v + rng.normal(0, noise_v, len(inputs_v))
        high = [v > own for v, own in zip(noisy, taxel.offsets_v, strict=False)]
        return high[0] + 2 * (len(high) > 1 and not high[1])

    return ask


@cocotb.test()
async def play(dut: Any) -> None:
    """Let the comparators decide while their strobe is high; record decisions, events and strobes."""
    job = json.loads(os.environ[JOB])
    config, front_end = ReadoutConfig.from_dict(job["config"]), FrontEnd.from_dict(job["front_end"])
    signal = np.load(job["signal"])  # codes, shape (ticks, taxels)
    taxels = [Taxel(front_end, config, (own[0], own[1])) for own in job["offsets_v"]]
    ask = [_comparators(job, number, one) for number, one in enumerate(taxels)]
    block, clocks = Block(dut), len(signal) * config.clocks_per_sample
    decisions, strobes = np.zeros((clocks, config.taxels), np.uint8), np.zeros((clocks, config.taxels), bool)
    events, now = [], [0] * config.taxels
    block.drive(taxel_enable=-1, sample_valid=0, event_ready=1, above=0, below=0)
    await block.reset()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for clock in range(clocks):
            block.drive(sample_valid=clock % config.clocks_per_sample == 0)
            await block.settle()
            sample = signal[max(clock - 1, 0) // config.clocks_per_sample]  # it changed at the end of its clock
            asked = _asked(config, block, [float(x) for x in sample])
            for taxel, answer in zip(
                asked, pool.map(lambda n, inputs: ask[n](*inputs), asked, asked.values()), strict=True
            ):
                now[taxel] = answer
                strobes[clock, taxel] = True
            decisions[clock] = now
            block.drive(
                above=sum((code & 1) << taxel for taxel, code in enumerate(now)),
                below=sum((code >> 1) << taxel for taxel, code in enumerate(now)),
            )
            await block.settle()
            if block.read("event_valid"):
                events.append([clock, *(block.read(f"event_{part}") for part in ("row", "col", "polarity"))])
            await block.edge()
    np.savez(Path(RESULT), decisions=decisions, events=np.array(events, np.int64).reshape(-1, 4), strobes=strobes)


def _comparators(job: dict[str, Any], number: int, taxel: Taxel) -> Ask:
    """Return the comparators of a taxel: behavioural, or of transistors with a file of their decisions."""
    if job["noise_v"] is not None:
        return behaviour(taxel, job["gain"], job["noise_v"], np.random.default_rng(number))
    circuit = digest([job["front_end"], taxel.offsets_v, job["gain"]])
    return transistors(taxel, job["gain"], Store(Path(f"decisions{number}.json"), f"{job['code']} {circuit}"))


def _asked(config: ReadoutConfig, block: Block, sample: list[float]) -> dict[int, tuple[float, int, int]]:
    """Return the inputs of the comparators whose strobe is high: signal, reference and half-width by taxel."""
    strobe = block.read("compare")
    if not strobe:
        return {}
    codes = unpacked(block.read("reference_code"), config.taxels, config.sample_bits)
    word, bits = block.read("half_width"), config.half_width_bits
    widths = [
        word >> taxel * bits & (1 << bits) - 1 if config.closes else config.step for taxel in range(config.taxels)
    ]
    return {
        taxel: (sample[taxel], codes[taxel], widths[taxel]) for taxel in range(config.taxels) if strobe >> taxel & 1
    }
