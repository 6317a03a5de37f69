"""Compare the taxel's RTL with the independent model in every clock: thresholds, requests, masks and resets."""

import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.analog import ideal
from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import KINDS as INDEPENDENT
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.cases import axes, cases, pairs
from eskin.model.config import ReadoutConfig

PHASES, CLOCKS = 14, 160


KINDS = ("threshold", "near", "walk", "jump", "rest", "full", "over")
"""Critical sample codes: levels and their neighbours, walks, jumps, rest, and beyond the scale."""


class TaxelSteps:
    """Steps of a taxel, computed by the independent model."""

    def __init__(self, config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> None:
        self.config, self.rng, self.counts = config, rng, counts
        self.settings = Settings.of(config.to_dict())
        self.taxel = INDEPENDENT[config.encoding](self.settings)
        self.code = 0  # of the last sample
        self.signal = 0  # input of the analog comparators
        self.noisy = False  # the input is only noise
        self.ticks = 0
        self.tick = False

    def __iter__(self) -> Iterator[Step]:
        """Yield phases of random inputs of every kind, with masks and resets."""
        rng, config = self.rng, self.config
        # Set by registers, where there are any: as the configuration has it.
        host = {"step": 1, "leak_shift": config.leak_shift, "window_period": config.window_period}
        zero = ("enable", "granted", "tick", "ask", "decay", "sample", "above", "below")
        yield Step(host | dict.fromkeys(zero, 0), {})
        for phase in range(PHASES):
            kind = KINDS[phase % len(KINDS)]
            samples, grants = rng.choice([1.0, 0.3, 0.1]), rng.choice([1.0, 1.0, 0.5, 0.1])
            masked = 0.05 if phase % 3 == 2 else 0.0
            self.noisy = config.frontend == "analog" and kind == "jump"
            for _ in range(CLOCKS):
                sample = self.next_code(kind) if rng.random() < samples else None
                yield self.clock(rng.random() >= masked, rng.random() < grants, sample)
                if rng.random() < 0.01:
                    yield from self.pulse_reset()
            for _ in range(rng.randint(1, 3)):
                yield self.clock(True, rng.random() < 0.5, self.next_code("jump"), rst=True)

    def next_code(self, kind: str) -> int:
        """Return the next code of a kind."""
        rng, high, step = self.rng, self.config.full_scale, self.settings.step
        middle, width = self.taxel.reference_code(), self.taxel.half_width()
        code = {
            "threshold": rng.choice([middle + width + self.config.encoder.strict, middle - width]) + rng.randint(-1, 1),
            "near": middle + rng.randint(-2 * step, 2 * step),
            "walk": self.code + rng.randint(-step - 1, step + 1),
            "jump": rng.randrange(-high, high),
            "rest": self.code,
            "full": rng.choice([-high, high - 1]),
            "over": rng.choice([-4 * high, -high - 1, high, 4 * high]),
        }[kind]
        if kind != "over" or self.config.frontend == "digital":  # an analog signal may leave the scale
            code = min(max(code, -high), high - 1)
        self.code = code
        return code

    def step(self, inputs: dict[str, int], edge: bool = True) -> Step:
        """Return a step with all outputs of the model; the polarity only during a request."""
        taxel, config = self.taxel, self.config
        request = taxel.request if inputs["enable"] else None
        outputs = {"request": int(request is not None)}
        if request is not None and config.has_polarity:
            outputs["polarity"] = request
        if config.frontend == "analog":
            outputs |= {"compare": taxel.strobe, "reference_code": taxel.reference_code()}
            if config.closes:
                outputs["half_width"] = taxel.half_width()
        state = f"sample {taxel.sample}, reference {taxel.reference}, request {taxel.request}"
        return Step(inputs, outputs, f"{state}, half-width {taxel.half_width()}", edge)

    def clock(self, enable: bool, granted: bool, sample: int | None, rst: bool = False) -> Step:
        """Return the step of a clock, and advance the model."""
        config, taxel, counts = self.config, self.taxel, self.counts
        # One decay tick per leak_period, at a phase that is not 0, as in a higher row.
        decay = self.tick and self.ticks % config.leak_period == 2 % config.leak_period
        inputs: dict[str, int] = {"rst": rst, "enable": enable, "granted": granted, "tick": self.tick, "decay": decay}
        # A host may have the comparators asked at any time, if they count in every clock.
        ask = sample is not None or (config.decide_every == "clock" and self.rng.random() < 0.02)
        inputs |= {"sample_valid": sample is not None, "ask": ask} | ({} if sample is None else {"sample": sample})
        if rst and config.reset == "async":
            taxel.reset()
        decisions = None
        if config.frontend == "analog":
            decisions = self.decide()
            inputs |= {"above": decisions[0], "below": decisions[1]}
        step = self.step(inputs)
        request, reference = taxel.request if enable else None, taxel.reference_code()
        if rst:
            taxel.reset()
        else:
            digital = sample if config.frontend == "digital" else None
            taxel.clock(
                enabled=enable,
                taken=granted,
                sample=digital,
                tick=self.tick,
                leak=decay,
                decisions=decisions,
                ask=ask,
            )
        counts["clocks"] += 1
        counts["asked"] += taxel.strobe
        counts["disabled"] += not enable
        counts["closed"] += taxel.half_width() < self.settings.step
        counts["charged"] += config.encoder.leaks and taxel.reference != 0
        if request is not None:
            counts[("off", "on")[request] if granted else "waiting"] += 1
        if decisions is not None and enable and taxel.request is None:
            counts["at the top"] += decisions[0] and reference + self.settings.step > self.settings.top
            counts["at the bottom"] += decisions[1] and reference - self.settings.step < self.settings.bottom
        self.signal = self.signal if sample is None else sample
        self.tick = sample is not None and not rst
        self.ticks += self.tick
        return step

    def decide(self) -> tuple[bool, bool]:
        """Return the comparator decisions: wrong while nobody asks, and random in a noise phase."""
        if self.noisy:
            return self.rng.random() < 0.5, self.config.has_polarity and self.rng.random() < 0.5
        above, below = ideal(self.config, self.signal, self.taxel.reference_code(), self.taxel.half_width())
        if not self.taxel.strobe:
            return not above, self.config.has_polarity and not below
        return above, below

    def pulse_reset(self) -> Iterator[Step]:
        """Yield a pulse of rst between two clock edges, which affects only asynchronous resets."""
        for rst in (1, 0):
            if self.config.reset == "async":
                self.taxel.reset()
                self.tick = False
            yield self.step({"rst": rst, "enable": 1, "granted": 0}, edge=False)
        self.counts["pulses"] += 1


# -- configurations ----------------------------------------------------------------------------------


TIMINGS = (
    {"closing_shift": 2, "window_period": 3, "leak_shift": 3, "leak_period": 5, "fraction_bits": 4},
    {"closing_shift": 0, "window_period": 1, "leak_shift": 1, "leak_period": 1, "fraction_bits": 0},
    {"closing_shift": 16, "window_period": 5, "leak_shift": 5, "leak_period": 3, "fraction_bits": 12},
)


def breadth() -> list[ReadoutConfig]:
    """Return configurations in which any two settings of a taxel meet; half of them start near an end of the scale."""
    one = ReadoutConfig(rows=1, columns=1)
    kinds = axes("encoding", "frontend", "reset", "decide_every", "registers")
    configs = []
    for number, config in enumerate(pairs(one, **kinds, resolution=(5, 1, 10), timing=TIMINGS)):
        level = config.grid * [0, 1, 3][number % 3] % config.full_scale
        if config.frontend == "analog":  # near an end; only an analog signal can exceed full scale
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
    slow = leaky.replace(frontend="analog", leak_shift=16, resolution=5)
    both = [c for c in cases(slow, **axes("encoding")) if c.encoder.leaks and c.has_polarity]
    configs += [config.replace(reference_reset=reset) for config in both for reset in (2047, -2048)]
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


@pytest.mark.representative(
    "icarus-lcs-digital",
    "icarus-lcs-analog",
    "icarus-cw-lcs-digital",
    "icarus-cw-lcs-analog",
    "icarus-nlcs-digital",
    "icarus-nlcs-analog",
    block="taxel",
)
@pytest.mark.parametrize("config", breadth(), ids=lambda config: f"icarus-{name(config)}")
def test_taxel_equals_its_reference_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_taxel", TaxelSteps, tmp_path, seed=1)
    assert counts["clocks"] >= PHASES * CLOCKS
    assert counts["checks"] >= counts["clocks"]
    happened = {"on", "waiting", "disabled", "pulses"}
    happened |= {"off"} if config.has_polarity else set()
    happened |= {"charged"} if config.encoder.leaks else set()
    happened |= {"closed"} if config.closes else set()
    happened |= {"asked"} if config.frontend == "analog" else set()
    stays = not config.encoder.leaks or config.leak_shift == 16  # a reference that leaks much comes to no end
    if config.frontend == "analog" and config.has_polarity and config.reference_reset and stays:
        happened |= {"at the bottom" if config.reference_reset < 0 else "at the top"}
    assert all(counts[what] > 0 for what in happened), counts
