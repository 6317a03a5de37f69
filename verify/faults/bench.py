"""Testbench for fault injection: a block with models of its environment, as one netlist."""

import re
from typing import Any

from amaranth.back import rtlil
from amaranth.hdl import (
    Cat,
    ClockSignal,
    Const,
    Elaboratable,
    Fragment,
    Instance,
    Module,
    Mux,
    ResetSignal,
    Signal,
    Value,
    signed,
)
from amaranth.lib import wiring

from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block, RtlilModules
from eskin.rtl.classifier.chip import BinTimer
from eskin.verify.faults.gates import DUT, Gates, gates_of

TOP, TIMER = "bench", "timer"
FIELDS = ("col", "row", "polarity")
"""Fields of an event, from the lowest bits of its number on; missing fields are skipped."""
NUMBER_BITS = 8
ADC_CLOCKS = 3
"""Clocks from the start of a conversion to its code."""


class Bench(Elaboratable):
    """The block under test with its environment.

    The receiver of a four-phase link takes ``slow`` clocks to raise ACK, and to lower it. Its inputs ``ack_high`` and
    ``ack_turned`` hold ACK high, and turn it over.
    """

    def __init__(self, block: Block[Any], slow: int = 0) -> None:
        self.block, self.slow = block, slow
        self.inputs: list[Signal] = []
        self.outputs: list[Signal] = []

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        wires: dict[str, Any] = {"i_clk": ClockSignal(), "i_rst": ResetSignal()}
        inner: dict[str, Value] = {}
        for name, member in self.block.signature.members.items():
            inward = member.flow is wiring.In
            port = Signal(len(Value.cast(getattr(self.block, name))), name=f"{name}_inside" if inward else name)
            wires[f"{'i' if inward else 'o'}_{name}"] = inner[name] = port
            if not inward:
                self.outputs.append(port)
        setattr(m.submodules, DUT, Instance(self.block.module_name, **wires))
        driven = self._receiver(m, inner) | self._comparators(m, inner) | self._converter(m, inner)
        driven |= self._tiles(m, inner) | self._events(m, inner)
        for name, member in self.block.signature.members.items():
            if member.flow is wiring.In and name not in driven:
                m.d.comb += inner[name].eq(self._input(name, len(inner[name])))
        return m

    def _input(self, name: str, width: int) -> Signal:
        self.inputs.append(Signal(width, name=name))
        return self.inputs[-1]

    def _receiver(self, m: Module, inner: dict[str, Value]) -> set[str]:
        """Add a four-phase receiver: ACK follows REQ, and a started handshake always completes."""
        if "aer_ack" not in inner:
            return set()
        ack = Signal()
        if self.slow:
            wait = Signal(range(self.slow))
            raised = Signal()
            due = wait == self.slow - 1
            busy = (inner["aer_req"] != raised) | wait.any()
            with m.If(busy):
                m.d.sync += [wait.eq(Mux(due, 0, wait + 1)), raised.eq(raised ^ due)]
            m.d.comb += ack.eq(raised)
        else:
            m.d.comb += ack.eq(inner["aer_req"])
        high, turned = self._input("ack_high", 1), self._input("ack_turned", 1)
        m.d.comb += inner["aer_ack"].eq((ack | high) ^ turned)
        return {"aer_ack"}

    def _converter(self, m: Module, inner: dict[str, Value]) -> set[str]:
        """Add an ADC whose codes depend on the taxel and on the input ``salt``."""
        if "adc_start" not in inner:
            return set()
        left, code = Signal(range(ADC_CLOCKS + 1)), Signal(len(inner["adc_code"]))
        salt = self._input("salt", len(code))
        lines = Cat(inner["row_select"], inner["column_select"])
        with m.If(inner["adc_start"]):
            m.d.sync += [
                left.eq(ADC_CLOCKS),
                code.eq(salt + sum(Mux(line, place, 0) for place, line in enumerate(lines))),
            ]
        with m.Elif(left != 0):
            m.d.sync += left.eq(left - 1)
        m.d.comb += [inner["adc_done"].eq(left == 1), inner["adc_code"].eq(code)]
        return {"adc_done", "adc_code"}

    def _tiles(self, m: Module, inner: dict[str, Value]) -> set[str]:
        """Add event sources for all tiles; a high bit of ``offer`` queues a numbered event of its tile."""
        if "tile_valid" not in inner:
            return set()
        tiles = len(inner["tile_valid"])
        offer = self._input("offer", tiles)
        fields = [f"tile_{name}" for name in FIELDS if f"tile_{name}" in inner]
        numbers, valid = [], []
        for tile in range(tiles):
            bits = sum(len(inner[name]) for name in fields) // tiles
            number, any_left = self._numbered(m, offer[tile], inner["tile_ready"][tile], bits)
            numbers.append(number)
            valid.append(any_left)
        start = 0
        for name in fields:
            bits = len(inner[name]) // tiles
            m.d.comb += inner[name].eq(Cat(number[start : start + bits] for number in numbers))
            start += bits
        m.d.comb += inner["tile_valid"].eq(Cat(valid))
        return {"tile_valid", *fields}

    def _events(self, m: Module, inner: dict[str, Value]) -> set[str]:
        """Add the bin timer, and an event source that queues an event in every clock with ``offer`` high."""
        config = self.block.config
        if not isinstance(config, ClassifierConfig):
            return set()
        number, valid = self._numbered(m, self._input("offer", 1), inner["event_ready"], NUMBER_BITS)
        m.d.comb += [inner["event_valid"].eq(valid), inner["event_channel"].eq(channel_of(number, config.inputs))]
        restart = self._input("scan_start", 1)
        m.d.comb += inner["scan_start"].eq(restart)
        ports = {"i_clk": ClockSignal(), "i_rst": ResetSignal(), "i_scan_start": restart, "o_bin_end": inner["bin_end"]}
        setattr(m.submodules, TIMER, Instance(BinTimer.module_name, **ports))
        return {"event_valid", "event_channel", "scan_start", "bin_end"}

    @staticmethod
    def _numbered(m: Module, offer: Value, ready: Value, bits: int) -> tuple[Signal, Value]:
        """Return the number of the offered event, and whether an event is offered."""
        left, number = Signal(NUMBER_BITS), Signal(bits)
        taken = (left != 0) & ready
        m.d.sync += [left.eq(left + offer - taken), number.eq(number + taken)]
        return number, left != 0

    def _comparators(self, m: Module, inner: dict[str, Value]) -> set[str]:
        """Add ideal comparators for the analog front end."""
        config = self.block.config
        if not isinstance(config, ReadoutConfig) or "above" not in inner:
            return set()
        bits, count = config.sample_bits, config.taxels
        given, valid = self._input("sample", bits * count), self._input("sample_valid", 1)
        held = Signal(bits * count)
        with m.If(valid):
            m.d.sync += held.eq(given)
        above, below = [], []
        for taxel in range(count):
            x = held[taxel * bits : (taxel + 1) * bits].as_signed()
            u = inner["reference_code"][taxel * bits : (taxel + 1) * bits].as_signed()
            h: Value = Const(config.step)
            if config.closes:
                width = config.half_width_bits
                h = inner["half_width"][taxel * width : (taxel + 1) * width]
            difference = Signal(signed(bits + 2), name=f"difference_{taxel}")
            m.d.comb += difference.eq(x - u)
            above.append(difference >= h + config.encoder.strict)
            below.append(difference < -h)
        m.d.comb += inner["above"].eq(Cat(above))
        done = {"above"}
        if "below" in inner:
            m.d.comb += inner["below"].eq(Cat(below))
            done.add("below")
        if "sample_valid" in inner:
            m.d.comb += inner["sample_valid"].eq(valid)
            done.add("sample_valid")
        return done


def channel_of(number: Any, inputs: int) -> Any:
    """Return the input channel for the event of a given number."""
    return (number + (number >> 2)) % inputs


def bench_gates(block: Block[Any], slow: int = 0) -> Gates:
    """Return a block with its environment as gates; see ``inside`` for its flops."""
    made = RtlilModules(async_reset=False)
    made.add(block)
    if isinstance(block.config, ClassifierConfig):
        made.add(BinTimer(block.config))
    bench = Bench(block, slow)
    fragment = Fragment.get(bench, None)
    ports = [*bench.inputs, *bench.outputs]
    return gates_of(made.text + "\n" + rtlil.convert(fragment, name=TOP, ports=ports, emit_src=False), TOP)


def inside(gates: Gates, pattern: str = "") -> list[int]:
    """Return the indices of the block's own flops whose names match a pattern."""
    own = re.compile(rf"({DUT}\.|(?={TIMER}\.)){pattern}")
    return [number for number, name in enumerate(gates.flops) if own.match(name)]
