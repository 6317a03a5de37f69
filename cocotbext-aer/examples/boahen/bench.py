"""Testbench of the encoder: checks that all events arrive and that the bus follows the protocol."""

import random
from typing import Any

import cocotb
from cocotb.triggers import Timer
from cocotbext.aer import AerBus, AerChecker, AerSink


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def every_spike_arrives_once(dut: Any) -> None:
    rng = random.Random(7)
    dut.spike.value = 0
    dut.rst.value = 1
    await Timer(5, "ns")
    dut.rst.value = 0
    bus = AerBus.from_entity(dut)
    sink = AerSink(bus, ack_delay=lambda: rng.uniform(0.1, 20), release_delay=lambda: rng.uniform(0.1, 5))
    checker = AerChecker(bus, setup=0.5, hold="ack", timeout=100)
    await Timer(5, "ns")
    sent = []
    for _ in range(150):
        quiet = [cell for cell in range(8) if dut.waiting.value[cell] == 0]  # a cell that waits merges its spikes
        cells = rng.sample(quiet, min(rng.choice((1, 1, 2, 8)), len(quiet)))
        dut.spike.value = sum(1 << cell for cell in cells)
        await Timer(0.5, "ns")
        dut.spike.value = 0
        sent += cells
        await Timer(rng.choice((2, 7, 60)), "ns")
    await Timer(1, "us")
    received = [sink.recv_nowait().address for _ in range(sink.count())]
    assert sorted(received) == sorted(sent)
    assert all(checker.checks.values())
