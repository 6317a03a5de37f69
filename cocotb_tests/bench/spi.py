"""SPI pins of a host, clock by clock, for correct and faulty transfers."""

import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from eskin.model.registers.description import WORD_BITS, WORD_BYTES
from eskin.model.registers.spi import GAP_CLOCKS, LAG_CLOCKS, LEAD_CLOCKS, Pins, transfer


@dataclass(frozen=True)
class Timing:
    """Timing of an SPI host in clocks of the readout."""

    # SCK high and low
    high: int
    low: int
    # delays from the fall of CS to SCK, from SCK to the rise of CS, and with CS high
    lead: int = LEAD_CLOCKS
    lag: int = LAG_CLOCKS
    gap: int = GAP_CLOCKS


def waveform(bits: Iterable[int], timing: Timing) -> Iterator[Pins]:
    """Yield the pins of a transfer and of the pause after it, clock by clock."""
    yield from [Pins(cs_n=0)] * timing.lead
    for bit in bits:
        yield from [Pins(1, 0, bit)] * timing.high
        yield from [Pins(0, 0, bit)] * timing.low
    yield from [Pins(cs_n=0)] * max(timing.lag - timing.low, 0)
    yield from [Pins()] * timing.gap


def glitched(pins: Sequence[Pins], rng: random.Random) -> list[Pins]:
    """Return the pins of a transfer with a one-clock glitch on CS."""
    place = rng.randrange(len(pins) - 1)
    return [*pins[:place], pins[place]._replace(cs_n=1), *pins[place + 1 :]]


def cut(pins: Sequence[Pins], rng: random.Random) -> list[Pins]:
    """Return the pins of a transfer aborted at a random place."""
    place = rng.randrange(len(pins))
    return [*pins[:place], *[Pins(pins[max(place - 1, 0)].sck)] * (GAP_CLOCKS + 2), *[Pins()] * 2]


def noise(clocks: int, rng: random.Random) -> list[Pins]:
    """Return random pins."""
    return [Pins(rng.randrange(2), int(rng.random() < 0.1), rng.randrange(2)) for _ in range(clocks)]


def traffic(addresses: Sequence[int], words: Sequence[int], rng: random.Random, calm: bool = False) -> Iterator[Pins]:
    """Yield random correct and faulty SPI traffic without end.

    ``addresses`` and ``words`` are usual ones; ``calm`` traffic has only whole transfers within the stated times.
    """
    while True:
        write = rng.random() < 0.6
        low = rng.choice([2, 2, 3, 6]) if write else rng.choice([4, 4, 5])
        timing = Timing(rng.choice([2, 2, 3]), low, rng.choice([2, 5]), rng.choice([2, 4]), rng.choice([3, 3, 9, 60]))
        count = rng.choice([0, 1, 1, 1, 2, 3])
        address = rng.choice(addresses) if rng.random() < 0.9 else rng.randrange(1 << 15)
        pins = list(waveform(transfer(address, [rng.choice(words) for _ in range(count)], write), timing))
        kind = "whole" if calm else rng.choice(["whole"] * 6 + ["glitched", "cut", "noise"])
        if kind == "glitched":
            pins = glitched(pins, rng) + [Pins()] * GAP_CLOCKS
        elif kind == "cut":
            pins = cut(pins, rng)
        elif kind == "noise":
            pins = noise(200, rng) + [Pins()] * GAP_CLOCKS
        yield from pins


def next_address(address: int) -> int:
    """Return the address after a given one."""
    return (address + WORD_BYTES) % (1 << 15)


def any_word(rng: random.Random) -> int:
    """Return a random word, often the smallest or largest."""
    return rng.choice([0, 1, (1 << WORD_BITS) - 1, rng.getrandbits(WORD_BITS), rng.getrandbits(6)])
