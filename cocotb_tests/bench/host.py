"""Pins of a host that sets registers at random, and a signal that moves meanwhile."""

from __future__ import annotations

import itertools
import random
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.spi import Timing, any_word, traffic, waveform
from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import Register, registers
from eskin.model.registers.spi import Pins, transfer

if TYPE_CHECKING:  # importing it would compile the model in every simulator
    from eskin.model.host import HostRun
    from eskin.model.readout import Stimulus

MAX_WORDS = 4
"""Registers of an array, such as masks, that a host sets in one round; a large array has up to 384 of them."""


class Host(NamedTuple):
    """Pins of a host, clock by clock, and the model's run with them."""

    pins: list[Pins]
    run: HostRun

    @classmethod
    def play(cls, config: ReadoutConfig, stimulus: Stimulus, rng: random.Random) -> Host:
        """Return a host that sets all registers while a stimulus is played."""
        from eskin.model.host import play

        pins = pins_of(config, stimulus.clocks, rng)
        return cls(pins, play(config, stimulus, pins))

    def describe(self, config: ReadoutConfig) -> str:
        """Return what the host sets, and how many values of each setting were in use."""
        values = {name: count for name, count in happens(self.run).items() if count > 1}
        named = {"coarser": "resolution", "mode": "test_mode"}
        text = ", ".join(f"{named.get(name, name)} ({count} values)" for name, count in values.items())
        return f"{config.encoding}: a host sets over SPI, while events flow: {text}"


def happens(run: HostRun) -> Counter[str]:
    """Return how many values each setting had in a run; ``masks`` counts changes."""
    settings = run.stimulus.settings
    names = ("coarser", "leak_shift", "leak_period", "window_period", "mode")
    found = Counter({name: len(set(settings[name].tolist())) for name in names})
    return found + Counter(fields=len(np.unique(run.stimulus.choice)), masks=len(run.stimulus.enable_clock))


def words_for(register: Register, rng: random.Random, mode: int) -> list[int]:
    """Return words that a register accepts, to be written one after the other.

    A test pattern silences the taxels, so it ends at once. Every taxel is masked once, and then all are on again. A
    longest period is followed by the shortest, so that a counter is beyond its end.
    """
    words = [0, 0, 0] if register.name.startswith("mask") or register.name in ("window", "decay") else [0]
    if register.name == "test":
        words = [0, 0]
    for field in register.fields:
        drawn = rng.randint(field.least, field.most)
        values = [drawn] * len(words)
        if register.name == "test":
            values = {"mode": [mode, 0], "interval": [rng.choice([0, 1, 4])] * 2}.get(field.name, values)
        elif register.name.startswith("fields"):
            values = [sum(rng.choice([0, 0, 1, 1, 2, 2, 3]) << place for place in range(0, field.width, 2))]
        elif register.name.startswith("mask"):
            values = [drawn, drawn ^ field.most, field.most]
        elif field.name == "period":
            values = [field.most, field.least, drawn]
        words = [word | value << field.low for word, value in zip(words, values, strict=True)]
    return words


def pins_of(config: ReadoutConfig, clocks: int, rng: random.Random) -> list[Pins]:
    """Return SPI pins of a host: valid writes, reads, and faulty transfers."""
    pins: list[Pins] = [Pins()] * 5
    found = registers(config)
    wild = traffic([r.address for r in found], [any_word(rng) for _ in range(9)], rng)
    counters = [r for r in found if r.name in ("events", "stalls")]
    single = [r for r in found if r.writable and r.index is None]
    names = dict.fromkeys(r.name for r in found if r.index is not None)
    arrays = [[r for r in found if r.name == name] for name in names]
    modes = itertools.cycle([2, 1])
    while len(pins) < clocks:
        chosen = [*single, *(r for words in arrays for r in rng.sample(words, min(len(words), MAX_WORDS)))]
        for register in rng.sample(chosen, len(chosen)):
            for word in words_for(register, rng, next(modes) if register.name == "test" else 0):
                pins += waveform(transfer(register.address, [word], True), Timing(2, 2, gap=rng.choice([3, 20])))
        for counter in counters:
            pins += waveform(transfer(counter.address, [0], False), Timing(2, 4))
        pins += [*itertools.islice(wild, 150), *[Pins()] * 4]
    return pins[:clocks]


def walk(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[Any]:
    """Return a walk whose steps are large and small in turn, so that requests wait and references rest.

    An analog signal exceeds both ends of the scale.
    """
    size = np.repeat(rng.choice([1, 5, 20, 200], ticks // 40 + 1), 40)[:ticks, None]
    way = np.cumsum(rng.normal(0, 1, (ticks, config.taxels)) * size, axis=0)
    turned = np.abs((way + config.full_scale) % (4 * config.full_scale) - 2 * config.full_scale)
    samples = np.clip(turned - config.full_scale, -config.full_scale, config.full_scale - 1).astype(np.int32)
    return samples * 3 // 2 if config.frontend == "analog" else samples
