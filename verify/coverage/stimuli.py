"""Stimuli of the coverage runs: co-simulation testbenches with additional rare cases."""

import random
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eskin.cocotb_tests.bench.host import pins_of
from eskin.cocotb_tests.bench.random_run import GAPS, SIGNALS, SINKS, RandomRun
from eskin.cocotb_tests.bench.spi import Timing, waveform
from eskin.cocotb_tests.blocks.analog import play_faults as play_comparators
from eskin.cocotb_tests.blocks.axi import run as play_axi
from eskin.cocotb_tests.blocks.classifier import cosimulate as play_scans
from eskin.cocotb_tests.blocks.frame import play as play_frames
from eskin.cocotb_tests.blocks.host import play as play_host
from eskin.cocotb_tests.runner.block import Steps, play_steps
from eskin.cocotb_tests.touch import noise
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.registers.description import Register, registers
from eskin.model.registers.spi import Pins, transfer
from eskin.verify.soak import play

VERILATOR: Any = "verilator"
MASKS = (0, 100, 0, 3, 500)

LONG: list[dict[str, Any]] = [
    {"signal": "square", "sink": "always", "gap": 300, "masks": 0},
    {"signal": "square", "sink": "always", "gap": 12, "masks": 0},
    {"signal": "hold", "sink": "always", "gap": 12, "masks": 0},
    {"signal": "hold", "sink": "random", "gap": 3, "masks": 3},
    {"signal": "walk", "sink": "always", "gap": 70, "masks": 3},
    {"signal": "noise", "sink": "random", "gap": 3, "masks": 300, "share": 0.1},
    {"signal": "noise", "sink": "always", "gap": 70, "masks": 100, "share": 0.5},
    {"signal": "near", "sink": "always", "gap": 1, "masks": 0},
]
"""Stimuli that need many clocks: both ends of the scale, closing windows, and masks with one taxel or none."""


