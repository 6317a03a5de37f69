"""Bit flips in SPI slave, registers, test pattern and decay counter, and recovery by new writes."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.spi import Timing, waveform
from eskin.model.config import ReadoutConfig
from eskin.model.host import HostRun, play
from eskin.model.readout import Stimulus
from eskin.model.registers.description import WORD_BYTES, Register, registers
from eskin.model.registers.spi import HIGH_CLOCKS, LOW_CLOCKS, LOW_CLOCKS_TO_READ, Pins, transfer
from eskin.rtl.readout import Readout
from eskin.verify.faults.bench import bench_gates, inside
from eskin.verify.faults.gates import last_clock, upset_runs
from eskin.verify.faults.outcomes import (
    CHANGED,
    MOVED,
    NEVER,
    WRITTEN,
    UnlikeModel,
    Upset,
    classify_effects,
    counted,
    since,
    slack,
)
from eskin.verify.faults.scenario import RESET, codes_of, events_of, inputs_of, pause_of, swings

HOST = r"(host|ticks)\."
"""Pattern for the names of the flops to flip."""
SETTING = re.compile(r"host\.(step|registers\.(?!clear|control|\w+_(written|told))|pattern\.(at_row|at_column|sign))")
"""Flops with written settings, with counters that the host clears, and with the taxel of a one-taxel pattern."""
TRANSFER = re.compile(r"host\.(spi|registers\.\w+_(written|told))")
"""Flops of an SPI transfer, and of the write strobes in the clock after a transfer."""
SETTLES = 60
"""Clocks after the last bit flip until all temporary effects have ended."""
ON_THE_WAY = 6
"""Clocks after the end of a transfer until its last effect."""


@dataclass(frozen=True)
class Play:
    """Stimulus of a readout with registers."""

    stimulus: Stimulus
    pins: list[Pins]  # of every clock from the end of reset on
    # clocks in which flops are flipped, and in which all but settings must have recovered
    upset: range
    alone: range
    written: int  # clock from which on everything must have recovered: all registers were written again


def upsets(config: ReadoutConfig, mode: int, stride: int, flops: str) -> Iterator[Upset]:
    """Flip every flop of the host interface in every clock of a window, one per run; yield the outcomes.

    An upset counts as *until written* if the readout is not as ever by itself, but is after the host has written all
    its registers once more and cleared the readout: in every event, and in every bit that is read back.

    ``mode`` is that of the test pattern, 0 for the array. ``flops`` is a pattern of the names of the flops.
    """
    gates, what = bench_gates(Readout(config)), _play(config, mode)
    levels = np.array([Pins()] * RESET + what.pins, np.uint8)  # CS is high during reset
    inputs = inputs_of(config, what.stimulus)
    inputs |= {f"spi_{name}": levels[:, [place]] for place, name in enumerate(Pins._fields)}
    # Something of a transfer is still under way some clocks behind its end.
    selected = np.convolve(inputs["spi_cs_n"][:, 0] == 0, np.ones(ON_THE_WAY))[: len(inputs["rst"])] > 0
    clocks = range(RESET + what.upset.start, RESET + what.upset.stop, stride)
    alone, written = (slice(RESET + r.start, RESET + r.stop) for r in (what.alone, range(what.written, len(what.pins))))
    expected = play(config, what.stimulus, what.pins)
    near = 1 if mode else slack(config)  # of a pattern the window may cut off another event
    for part, outputs in upset_runs(gates, inputs, clocks, inside(gates, flops)):
        codes = codes_of(config, outputs, inputs["event_ready"])
        said = outputs["spi_miso"] | outputs["spi_miso_enable"] << 1
        if not _as_model(config, expected, codes[:, 0], said[:, 0]):
            raise UnlikeModel(f"{config.encoding} with registers: the gates do not give the model's events or MISO")
        misread, events = said != said[:, :1], _more(config, codes)
        last = last_clock((codes != codes[:, :1]) | misread)
        changed = events.any(axis=0) | misread.any(axis=0)
        left_alone = _more(config, codes[alone])
        stays = np.abs(left_alone).max(axis=0) > near
        stops = np.abs(left_alone.sum(axis=0)) > near
        never = misread[written].any(axis=0) | (np.abs(_more(config, codes[written])).max(axis=0) > slack(config))
        last, never, stays, stops, changed = (of_runs[1:] for of_runs in (last, never, stays, stops, changed))
        may_stay = [
            selected[clock]
            if TRANSFER.match(name)
            else SETTING.match(name) is not None and not ("pattern" in name and stopped)
            for (clock, name), stopped in zip(part, stops, strict=True)
        ]
        effects = {NEVER: never, WRITTEN: stays, CHANGED: changed, MOVED: last >= 0}
        yield from classify_effects(part, effects, other_clocks=since(part, last), may_stay=np.array(may_stay))


def _more(config: ReadoutConfig, codes: NDArray[np.int16]) -> NDArray[np.int64]:
    """Return the difference of event counts between all runs and run 0, shape (2 * taxels, runs)."""
    counts = counted(config, codes)
    assert counts[:, 0].any(), "there are no events to be compared"
    return counts - counts[:, :1]


def _play(config: ReadoutConfig, mode: int) -> Play:
    """Return a stimulus: transfers with moving samples, swings, all registers written and read, swings again."""
    rng = np.random.default_rng(0)
    found = {register.name: register for register in registers(config)}
    kept = [register for register in found.values() if any(field.kind == "setting" for field in register.fields)]
    of_test = {"mode": mode, "interval": 2, "row": 1, "column": 1, "turns": int(mode == 2), "on": 1}
    test = sum(of_test[field.name] << field.low for field in found["test"].fields)
    pins = [Pins()] * 20
    pins += _transfer(found["test"], [test]) + _transfer(found["resolution"], [config.resolution])
    pins += _transfer(found["events"], reads=2) + [Pins()] * 60
    upset = range(12, len(pins))
    pause = pause_of(config)
    start = len(pins) + SETTLES
    moves = config.step * rng.integers(-2, 3, size=(len(range(25, upset.stop, 30)), config.taxels))
    ticks = list(zip(range(25, upset.stop, 30), moves, strict=True))  # up to two steps from rest
    ticks += [*swings(config, start, 4, pause), (start + 4 * pause, np.zeros(config.taxels, np.int64))]
    pins += [Pins()] * (SETTLES + 4 * pause)
    for register in kept[::-1]:
        pins += _transfer(register, [register.reset])
    pins += [Pins()] * pause + _transfer(found["control"], [1])
    written = len(pins)
    words = (found["stalls"].address - kept[0].address) // WORD_BYTES + 1
    pins += _transfer(kept[0], reads=words) + _transfer(kept[-1], reads=1)
    ticks += swings(config, len(pins), 2, pause)
    pins += [Pins()] * (2 * pause)
    ready = np.ones(len(pins), np.uint8)
    ready[: upset.stop] = rng.random(upset.stop) < 0.8
    stimulus = Stimulus(
        samples=np.array([level for _, level in ticks], np.int32),
        sample_clock=np.array([clock for clock, _ in ticks], np.int64),
        clocks=len(pins),
        enable_clock=np.zeros(1, np.int64),
        enable=np.ones((1, config.taxels), bool),
        ready=ready,
    )
    return Play(stimulus, pins, upset, range(start + 3 * pause, start + 4 * pause), written)


def _transfer(register: Register, words: Sequence[int] = (), reads: int = 0) -> list[Pins]:
    """Return the SPI pins of a transfer that writes or reads words."""
    timing = Timing(HIGH_CLOCKS, LOW_CLOCKS_TO_READ if reads else LOW_CLOCKS)
    return list(waveform(transfer(register.address, words or [0] * reads, not reads), timing))


def _as_model(config: ReadoutConfig, expected: HostRun, codes: NDArray[np.int16], said: NDArray[np.int64]) -> bool:
    """Return True if a run has events and reads, and equals the model."""
    miso = expected.miso.astype(np.int64) | expected.miso_enable.astype(np.int64) << 1
    events = events_of(config, codes)
    same = np.array_equal(events[events["t"] >= 0], expected.events) and np.array_equal(said[RESET:], miso)
    return bool(same and len(events) and expected.miso.any())
