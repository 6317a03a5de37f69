"""Simulation of the RTL in Amaranth's simulator, without a build."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from amaranth.sim import Simulator

from eskin.cocotb_tests.independent.settings import Settings
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.classifier.words import unpacked
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus
from eskin.rtl import readout
from tests.independent.agreement import steps


class Breach(AssertionError):
    """Raised if a link violates its protocol."""


class Design:
    """A readout that is elaborated once and simulated many times.

    What drives it and what takes its events goes clock by clock as in ``cocotb_tests/bench/harness.v``.
    """

    def __init__(self, config: ReadoutConfig) -> None:
        self.config, self.settings = config, Settings.of(config.to_dict())
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
        self.asked: list[list[bool]] = []
        self.waiting: tuple[int, ...] | None = None
        self.before = (0, 0, 0)
        if self.played:
            self.simulator.reset()
        self.played = True
        self.simulator.run()
        return np.array(self.events, EVENT_DTYPE)

    def _drive(self, name: str, values: Sequence[int], bits: int = 1) -> None:
        """Drive a port, if there is one, with values of the given width, the first in the lowest bits."""
        word = sum((int(value) & (1 << bits) - 1) << place * bits for place, value in enumerate(values))
        if name in self.ports and self.driven.get(name) != word:
            self.driven[name] = word
            self.ctx.set(getattr(self.dut, name), word)

    def _read(self, name: str, absent: int = 0) -> int:
        return int(self.ctx.get(getattr(self.dut, name))) if name in self.ports else absent

    async def _run(self, ctx: Any) -> None:
        self.ctx = ctx
        for clock, given in steps(self.config, self.stimulus, self):
            self.asked.append(self.strobes())
            self._drive("taxel_enable", given["enable"])
            self._drive("sample_valid", [given["sample_valid"]])
            if given["sample"]:
                self._drive("sample", given["sample"], self.config.sample_bits)
            for place, name in enumerate(("above", "below") if given["decisions"] else ()):
                self._drive(name, [decision[place] for decision in given["decisions"]])
            if self.config.protocol.asynchronous:
                self._four_phase(clock, given["ack"])
            else:
                self._stream(clock, given["ready"])
            await ctx.tick()

    def outputs(self) -> dict[str, int]:
        """Return REQ, if the link has one."""
        return {"aer_req": sum(map(self._read, self.config.protocol.requests))}

    def thresholds(self) -> list[tuple[int, int]]:
        """Return (reference_code, half_width) of every taxel."""
        bits, size = self.config.sample_bits, self.config.half_width_bits
        codes, widths = self._read("reference_code"), self._read("half_width")
        found = []
        for taxel, code in enumerate(unpacked(codes, self.config.taxels, bits)):
            width = widths >> taxel * size & (1 << size) - 1 if self.config.closes else self.config.step
            found.append((code, width))
        return found

    def strobes(self) -> list[bool]:
        """Return ``compare`` of every taxel."""
        word = self._read("compare")
        return [bool(word >> taxel & 1) for taxel in range(self.config.taxels)]

    def _stream(self, clock: int, ready: bool) -> None:
        self._drive("event_ready", [ready])
        valid = self._read("event_valid")
        event = tuple(self._read(f"event_{name}", int(name == "polarity")) for name in ("col", "row", "polarity"))
        if self.waiting is not None and (not valid or event != self.waiting):
            raise Breach(f"clock {clock}: the event {self.waiting} was taken back before it was taken")
        self.waiting = event if valid and not ready else None
        if valid and ready:
            self.events.append((clock, event[0], event[1], bool(event[2])))

    def _four_phase(self, clock: int, ack: int) -> None:
        config = self.config
        self._drive("aer_ack", [ack])
        high, address = [self._read(name) for name in config.protocol.requests], self._read("aer_addr")
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
