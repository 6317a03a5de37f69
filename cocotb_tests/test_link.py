"""Compare the four-phase link's RTL with the independent model in every clock, with an asynchronous receiver."""

from pathlib import Path
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time
from cocotbext.aer import AerBus, AerChecker, AerEvent, AerMonitor, AerSink

from eskin.cocotb_tests.bench.block import begin, payload, report
from eskin.cocotb_tests.independent.arbiter import Event
from eskin.cocotb_tests.independent.link import LINKS, FourPhaseLink
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig

PERIOD_PS = 10_000
BEFORE_EDGE_PS = 10  # when everything is compared


def event_of(config: ReadoutConfig, event: Event) -> AerEvent:
    """Return the address of an event, without the polarity if the polarity selects the request line."""
    row, column, polarity = event
    address = column | row << config.column_bits
    if config.protocol.request_has_polarity:
        return AerEvent(address, polarity)
    return AerEvent(address | (polarity << (config.row_bits + config.column_bits) if config.has_polarity else 0))


class LinkBench:
    """A link with event source and reference link."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.config, self.rng, self.block, self.check = begin(dut)
        link = LINKS[self.config.link]()
        assert isinstance(link, FourPhaseLink)
        self.link, self.bus = link, AerBus.from_prefix(dut, "aer")
        self.longest_ps = 1  # delay of the receiver
        self.sent: list[AerEvent] = []
        self.event: Event | None = None
        self.block.drive(event_valid=0, event_row=0, event_col=0, event_polarity=0, aer_ack=0, rst=1)
        Clock(dut.clk, PERIOD_PS, "ps").start(start_high=True)

    async def clock(self, offer: float, rst: bool = False, **pins: int) -> None:
        """Drive a clock, and compare all outputs just before its rising edge."""
        config, link = self.config, self.link
        await FallingEdge(self.dut.clk)
        if rst:
            self.event = None
        elif self.event is None and self.rng.random() < offer:
            row, column = self.rng.randrange(config.rows), self.rng.randrange(config.columns)
            self.event = row, column, self.rng.getrandbits(1)
        self.block.drive(rst=rst, event_valid=self.event is not None, **pins)
        if self.event is not None:
            self.block.drive(**payload(config, *self.event))
        if rst and config.reset == "async":
            link.reset()
        await Timer(PERIOD_PS // 2 - BEFORE_EDGE_PS, "ps")
        ack = self.block.read("aer_ack")
        self.compare({**vars(link), "ack": ack, "offered": self.event})
        await RisingEdge(self.dut.clk)
        self.block.time += 1
        if rst:
            link.reset()
            return
        taken, req = self.event is not None and link.ready(), link.request()
        link.clock(self.event, ack)
        if link.request() > req and link.event is not None:
            self.sent.append(event_of(config, link.event))
        if taken:
            self.event = None
            self.check.counts["taken"] += 1

    def compare(self, state: object) -> None:
        """Compare all outputs with the reference."""
        link, check = self.link, self.check
        event = AerEvent(0, 0) if link.event is None else event_of(self.config, link.event)
        requests = {"aer_req": link.request()}
        if self.bus.dual:
            requests = {
                f"aer_req_{name}": link.request() * (event.polarity == on) for on, name in enumerate(("off", "on"))
            }
        check.outputs(state, event_ready=link.ready(), **requests)
        if self.bus.addr is not None:
            check.outputs(state, aer_addr=event.address)


@cocotb.test()
async def link_keeps_the_protocol(dut: Any) -> None:
    """Play fast and slow receivers, rare and dense events, and resets in all states."""
    bench = LinkBench(dut)
    rng, check = bench.rng, bench.check

    def delay() -> float:
        """Return a random delay in picoseconds that ends neither at a rising clock edge nor just before."""
        length = rng.randint(1, bench.longest_ps)
        to_edge = -round(get_sim_time("ps") + length) % PERIOD_PS  # rising edges are at multiples of the period
        return length + to_edge + 1 if to_edge <= 2 * BEFORE_EDGE_PS else length

    receiver = AerSink(bench.bus, ack_delay=delay, release_delay=delay, unit="ps")
    monitor = AerMonitor(bench.bus)
    protocol = AerChecker(bench.bus, setup=PERIOD_PS, hold="release", unit="ps", reset=dut.rst)
    await RisingEdge(dut.clk)
    for _ in range(2):
        await bench.clock(0, rst=True)
    for longest_ps in (1, PERIOD_PS, 4 * PERIOD_PS, 25 * PERIOD_PS):
        bench.longest_ps = longest_ps
        for offer in (1.0, 0.2, 0.02):
            for _ in range(250):
                await bench.clock(offer)
            # Reset while ACK is high: REQ falls at once, ACK stays, and no new REQ may rise before ACK has fallen.
            for _ in range(300):
                if bench.link.request() and dut.aer_ack.value == 1:
                    check.counts["resets while ACK is high"] += 1
                    await bench.clock(0, rst=True)
                    break
                await bench.clock(1)
            for _ in range(100):
                await bench.clock(1)
            # Reset anywhere. AssumeResetOutlastsHandshake: a receiver that has seen REQ may finish before it ends.
            await bench.clock(0, rst=True)
            while receiver.busy:
                await bench.clock(0, rst=True)
            await bench.clock(0, rst=True)
    for _ in range(100):
        await bench.clock(0.1)
    while bench.event is not None or receiver.busy or not bench.link.ready():
        await bench.clock(0)
    received = [monitor.recv_nowait() for _ in range(monitor.count())]
    check.holds("EveryEventOnceInOrder", received == bench.sent, received)
    check.counts["received"] = len(received)
    check.counts.update({rule.name: count for rule, count in protocol.checks.items()})
    report(check.counts)


@cocotb.test()
async def any_ack_and_reset(dut: Any) -> None:
    """Drive ACK and reset at random, also as no receiver may."""
    bench = LinkBench(dut)
    await RisingEdge(dut.clk)
    await bench.clock(0, rst=True)
    ack, change = 0, 0.5
    for clock in range(1500):
        if clock % 100 == 0:
            change = bench.rng.choice([0.1, 0.3, 0.9])
        ack ^= bench.rng.random() < change
        await bench.clock(0.7, rst=bench.rng.random() < 0.03, aer_ack=ack)
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


@pytest.mark.representative("icarus-3x5", "icarus-3x5-6bit-sync_dual")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_link_keeps_the_protocol_and_equals_its_reference(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_link", "link_keeps_the_protocol", tmp_path, seed=3)
    assert counts["received"] > 100
    assert counts["resets while ACK is high"] > 5
    assert counts["checks"] > 3000
    assert all(counts[property_name] > 0 for property_name in PROPERTIES), counts
    assert counts["ADDRESS_HELD"] > 50


@pytest.mark.parametrize("config", CONFIGS[:2], ids=name)
def test_link_equals_its_reference_for_any_ack_and_reset(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_link", "any_ack_and_reset", tmp_path, seed=8)
    assert counts["taken"] > 50
    assert counts["checks"] > 3 * 1500
