"""Cycle-accurate model of a readout with an SPI host: from pins to events and MISO."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, SETTABLE
from eskin.model.readout import TAKEN, WAITED, Stimulus, simulate_counted
from eskin.model.registers.file import RegisterFile, Settings
from eskin.model.registers.pattern import OFF, Pattern
from eskin.model.registers.settings import SETTING_DTYPE
from eskin.model.registers.spi import Pins, SpiSlave

OFF_FIELD = CHOICES.index("off")
COUNTED = {TAKEN: ("events_count",), WAITED: ("stalls_count",), 0: ()}


class HostRun(NamedTuple):
    """Results of simulating a readout with registers; pins, shape (clocks,), are sampled before each rising edge."""

    events: Events
    miso: NDArray[np.uint8]
    miso_enable: NDArray[np.uint8]
    stimulus: Stimulus
    """Inputs of the array: masks and settings from the registers."""


def play(config: ReadoutConfig, stimulus: Stimulus, pins: Sequence[Pins]) -> HostRun:
    """Simulate a readout with ``registers="spi"``, its stimulus and the pins of a host in every clock.

    The stimulus has the masks of ``taxel_enable``, and no settings.
    """
    if len(pins) != stimulus.clocks:
        raise InputError(f"pins must be given for each of the {stimulus.clocks} clocks, not {len(pins)}")
    seen = _of_registers(config, stimulus, pins)
    events, traffic = simulate_counted(config, seen)
    slave, file = SpiSlave(), RegisterFile(config)
    miso, enable = np.zeros((2, stimulus.clocks), np.uint8)
    for clock, levels in enumerate(pins):
        miso[clock], enable[clock] = slave.miso, slave.active
        write, read = slave.write, file.read(slave.address)
        slave.clock(levels, read)
        file.clock(write, COUNTED[int(traffic[clock])], file.signals()["control_clear"] == 1)
    return HostRun(events, miso, enable, seen)


def _of_registers(config: ReadoutConfig, stimulus: Stimulus, pins: Sequence[Pins]) -> Stimulus:
    """Return the stimulus with all register settings applied; no register write depends on an event."""
    slave, file = SpiSlave(), RegisterFile(config)
    outside = dict(zip(stimulus.enable_clock.tolist(), stimulus.enable, strict=True))
    mask, resolution = stimulus.enable[0], config.resolution
    masks: dict[int, NDArray[np.bool_]] = {}
    choices: dict[int, NDArray[np.uint8]] = {}
    rows: list[tuple[int, ...]] = []
    before: tuple[int, ...] = ()
    writes: list[int] = []

    def keep(values: dict[int, Any], value: NDArray[Any]) -> None:
        if not values or (value != next(reversed(values.values()))).any():
            values[clock] = value

    # An analog multiplexer gets its select lines from flops, one clock behind the register.
    selected = np.zeros(config.taxels, np.uint8)
    for clock, levels in enumerate(pins):
        signals = file.signals()
        mask = outside.get(clock, mask)
        clear = signals["control_clear"] == 1
        found = Settings.of(config, signals)
        test = Pattern(**{name: signals[f"test_{name}"] for name in Pattern._fields if f"test_{name}" in signals})
        pairs = _bits(found.receptive_fields, 2 * config.taxels)
        choice = pairs[0::2] + 2 * pairs[1::2]
        now = choice if config.frontend == "digital" else selected
        selected = choice
        if config.receptive_fields == SETTABLE:
            keep(choices, now)
        shown = found.mask if test.mode == OFF and not clear else 0
        keep(masks, mask & (_bits(shown, config.taxels) == 1) & (choice != OFF_FIELD))
        steady = (config.resolution - resolution, found.leak_shift, found.leak_period, found.window_period, *test)
        restarts = (int("test_mode" in file.written or clear), int("decay_period" in file.written or clear))
        if steady != before or any(restarts):
            rows.append((clock, *steady, *restarts))
            before = steady
        if "resolution_bits" in file.written:
            resolution = found.resolution
        write = slave.write
        if write is not None and config.frontend == "analog":
            writes.append(clock + 2)
        slave.clock(levels)
        file.clock(write)
    return dataclasses.replace(
        stimulus,
        enable_clock=np.array([*masks], np.int64),
        enable=np.array([*masks.values()], bool),
        settings=np.array(rows, SETTING_DTYPE),
        choice_clock=np.array([*choices], np.int64),
        choice=np.array([*choices.values()], np.uint8).reshape(-1, config.taxels),
        write_clock=np.array(writes, np.int64),
    )


def _bits(word: int, count: int) -> NDArray[np.uint8]:
    """Return the lowest bits of a word, the least significant first, shape (count,)."""
    stored = np.frombuffer(word.to_bytes(-(-count // 8), "little"), np.uint8)
    return np.unpackbits(stored, count=count, bitorder="little")