def readout(config: ReadoutConfig, folder: Path) -> None:
    """Simulate a readout with every kind of signal and sink, at all sample rates and masks."""
    short = [
        {"signal": SIGNALS[number // len(SINKS)], "sink": SINKS[number % len(SINKS)]}
        | {"gap": GAPS[number % len(GAPS)], "masks": MASKS[number % len(MASKS)]}
        for number in range(len(SIGNALS) * len(SINKS))
    ]
    # A link with a handshake takes longer to reach both ends, and so does an array of more than nine taxels.
    longer = -(-config.taxels // 9)
    clocks = (12_000 if config.protocol.asynchronous else 4000) * longer
    # Runs so short that nothing happens before the next reset, with a constant signal.
    rest = {"signal": "hold", "sink": "always", "gap": 300, "masks": 0}
    parts = [*((one, 300) for one in short), *((one | {"gap": longer * one["gap"]}, clocks) for one in LONG)]
    parts += [(rest, few) for few in (2, 3, 4)]
    play([RandomRun(config, seed, clocks, **own) for seed, (own, clocks) in enumerate(parts)], VERILATOR)
    if config.frontend == "analog":  # comparators with offset, noise and hysteresis, of which both may fire
        play_comparators(config, VERILATOR, folder)


def _words(register: Register) -> Iterator[int]:
    """Yield test words for a register: limits of its fields and beyond, alternating bits, all ones, the reset value."""
    resting = {field.name: field.reset for field in register.fields}
    for field in register.fields:
        top = (1 << field.width) - 1
        middle = (field.least + field.most) // 2
        every_other = top // 3  # bits 0, 2, 4, ...
        ends = field.least, field.most, max(field.least - 1, 0), min(field.most + 1, top)
        for value in (*ends, middle, every_other, 2 * every_other):
            yield sum((resting | {field.name: value})[f.name] << f.low for f in register.fields)
    yield (1 << 32) - 1
    yield register.reset


def directed_host(config: ReadoutConfig, rng: random.Random) -> list[Any]:
    """Return SPI pins of a host that writes and reads every register and runs every test mode."""
    found = {register.name: register for register in registers(config)}
    pins: list[Any] = [Pins()] * 4

    def write(address: int, *words: int, gap: int = 3) -> None:
        pins.extend(waveform(transfer(address, list(words), True), Timing(2, 2, gap=gap)))

    def read(address: int, count: int = 1) -> None:
        pins.extend(waveform(transfer(address, [0] * count, False), Timing(2, 4)))

    for register in found.values():
        for word in _words(register):
            write(register.address, word, gap=rng.choice([3, 40]))
        read(register.address)
        if register.writable:
            write(register.address, register.reset)
    test = found["test"]
    modes = [(1, 0, 0), (1, 1, 2), (2, 0, 0), (2, 1, 1), (0, 0, 0), *((2, 1, interval) for interval in range(16))]
    for number, (mode, turns, interval) in enumerate(modes):
        values = {"mode": mode, "turns": turns, "interval": interval, "on": number % 2}
        if number % 2:
            values |= {"row": config.rows - 1, "column": config.columns - 1}
        write(test.address, sum(values.get(f.name, 0) << f.low for f in test.fields), gap=60)
    write(test.address, 2)
    write(test.address, 0)
    settings = [register for register in found.values() if register.writable and register is not test]
    for number in range(40):  # again and again, at other clocks of what the array does
        for register in settings[:3]:
            write(register.address, 1 if register.name == "control" else register.reset, gap=3 + number)
        write(test.address, 1, gap=30 + number)
        write(test.address, 0, gap=30 + number)
    for bits in (1, 15, 16, 47):
        cut = transfer(0x10, [2], True)[:bits]
        pins.extend(waveform(cut, Timing(2, 2)))
    read(0x0001)
    read(0x7FFF)
    read(0, 18)
    for address in (0x30, 0x7FFC, 0x5554, 0x2AA8):  # holes; the address behind the last is the first again
        write(address, rng.getrandbits(32), rng.getrandbits(32))
        read(address, 2)
    return [*pins, *pins_of(config, 2000, rng)]


def host(config: ReadoutConfig, folder: Path) -> None:
    """Simulate a host that changes all settings while the array sends events."""
    for seed, anything in ((5, False), (6, config.frontend == "analog")):
        play_host(config, VERILATOR, folder, seed, directed_host(config, random.Random(seed)), anything)


def alone(top: str, steps: Steps, *seeds: int) -> Callable[[Any, Path], None]:
    """Return a function that compares one block with its model, with several seeds."""
    return partial(_play_block, top, steps, seeds)  # which, unlike a nested function, another process can take


def _play_block(top: str, steps: Steps, seeds: Sequence[int], config: Any, folder: Path) -> None:
    for seed in seeds:
        play_steps(getattr(config, "skin", config), VERILATOR, top, steps, folder, seed)


def axi(config: BusConfig, folder: Path) -> None:
    """Simulate a readout behind AXI with every kind of sink, and a host that uses all registers."""
    for seed, sink in enumerate(SINKS * 2):
        play_axi(config, folder, seed, sink, 16_000, VERILATOR)


def frame(config: FrameConfig, folder: Path) -> None:
    """Simulate a frame readout with every kind of ADC and receiver."""
    scale = config.readout.full_scale
    samples = np.random.default_rng(config.taxels).integers(-scale, scale, (400, config.taxels))
    for seed in range(1, 5):
        play_frames(config, VERILATOR, folder, seed, samples)


def classifier(config: ClassifierConfig, folder: Path) -> None:
    """Simulate random networks with events at all rates, and with bins that end too early."""
    for seed in range(12):
        play_scans(config, VERILATOR, folder, seed)
        play_scans(config, VERILATOR, folder, seed, "scans_begin_at_any_time")


def chip(config: ChipConfig, folder: Path) -> None:
    """Simulate a texture scan on a chip with readout and classifier."""
    noise.play(config, VERILATOR, folder)
