"""Testbenches on bare signals: all events arrive, and every rule detects its violation."""

import random
import re
from itertools import cycle, pairwise
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge, Timer
from cocotbext.aer import (
    AerBus,
    AerChecker,
    AerEvent,
    AerFunnel,
    AerMonitor,
    AerProtocolError,
    AerSink,
    AerSource,
    AerStreamBus,
    AerStreamChecker,
    AerStreamMonitor,
    AerStreamSink,
    AerStreamSource,
    Fault,
    Rule,
)

FOUR_PHASE = {
    Rule.REQUEST_UNKNOWN,
    Rule.ACK_UNKNOWN,
    Rule.ADDRESS_UNKNOWN,
    Rule.REQUEST_AFTER_RELEASE,
    Rule.REQUEST_HELD,
    Rule.ACK_ON_REQUEST,
    Rule.ACK_HELD,
    Rule.ADDRESS_SETUP,
    Rule.ADDRESS_HELD,
}


class Ends:
    """Source, sink, monitor and checker of one bus."""

    def __init__(
        self, dut: Any, prefix: str = "", stop: bool = True, timeout: float | None = 1000, **sink: Any
    ) -> None:
        self.source = AerSource(AerBus.from_prefix(dut, f"{prefix}in"), setup=2)
        bus = AerBus.from_prefix(dut, f"{prefix}out")
        self.sink = AerSink(bus, **sink)
        self.monitor = AerMonitor(bus)
        self.checker = AerChecker(bus, setup=2, hold="request", timeout=timeout, stop=stop)


@cocotb.test()
async def events_arrive(dut: Any) -> None:
    rng = random.Random(1)
    ends = Ends(dut, ack_delay=lambda: rng.expovariate(0.2), release_delay=lambda: rng.choice((0, 7.5)))
    ends.source.gap = lambda: rng.choice((0, 0, 40))
    sent = [AerEvent(rng.randrange(256)) for _ in range(300)]
    for event in sent:
        await ends.source.send(event)
    received = [await ends.sink.recv() for _ in sent]
    await ends.source.wait()
    await Timer(1, "ns")
    assert received == sent
    assert [ends.monitor.recv_nowait() for _ in sent] == sent
    assert ends.monitor.empty()
    times = [event.time_ps for event in received]
    assert times == sorted(set(times))
    assert times[0] == 2000  # the setup
    assert {rule for rule in FOUR_PHASE if ends.checker.checks[rule] < 300} == set()
    assert ends.checker.violations == []


@cocotb.test()
async def polarity_chooses_the_request(dut: Any) -> None:
    ends = Ends(dut, "dual_")
    sent = [AerEvent(k, k % 3 % 2) for k in range(60)]
    for event in sent:
        ends.source.send_nowait(event)
    assert [await ends.sink.recv() for _ in sent] == sent
    assert [ends.monitor.recv_nowait() for _ in sent] == sent
    assert ends.checker.checks[Rule.ONE_REQUEST] > 100


@cocotb.test()
async def a_bus_may_have_no_address(dut: Any) -> None:
    ends = Ends(dut, "bare_")
    ends.source.send_nowait(0)
    assert (await ends.sink.recv()).address == 0
    assert ends.source.bus.addr is None


@cocotb.test()
async def names_may_be_in_capitals(dut: Any) -> None:
    for prefixes in (("AERIN", "AEROUT"), ("aerin", "aerout")):
        source, sink = (
            part(AerBus.from_prefix(dut, at)) for part, at in zip((AerSource, AerSink), prefixes, strict=True)
        )
        source.send_nowait(77)
        assert await sink.recv() == AerEvent(77)
        await source.wait()


@cocotb.test()
async def a_funnel_takes_any_order_of_sources_and_no_other(dut: Any) -> None:
    sent = [AerEvent(source << 4 | number) for source in range(4) for number in range(3)]
    ends, rng = Ends(dut), random.Random(3)
    order = rng.sample([0, 1, 2, 3] * 3, 12)
    queues = {source: iter(sent[3 * source : 3 * source + 3]) for source in range(4)}
    funnel = AerFunnel(lambda event: event.address >> 4)
    funnel.expect(*sent)
    for source in order:
        ends.source.send_nowait(next(queues[source]))
    for _ in order:
        funnel.check(await ends.sink.recv())
    funnel.finish()
    with pytest.raises(AssertionError, match="no event of source 1 is left"):
        funnel.check(AerEvent(0x10))
    funnel.expect(0x20, 0x21)
    with pytest.raises(AssertionError, match=r"came where source 2 has AerEvent\(address=32"):
        funnel.check(AerEvent(0x21))
    with pytest.raises(AssertionError, match="2 events did not come"):
        funnel.finish()
    with pytest.raises(AssertionError, match="no event was checked"):
        AerFunnel().finish()


