"""Compare the four-phase link's RTL with the reference link in every clock, with an asynchronous receiver."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time
from cocotbext.aer import AerBus, AerChecker, AerEvent, AerMonitor, AerSink

from eskin.cocotb_tests.bench.block import Block, Checker, job, payload, report
from eskin.cocotb_tests.bench.reference import AddressEvent, LinkReference
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig

PERIOD_PS = 10_000
BEFORE_EDGE_PS = 10  # when everything is compared


def now_ps() -> int:
    """Return the simulated time in picoseconds."""
    return round(get_sim_time("ps"))


def event_of(config: ReadoutConfig, event: AddressEvent) -> AerEvent:
    """Return the address of an event, without the polarity if the polarity selects the request line."""
    address = event.column | event.row << config.column_bits
    if config.link == "four_phase_dual":
        return AerEvent(address, int(event.polarity))
    return AerEvent(address | (event.polarity << (config.row_bits + config.column_bits) if config.has_polarity else 0))


class LinkBench:
    """A link with event source, receiver and reference link."""

    def __init__(self, dut: Any, config: ReadoutConfig, rng: random.Random) -> None:
        self.dut, self.config, self.rng = dut, config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.reference = LinkReference()
        self.bus = AerBus.from_prefix(dut, "aer")
        self.longest_ps = 0  # delays of the receiver are random up to this
        self.expected: list[AerEvent] = []
        self.event: AddressEvent | None = None
        self.block.drive(event_valid=0, event_row=0, event_col=0, event_polarity=0, aer_ack=0, rst=1)

    async def start(self) -> None:
        """Start clock, receiver and monitors, and reset the link."""
        Clock(self.dut.clk, PERIOD_PS, "ps").start(start_high=True)
        delay = self.receiver_delay
        self.receiver = AerSink(self.bus, ack_delay=delay, release_delay=delay, unit="ps")
        self.monitor = AerMonitor(self.bus)
        self.protocol = AerChecker(self.bus, setup=PERIOD_PS, hold="release", unit="ps", reset=self.dut.rst)
        await RisingEdge(self.dut.clk)
        await self.reset(2)

    async def clock(self, offer: float, rst: bool = False) -> None:
        """Drive a clock, and compare all outputs just before its rising edge."""
        await FallingEdge(self.dut.clk)
        if self.event is None and self.rng.random() < offer:
            row, column = self.rng.randrange(self.config.rows), self.rng.randrange(self.config.columns)
            self.event = AddressEvent(row, column, self.rng.random() < 0.5)
        self.block.drive(rst=rst, event_valid=self.event is not None)
        if self.event is not None:
            self.block.drive(**payload(self.config, *self.event))
        if rst and self.config.reset == "async":
            self.reference.reset()
        await Timer(PERIOD_PS // 2 - BEFORE_EDGE_PS, "ps")
        self.compare()
        ack = bool(self.block.read("aer_ack"))
        await RisingEdge(self.dut.clk)
        self.block.time += 1
        if rst:
            self.reference.reset()
            return
        taken, req = self.event is not None and self.reference.ready, self.reference.req
        self.reference.clock(self.event, ack)
        if self.reference.req and not req and self.reference.address is not None:
            self.expected.append(event_of(self.config, self.reference.address))
        if taken:
            self.event = None
            self.check.counts["taken"] += 1

    def compare(self) -> None:
        """Compare all outputs with the reference."""
        reference = self.reference
        state = {**vars(reference), "ack": self.dut.aer_ack.value, "offered": self.event}
        self.check.equal("event_ready", reference.ready, self.block.read("event_ready"), state)
        event = AerEvent(0) if reference.address is None else event_of(self.config, reference.address)
        if self.bus.dual:
            for polarity, name in enumerate(("aer_req_off", "aer_req_on")):
                self.check.equal(name, reference.req and event.polarity == polarity, self.block.read(name), state)
        else:
            self.check.equal("aer_req", reference.req, self.block.read("aer_req"), state)
        self.check.equal("aer_addr", event.address, self.block.read("aer_addr"), state)

    def request(self) -> int:
        """Return True if a request line is active."""
        return int(any(self.bus.read(request) for request in self.bus.requests))

    def receiver_delay(self) -> float:
        """Return a random delay in picoseconds that ends neither at a rising clock edge nor just before."""
        delay = self.rng.randint(1, self.longest_ps) if self.longest_ps else 1
        to_edge = -(now_ps() + delay) % PERIOD_PS  # rising edges are at multiples of the period
        return delay + to_edge + 1 if to_edge <= 2 * BEFORE_EDGE_PS else delay

    async def reset(self, clocks: int) -> None:
        """Reset the link for a number of clocks."""
        self.event = None
        for _ in range(clocks):
            await self.clock(offer=0, rst=True)
        self.check.counts["resets"] += 1

    async def finish(self) -> None:
        """Wait for the last event, and check that all events arrived once and in order."""
        while self.event is not None or self.receiver.busy or not self.reference.ready:
            await self.clock(offer=0)
        received = [self.monitor.recv_nowait() for _ in range(self.monitor.count())]
        self.check.holds("EveryEventOnceInOrder", received == self.expected, received)
        self.check.counts["received"] = len(received)
        self.check.counts.update({rule.name: count for rule, count in self.protocol.checks.items()})


@cocotb.test()
async def link_keeps_the_protocol(dut: Any) -> None:
    """Play fast and slow receivers, rare and dense events, and resets in all states."""
    config, rng = job()
    bench = LinkBench(dut, config, rng)
    await bench.start()
    for longest in (0, PERIOD_PS, 4 * PERIOD_PS, 25 * PERIOD_PS):
        for offer in (1.0, 0.2, 0.02):
            bench.longest_ps = longest
            for _ in range(250):
                await bench.clock(offer)
            # Reset while ACK is high: REQ falls at once, ACK stays, and no new REQ may rise before ACK has fallen.
            for _ in range(300):
                if bench.request() and dut.aer_ack.value == 1:
                    bench.check.counts["resets while ACK is high"] += 1
                    await bench.reset(1)
                    break
                await bench.clock(offer=1)
            for _ in range(100):
                await bench.clock(offer=1)
            # Reset anywhere. AssumeResetOutlastsHandshake: a receiver that has seen REQ may finish before it ends.
            bench.event = None
            await bench.clock(offer=0, rst=True)
            while bench.receiver.busy:
                await bench.clock(offer=0, rst=True)
            await bench.reset(1)
    await bench.finish()
    report(bench.check.counts)


@cocotb.test()
async def immediate_receiver_takes_seven_clocks(dut: Any) -> None:
    """Check that REQ rises every seven clocks if ACK follows immediately and events are always offered."""
    config, rng = job()
    bench = LinkBench(dut, config, rng)
    await bench.start()
    for _ in range(500):
        await bench.clock(offer=1)
    times = [event.time_ps for event in bench.monitor.queue]
    for earlier, later in itertools.pairwise(times):
        bench.check.equal("clocks per event", 7 * PERIOD_PS, later - earlier)
    bench.check.counts["events"] = len(times)
    await bench.finish()
    report(bench.check.counts)


async def until(bench: LinkBench, req: int, offer: float = 1) -> None:
    """Wait until REQ has a given level."""
    for _ in range(20):
        if bench.request() == req:
            return
        await bench.clock(offer)
    bench.check.holds("Progress", False, f"REQ never becomes {req}")


@cocotb.test()
async def what_a_receiver_sees_of_a_reset(dut: Any) -> None:
    """Reset the link in each phase of a handshake, with ACK driven by the test."""
    config, rng = job()
    bench = LinkBench(dut, config, rng)
    Clock(dut.clk, PERIOD_PS, "ps").start(start_high=True)
    await RisingEdge(dut.clk)
    for held, wait in itertools.product((False, True), range(5)):
        bench.block.drive(aer_ack=0)
        await bench.reset(3)
        await until(bench, req=1)
        for _ in range(wait):  # a slow receiver: REQ stays
            await bench.clock(offer=1)
        bench.check.holds("RequestWaitsForAck", bench.request() == 1)
        bench.block.drive(aer_ack=held)
        await bench.reset(2)
        bench.check.holds("ResetEndsRequest", bench.request() == 0 and bench.block.read("aer_addr") == 0)
        for _ in range(12):
            await bench.clock(offer=1)
            bench.check.holds("NoRequestWhileAckHigh", not held or bench.request() == 0)
        # After ACK has fallen, the link continues with a new event; the old event is lost.
        bench.block.drive(aer_ack=0)
        await until(bench, req=1)
        lost = bench.reference.address
        # A late ACK to the withdrawn REQ ends the handshake of the next event.
        bench.block.drive(aer_ack=1)
        await until(bench, req=0)
        bench.check.holds("LateAckTakesTheNext", bench.reference.address == lost)
    report(bench.check.counts)


PROPERTIES = ("REQUEST_AFTER_RELEASE", "REQUEST_HELD", "ADDRESS_SETUP", "EveryEventOnceInOrder")
CONFIGS = [
    ReadoutConfig(rows=3, columns=5, link="four_phase", reset="async"),
    ReadoutConfig(rows=1, columns=4, encoding="nlcs", link="four_phase"),
    ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase", reset="async"),
    ReadoutConfig(rows=1, columns=1, link="four_phase"),
    ReadoutConfig(rows=3, columns=5, link="four_phase_dual"),
]


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return (
        f"{config.rows}x{config.columns}-{config.event_bits}bit-{config.reset}{config.link.removeprefix('four_phase')}"
    )


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_link_keeps_the_protocol_and_equals_its_reference(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_link", "link_keeps_the_protocol", tmp_path, seed=3)
    assert counts["received"] > 100
    assert counts["resets while ACK is high"] > 5
    assert counts["checks"] > 3000
    assert all(counts[property_name] > 0 for property_name in PROPERTIES), counts
    assert counts["ADDRESS_HELD"] > 50


def test_link_with_an_immediate_receiver_takes_seven_clocks_per_event(tmp_path: Path) -> None:
    counts = cosimulate(CONFIGS[0], "icarus", "eskin_link", "immediate_receiver_takes_seven_clocks", tmp_path, seed=4)
    assert counts["events"] > 60
    assert counts["received"] >= counts["events"]


def test_a_reset_breaks_a_handshake_off_as_the_documents_say(tmp_path: Path) -> None:
    counts = cosimulate(CONFIGS[0], "icarus", "eskin_link", "what_a_receiver_sees_of_a_reset", tmp_path, seed=8)
    assert counts["RequestWaitsForAck"] == counts["ResetEndsRequest"] == counts["LateAckTakesTheNext"] == 10
    assert counts["NoRequestWhileAckHigh"] == 120
