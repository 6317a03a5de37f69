"""Compare the taxel's RTL with the reference taxel in every clock: thresholds, requests, masks and resets."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.cocotb_tests.bench.block import Block, Checker, job, report
from eskin.cocotb_tests.bench.reference import TaxelReference
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry

PHASES, CLOCKS = 14, 160


class SampleSource:
    """Generator of critical sample codes: levels and their neighbours, walks, jumps, and rest."""

    KINDS = ("threshold", "near", "walk", "jump", "rest", "full", "over")

    def __init__(self, config: ReadoutConfig, taxel: TaxelReference, rng: random.Random) -> None:
        self.config, self.taxel, self.rng = config, taxel, rng
        self.code = 0

    def next(self, kind: str) -> int:
        """Return the next code of a kind."""
        taxel, rng, high = self.taxel, self.rng, self.config.full_scale
        if kind == "threshold":
            self.code = rng.choice([taxel.upper, taxel.lower]) + rng.randint(-1, 1)
        elif kind == "near":
            self.code = taxel.reference // taxel.unit + rng.randint(-2 * taxel.step, 2 * taxel.step)
        elif kind == "walk":
            self.code += rng.randint(-taxel.step - 1, taxel.step + 1)
        elif kind == "jump":
            self.code = rng.randrange(-high, high)
        elif kind == "full":
            self.code = rng.choice([-high, high - 1])
        elif kind == "over" and self.config.frontend == "analog":  # an analog signal may leave the scale
            self.code = rng.choice([-4 * high, -high - 1, high, 4 * high])
            return self.code
        self.code = min(max(self.code, -high), high - 1)
        return self.code


class TaxelBench:
    """A taxel with its reference model."""

    def __init__(self, dut: Any, config: ReadoutConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.reference = TaxelReference(config)
        self.source = SampleSource(config, self.reference, rng)
        self.signal = 0  # input of the analog comparators
        self.noisy = False  # the input is only noise
        self.ticks = 0
        self.tick = False
        # Set by registers, where there are any: as the configuration has it.
        self.block.drive(step=1, leak_shift=config.leak_shift, window_period=config.window_period)

    def compare(self, enable: bool) -> None:
        """Compare all outputs with the reference; the polarity only during a request."""
        reference, block = self.reference, self.block
        state = {**vars(reference), "enable": enable}
        del state["config"]
        request = reference.request(enable)
        self.check.equal("request", request, block.read("request"), state)
        if request and self.config.has_polarity:
            self.check.equal("polarity", reference.polarity, block.read("polarity"), state)
        if self.config.frontend == "analog":
            code = reference.reference // reference.unit
            self.check.equal("reference_code", code, block.read_signed("reference_code"), state)
            if self.config.closes:
                self.check.equal("half_width", reference.half_width, block.read("half_width"), state)

    async def clock(self, *, enable: bool, granted: bool, sample: int | None, rst: bool = False) -> None:
        """Drive the inputs, compare the outputs, and generate a clock edge."""
        config, block, reference = self.config, self.block, self.reference
        # One decay tick per leak_period, at a phase that is not 0, as in a higher row.
        decay = self.tick and self.ticks % config.leak_period == 2 % config.leak_period
        block.drive(rst=rst, enable=enable, granted=granted, tick=self.tick, decay=decay)
        block.drive(sample_valid=sample is not None)
        if sample is not None:
            block.drive(sample=sample)
        await block.settle()
        decision = None
        if config.frontend == "analog":  # the comparators use the reference from the RTL
            decision = self.decide(block.read_signed("reference_code"))
            block.drive(above=decision[0], below=decision[1])
            await block.settle()
        if rst and config.reset == "async":
            reference.reset()
        self.compare(enable)
        self._count(enable, granted, decision)
        await block.edge()
        if rst:
            reference.reset()
        else:
            digital = config.frontend == "digital"
            reference.clock(
                enable=enable,
                tick=self.tick,
                granted=granted,
                decay=decay,
                sample=sample if digital else None,
                decision=decision,
            )
        if sample is not None:
            self.signal = sample
        self.tick = sample is not None and not rst
        self.ticks += self.tick

    def decide(self, code: int) -> tuple[bool, bool]:
        """Return the comparator decisions for a code, or random ones in a noise phase."""
        if self.noisy:
            return self.rng.random() < 0.5, self.config.has_polarity and self.rng.random() < 0.5
        width = self.block.read("half_width") if self.config.closes else self.config.step
        above = self.signal >= code + width + self.config.encoder.strict
        return above, self.config.has_polarity and self.signal < code - width

    def _count(self, enable: bool, granted: bool, decision: tuple[bool, bool] | None) -> None:
        """Count the cases that occurred."""
        counts, reference = self.check.counts, self.reference
        if decision is not None:
            rise = reference.half_width * reference.unit
            counts["at the top"] += decision[0] and not reference.on_scale(reference.reference + rise)
            counts["at the bottom"] += decision[1] and not reference.on_scale(reference.reference - rise)
        counts["clocks"] += 1
        if self.reference.request(enable):
            if granted:
                counts["on" if self.reference.polarity else "off"] += 1
            else:
                counts["waiting"] += 1
        counts["disabled"] += not enable
        counts["closed"] += self.reference.closed > 0
        counts["charged"] += self.config.encoder.leaks and self.reference.reference != 0

    async def pulse_reset(self) -> None:
        """Pulse rst between two clock edges, which affects only asynchronous resets."""
        self.block.drive(rst=1, enable=1, granted=0)
        await self.block.settle()
        if self.config.reset == "async":
            self.reference.reset()
        self.compare(True)
        self.block.drive(rst=0)
        await self.block.settle()
        self.compare(True)
        self.check.counts["pulses"] += 1
        if self.config.reset == "async":
            self.tick = False

    async def hold_reset(self) -> None:
        """Assert rst for a few clocks during activity."""
        for _ in range(self.rng.randint(1, 3)):
            await self.clock(enable=True, granted=self.rng.random() < 0.5, sample=self.source.next("jump"), rst=True)
        self.check.counts["resets"] += 1


@cocotb.test()
async def taxel_follows_its_reference(dut: Any) -> None:
    """Play phases of random inputs of every kind."""
    config, rng = job()
    bench = TaxelBench(dut, config, rng)
    bench.block.drive(enable=0, granted=0, tick=0, decay=0, sample=0, sample_valid=0, above=0, below=0)
    await bench.block.reset()
    for phase in range(PHASES):
        kind = SampleSource.KINDS[phase % len(SampleSource.KINDS)]
        samples, grants = rng.choice([1.0, 0.3, 0.1]), rng.choice([1.0, 1.0, 0.5, 0.1])
        masked = rng.choice([0.0, 0.0, 0.05])
        bench.noisy = config.frontend == "analog" and kind == "jump"
        for _ in range(CLOCKS):
            await bench.clock(
                enable=rng.random() >= masked,
                granted=rng.random() < grants,
                sample=bench.source.next(kind) if rng.random() < samples else None,
            )
            if rng.random() < 0.01:
                await bench.pulse_reset()
        await bench.hold_reset()
    report(bench.check.counts)


@cocotb.test()
async def overloaded_taxel_raises_a_request_every_clock(dut: Any) -> None:
    """Step to full scale, and check for a request in every clock until the reference has caught up."""
    config, _ = job()
    bench = TaxelBench(dut, config, random.Random(0))
    bench.block.drive(enable=0, granted=0, tick=0, decay=0, sample=0, sample_valid=0, above=0, below=0)
    await bench.block.reset()
    top = config.full_scale - 1
    await bench.clock(enable=True, granted=True, sample=top)
    await bench.clock(enable=True, granted=True, sample=None)
    steps = -(-top // config.step) - 1 if config.encoder.strict else top // config.step
    for step in range(steps + 5):
        bench.check.holds("NoBubble", bench.block.read("request") == (step < steps), f"step {step} of {steps}")
        await bench.clock(enable=True, granted=True, sample=None)
    report(bench.check.counts)


# -- configurations ----------------------------------------------------------------------------------


def breadth() -> list[ReadoutConfig]:
    """Return configurations with every encoding, front end and resolution."""
    configs = []
    kinds = [("digital", 1), ("digital", 5), ("analog", 10)]
    for number, (encoding, (frontend, resolution)) in enumerate(itertools.product(registry.NAMES, kinds)):
        variant = number + number // 3
        config = ReadoutConfig(
            rows=1,
            columns=1,
            encoding=encoding,  # type: ignore[arg-type]
            frontend=frontend,  # type: ignore[arg-type]
            resolution=resolution,
            reset="async" if variant % 2 else "sync",
            decide_every="sample" if variant % 4 > 1 else "clock",
            closing_shift=[2, 0, 1, 16][number % 4],
            window_period=[3, 1, 5][number // 2 % 3],
            leak_shift=[3, 1, 5][number % 3],
            leak_period=[5, 1, 3][number // 2 % 3],
            fraction_bits=[4, 0, 12][number % 3],
        )
        level = config.grid * [0, 1, 3][number % 3] % config.full_scale
        if frontend == "analog":  # near an end of the scale; only an analog signal can exceed full scale
            low = config.has_polarity and number % 2
            level = level - config.full_scale if low else config.full_scale - config.grid - level
        configs.append(config.replace(reference_reset=level))
    # Windows that close in many steps, decided every clock and once a sample, and the smallest words.
    closing = ReadoutConfig(rows=1, columns=1, encoding="cw-lcs", resolution=3, closing_shift=3, window_period=2)
    configs += [closing, closing.replace(decide_every="sample", frontend="analog", reset="async", closing_shift=16)]
    configs.append(configs[-1].replace(sample_bits=4, resolution=1))
    # Wide words compared in full, and leaks whose k, P and F have nothing to do with each other, from the top code on.
    leaky = ReadoutConfig(rows=1, columns=1, encoding="nlcs", leak_period=1)
    configs += [
        closing.replace(sample_bits=24, resolution=20, window_period=5, reset="async"),
        leaky.replace(sample_bits=16, resolution=9, leak_shift=16, fraction_bits=3, reference_reset=7 * 2**12),
        leaky.replace(sample_bits=24, leak_shift=2, leak_period=4, fraction_bits=7, reference_reset=2**23 - 1),
    ]
    # Both ends of the scale, with a leak that lets a reference get there.
    both = [encoder.name for encoder in registry.ENCODERS if encoder.leaks and encoder.polarity]
    configs += [
        leaky.replace(encoding=encoding, frontend="analog", leak_shift=16, resolution=5, reference_reset=reset)
        for encoding in both
        for reset in (2047, -2048)
    ]
    # Settings at run time; the analog taxel shows its reference, and so how the leak is rounded.
    settable = leaky.replace(registers="spi", frontend="analog")
    configs += [settable.replace(leak_shift=1), settable.replace(leak_shift=4, reference_reset=2040)]
    configs.append(closing.replace(registers="spi", frontend="analog"))
    return configs


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return (
        f"{config.encoding}-{config.frontend}-{config.sample_bits}b-{config.resolution}b-{config.reset}"
        f"-{config.decide_every}-m{config.closing_shift}-k{config.leak_shift}"
        + f"-{config.registers}"
        * (config.registers != "none")
    )


@pytest.mark.parametrize("config", breadth(), ids=lambda config: f"icarus-{name(config)}")
def test_taxel_equals_its_reference_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_taxel", "taxel_follows_its_reference", tmp_path, seed=1)
    assert counts["clocks"] >= PHASES * CLOCKS
    assert counts["checks"] >= counts["clocks"]
    happened = {"on", "waiting", "disabled", "pulses", "resets"}
    happened |= {"off"} if config.has_polarity else set()
    happened |= {"charged"} if config.encoder.leaks else set()
    happened |= {"closed"} if config.closes else set()
    stays = not config.encoder.leaks or config.leak_shift == 16  # a reference that leaks much comes to no end
    if config.frontend == "analog" and config.has_polarity and config.reference_reset and stays:
        happened |= {"at the bottom" if config.reference_reset < 0 else "at the top"}
    assert all(counts[what] > 0 for what in happened), counts


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_overloaded_taxel_raises_a_request_every_clock(encoding: str, tmp_path: Path) -> None:
    config = ReadoutConfig(rows=1, columns=1, encoding=encoding, resolution=7)  # type: ignore[arg-type]
    test = "overloaded_taxel_raises_a_request_every_clock"
    counts = cosimulate(config, "icarus", "eskin_taxel", test, tmp_path, seed=1)
    assert counts["on"] > 100
    assert counts["NoBubble"] > counts["on"]