@cocotb.test()
async def a_clock_aligns_every_change(dut: Any) -> None:
    Clock(dut.clk, 10, "ns").start(start_high=False)
    source = AerSource(AerBus.from_prefix(dut, "in"), setup=1, hold=1, gap=1, clock=dut.clk)
    sink = AerSink(AerBus.from_prefix(dut, "out"), ack_delay=3, clock=dut.clk)
    for address in range(5):
        source.send_nowait(address)
    times = [(await sink.recv()).time_ps for _ in range(5)]
    # setup 1, ACK after 3, REQ falls after 1, ACK falls after 1, gap 1
    assert {later - earlier for earlier, later in pairwise(times)} == {70_000}


@cocotb.test()
async def a_pause_holds_the_acknowledge_back(dut: Any) -> None:
    ends = Ends(dut)
    ends.sink.pause = True
    ends.source.send_nowait(7)
    await Timer(500, "ns")
    assert ends.sink.empty()
    assert not ends.source.idle()
    ends.sink.pause = False
    assert await ends.sink.recv() == AerEvent(7)
    ends.source.pause = True
    ends.source.send_nowait(8)
    await Timer(500, "ns")
    assert ends.sink.empty()
    ends.source.pause = False
    assert await ends.sink.recv() == AerEvent(8)


@cocotb.test()
async def a_reset_gives_the_handshake_up(dut: Any) -> None:
    dut.rst.value = 0
    source = AerSource(AerBus.from_prefix(dut, "in"), reset=dut.rst)
    bus = AerBus.from_prefix(dut, "out")
    sink = AerSink(bus, reset=dut.rst)
    checker = AerChecker(bus, reset=dut.rst)
    sink.pause = True
    source.send_nowait(1)
    source.send_nowait(2)
    await Timer(20, "ns")
    assert dut.out_req.value == 1
    dut.rst.value = 1
    await Timer(5, "ns")
    assert dut.out_req.value == 0
    dut.rst.value = 0
    sink.pause = False
    assert await sink.recv() == AerEvent(2)
    await source.wait()
    assert checker.violations == []
    assert checker.checks[Rule.REQUEST_HELD] == 1  # of the second event


async def broken(ends: Ends, events: int = 3) -> set[Rule]:
    """Send events and return the violated rules."""
    for address in range(events):
        ends.source.send_nowait(AerEvent(2 * address, 1) if ends.source.bus.dual else 2 * address)
    await Timer(events * 100, "ns")
    return {violation.rule for violation in ends.checker.violations}


BY_THE_SOURCE = {
    Fault.WITHDRAW_REQUEST: Rule.REQUEST_HELD,
    Fault.CHANGE_ADDRESS: Rule.ADDRESS_HELD,
    Fault.LATE_ADDRESS: Rule.ADDRESS_HELD,
    Fault.IGNORE_ACK: Rule.REQUEST_AFTER_RELEASE,
}
BY_THE_SINK = {
    Fault.EARLY_ACK: Rule.ACK_ON_REQUEST,
    Fault.WITHDRAW_ACK: Rule.ACK_HELD,
    Fault.NO_ACK: Rule.IN_TIME,
    Fault.HOLD_ACK: Rule.IN_TIME,
}


@cocotb.test()
@cocotb.parametrize(fault=[*BY_THE_SOURCE, *BY_THE_SINK])
async def each_fault_breaks_its_rule(dut: Any, fault: Fault) -> None:
    ends = Ends(dut, stop=False, timeout=50, ack_delay=4, release_delay=30)
    assert await broken(ends) == set()
    if fault in BY_THE_SOURCE:
        ends.source.inject(fault)
        assert BY_THE_SOURCE[fault] in await broken(ends)
    else:
        ends.sink.inject(fault)
        assert BY_THE_SINK[fault] in await broken(ends)
        ends.sink.release()
    # The description names the time and what led there.
    assert all(str(v.time_ps) in str(v) and "before: " in str(v) for v in ends.checker.violations)


@cocotb.test()
async def both_requests_break_a_rule(dut: Any) -> None:
    ends = Ends(dut, "dual_", stop=False)
    ends.source.inject(Fault.BOTH_REQUESTS)
    assert await broken(ends) == {Rule.ONE_REQUEST}


