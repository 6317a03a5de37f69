"""Simulation of the RTL in Amaranth's simulator, without a build."""

from typing import Any

import numpy as np
from amaranth.sim import Simulator

from eskin.cocotb_tests.bench.analog import ideal
from eskin.cocotb_tests.independent.link import Receiver
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import seen
from eskin.model.readout import Stimulus
from eskin.rtl import readout
from eskin.rtl.link import requests


class Breach(AssertionError):
    """Raised if a link violates its protocol."""


class Design:
    """A readout that is elaborated once and simulated many times.

    What drives it and what takes its events goes clock by clock as in ``cocotb_tests/bench/harness.v``.
    """

    def __init__(self, config: ReadoutConfig) -> None:
        self.config = config
        self.dut = readout.Readout(config)  # looked up anew: a bug may have been planted
        self.ports = set(self.dut.signature.members)
        self.simulator = Simulator(self.dut)
        self.simulator.add_clock(1e-6)
        self.simulator.add_testbench(self._run)
        self.played = False

    def play(self, stimulus: Stimulus) -> Events:
        """Simulate a stimulus after a reset; return the events in order."""
        stimulus.check(self.config)
        self.stimulus = stimulus
        self.driven: dict[str, int] = {}
        self.events: list[tuple[int, int, int, bool]] = []
        self.receiver = Receiver(stimulus.ack_delay.tolist())
        self.signal = [0] * self.config.taxels
        self.waiting: tuple[int, ...] | None = None
        self.before = (0, 0, 0)
        if self.played:
            self.simulator.reset()
        self.played = True
        self.simulator.run()
        return np.array(self.events, EVENT_DTYPE)

    def _drive(self, ctx: Any, **values: int) -> None:
        for name, value in values.items():
            if name in self.ports and self.driven.get(name) != value:
                self.driven[name] = value
                ctx.set(getattr(self.dut, name), value)

    def _read(self, ctx: Any, name: str, absent: int = 0) -> int:
        return int(ctx.get(getattr(self.dut, name))) if name in self.ports else absent

    async def _run(self, ctx: Any) -> None:
        stimulus, config = self.stimulus, self.config
        masks = dict(zip(stimulus.enable_clock.tolist(), stimulus.enable.tolist(), strict=True))
        samples = dict(zip(stimulus.sample_clock.tolist(), stimulus.samples.tolist(), strict=True))
        mask = (1 << config.sample_bits) - 1
        for clock in range(stimulus.clocks):
            if clock in masks:
                self._drive(ctx, taxel_enable=_word(masks[clock], 1))
            codes = samples.get(clock)
            self._drive(ctx, sample_valid=int(codes is not None))
            if codes is not None:
                self._drive(ctx, sample=_word([code & mask for code in codes], config.sample_bits))
            if config.frontend == "analog":
                self._look(ctx, clock)
            if config.link == "stream":
                self._stream(ctx, clock)
            else:
                self._four_phase(ctx, clock)
            await ctx.tick()
            if config.handshake:
                self.receiver.see(any(self._read(ctx, name) for name in requests(config)), clock)
            self.signal = self.signal if codes is None else seen(config, np.array([codes]))[0].tolist()

    def _look(self, ctx: Any, clock: int) -> None:
        """Set the comparator outputs from given decisions, or from thresholds and sample."""
        config, given = self.config, self.stimulus.decisions
        if given is not None:
            found = [(bool(d & 1), bool(d & 2)) for d in given[clock].tolist()]
        else:
            codes, widths = self._read(ctx, "reference_code"), self._read(ctx, "half_width")
            bits, size = config.sample_bits, config.half_width_bits
            found = []
            for taxel, x in enumerate(self.signal):
                code = codes >> taxel * bits & (1 << bits) - 1
                width = widths >> taxel * size & (1 << size) - 1 if config.closes else config.step
                found.append(ideal(config, x, code - (code >> bits - 1 << bits), width))
        self._drive(ctx, above=_word([a for a, _ in found], 1), below=_word([b for _, b in found], 1))

    def _stream(self, ctx: Any, clock: int) -> None:
        ready = int(self.stimulus.ready[clock % len(self.stimulus.ready)])
        self._drive(ctx, event_ready=ready)
        valid = self._read(ctx, "event_valid")
        event = tuple(self._read(ctx, f"event_{name}", int(name == "polarity")) for name in ("col", "row", "polarity"))
        if self.waiting is not None and (not valid or event != self.waiting):
            raise Breach(f"clock {clock}: the event {self.waiting} was taken back before it was taken")
        self.waiting = event if valid and not ready else None
        if valid and ready:
            self.events.append((clock, event[0], event[1], bool(event[2])))

    def _four_phase(self, ctx: Any, clock: int) -> None:
        config = self.config
        ack = int(self.receiver.ack_at(clock))
        self._drive(ctx, aer_ack=ack)
        high, address = [self._read(ctx, name) for name in requests(config)], self._read(ctx, "aer_addr")
        req = sum(high)
        if req > 1:
            raise Breach(f"clock {clock}: both requests are high")
        req_before, ack_before, address_before = self.before
        if (req or ack) and address != address_before:
            raise Breach(f"clock {clock}: the address changes while REQ or ACK is high")
        if req != req_before and ack_before != req_before:
            raise Breach(f"clock {clock}: REQ does not wait for ACK")
        if req and not req_before:
            column = address & (1 << config.column_bits) - 1
            row = address >> config.column_bits & (1 << config.row_bits) - 1
            polarity = address >> config.column_bits + config.row_bits if config.has_polarity else 1
            if len(high) == 2:
                polarity = high[0]
            self.events.append((clock - 1, column, row, bool(polarity)))
        self.before = req, ack, address


def _word(values: list[Any], bits: int) -> int:
    """Return values packed into a word, the first in the lowest bits."""
    return sum(int(value) << place * bits for place, value in enumerate(values))