@cocotb.test(skip=cocotb.SIM_NAME.lower() == "verilator")  # it has two levels, so nothing is unknown
async def unknown_levels_break_rules(dut: Any) -> None:
    checker = AerChecker(AerBus.from_prefix(dut, "out"), setup=2, stop=False)
    dut.in_req.value = dut.out_ack.value = dut.in_addr.value = 0
    await Timer(5, "ns")
    for handle, level in ((dut.in_addr, "0000x000"), (dut.in_req, "1"), (dut.out_ack, "x"), (dut.in_req, "x")):
        handle.value = cocotb.types.LogicArray(level)
        await Timer(1, "ns")
    expected = {Rule.ADDRESS_UNKNOWN, Rule.ADDRESS_SETUP, Rule.ACK_UNKNOWN, Rule.REQUEST_UNKNOWN}
    assert {violation.rule for violation in checker.violations} == expected


class Stream:
    """Source, sink, monitor and checker of a stream."""

    def __init__(self, dut: Any, stop: bool = True) -> None:
        Clock(dut.clk, 10, "ns").start(start_high=False)
        fields = ("col", "row")
        self.source = AerStreamSource(AerStreamBus.from_prefix(dut, "s", fields), dut.clk)
        self.bus = AerStreamBus.from_prefix(dut, "m", fields)
        self.sink = AerStreamSink(self.bus, dut.clk)
        self.monitor = AerStreamMonitor(self.bus, dut.clk)
        self.checker = AerStreamChecker(self.bus, dut.clk, timeout=20, stop=stop)


@cocotb.test()
async def a_stream_arrives(dut: Any) -> None:
    stream = Stream(dut)
    stream.sink.set_pause_generator(cycle((True, True, False, True, False)), dut.clk)
    assert stream.bus.pack(col=3, row=17) == 3 + (17 << 3)
    assert stream.bus.unpack(139) == {"col": 3, "row": 17}
    sent = [AerEvent(address) for address in range(256)]
    for event in sent:
        stream.source.send_nowait(event)
    assert [await stream.sink.recv() for _ in sent] == sent
    await stream.source.wait()
    assert [stream.monitor.recv_nowait() for _ in sent] == sent
    assert stream.checker.checks[Rule.ADDRESS_HELD] > 100
    assert stream.checker.violations == []


@cocotb.test()
@cocotb.parametrize(
    fault=[Fault.WITHDRAW_REQUEST, Fault.CHANGE_ADDRESS, None],
)
async def each_fault_of_a_stream_breaks_its_rule(dut: Any, fault: Fault | None) -> None:
    stream = Stream(dut, stop=False)
    stream.sink.pause = True
    if fault is not None:
        stream.source.inject(fault)
    stream.source.send_nowait(4)
    for _ in range(40):
        await RisingEdge(dut.clk)
    rules = {Fault.WITHDRAW_REQUEST: Rule.REQUEST_HELD, Fault.CHANGE_ADDRESS: Rule.ADDRESS_HELD, None: Rule.IN_TIME}
    assert rules[fault] in {violation.rule for violation in stream.checker.violations}


@cocotb.test(expect_error=AerProtocolError)
async def a_violation_ends_the_test(dut: Any) -> None:
    ends = Ends(dut)
    await Timer(5, "ns")
    ends.sink.inject(Fault.EARLY_ACK)
    await broken(ends)


@cocotb.test()
async def what_cannot_be_done_is_said(dut: Any) -> None:
    for build, text in (
        (lambda: AerBus(ack=dut.in_ack), "either req, or req_on and req_off"),
        (
            lambda: AerBus.from_prefix(dut, "nothing"),
            "no signal nothing_ack or NOTHING_ACK; give signals of other names as ",
        ),
        (
            lambda: AerStreamBus.from_prefix(dut, "s", ("col", "polarity")),
            "wires has no signal s_polarity, also not in capitals; ",
        ),
        (lambda: AerStreamBus.from_prefix(dut, "s", ("col",)).pack(col=8), "col must fit in 3 bits, not 8"),
        (lambda: AerEvent(-1), "must be at least 0"),
        (lambda: AerSink(AerBus.from_prefix(dut, "out")).inject(Fault.LATE_ADDRESS), "cannot inject LATE_ADDRESS"),
        (lambda: AerChecker(AerBus.from_prefix(dut, "out"), hold="forever"), "not 'forever'"),
    ):
        with pytest.raises((ValueError, AttributeError), match=re.escape(text)):
            build()
