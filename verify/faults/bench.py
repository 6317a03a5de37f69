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
        self.inner: dict[str, Signal] = {}  # ports of the block
        self.driven: set[str] = set()  # ports that a model of the environment drives

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        wires: dict[str, Any] = {"i_clk": ClockSignal(), "i_rst": ResetSignal()}
        for name, member in self.block.signature.members.items():
            inward = member.flow is wiring.In
            port = Signal(len(Value.cast(getattr(self.block, name))), name=f"{name}_inside" if inward else name)
            wires[f"{'i' if inward else 'o'}_{name}"] = self.inner[name] = port
            if not inward:
                self.outputs.append(port)
        setattr(m.submodules, DUT, Instance(self.block.module_name, **wires))
        for add in (self._receiver, self._comparators, self._converter, self._tiles, self._events):
            add(m)
        for name, member in self.block.signature.members.items():
            if member.flow is wiring.In and name not in self.driven:
                self._drive(m, name, self._input(name, len(self.inner[name])))
        return m

    def _drive(self, m: Module, name: str, value: Value) -> None:
        """Drive a port, if the block has it."""
        if name in self.inner:
            m.d.comb += self.inner[name].eq(value)
            self.driven.add(name)

    def _input(self, name: str, width: int) -> Signal:
        self.inputs.append(Signal(width, name=name))
        return self.inputs[-1]

    def _receiver(self, m: Module) -> None:
        """Add a four-phase receiver: ACK follows REQ, and a started handshake always completes."""
        if "aer_ack" not in self.inner:
            return
        ack = Cat(self.inner[name] for name in self.block.config.protocol.requests).any()
        if self.slow:
            wait, raised = Signal(range(self.slow)), Signal()
            due = wait == self.slow - 1
            with m.If((ack != raised) | wait.any()):
                m.d.sync += [wait.eq(Mux(due, 0, wait + 1)), raised.eq(raised ^ due)]
            ack = raised
        high, turned = self._input("ack_high", 1), self._input("ack_turned", 1)
        self._drive(m, "aer_ack", (ack | high) ^ turned)

    def _converter(self, m: Module) -> None:
        """Add an ADC whose codes depend on the taxel and on the input ``salt``."""
        inner = self.inner
        if "adc_start" not in inner:
            return
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
        self._drive(m, "adc_done", left == 1)
        self._drive(m, "adc_code", code)

    def _tiles(self, m: Module) -> None:
        """Add event sources for all tiles; a high bit of ``offer`` queues a numbered event of its tile."""
        if "tile_valid" not in self.inner:
            return
        tiles, ready = len(self.inner["tile_valid"]), self.inner["tile_ready"]
        offer = self._input("offer", tiles)
        bits_of = {f"tile_{name}": len(self.inner.get(f"tile_{name}", ())) // tiles for name in FIELDS}
        sources = [self._numbered(m, offer[tile], ready[tile], sum(bits_of.values())) for tile in range(tiles)]
        start = 0
        for name, bits in bits_of.items():
            self._drive(m, name, Cat(number[start : start + bits] for number, _ in sources))
            start += bits
        self._drive(m, "tile_valid", Cat(valid for _, valid in sources))

    def _events(self, m: Module) -> None:
        """Add the bin timer, and an event source that queues an event in every clock with ``offer`` high."""
        config = self.block.config
        if not isinstance(config, ClassifierConfig):
            return
        number, valid = self._numbered(m, self._input("offer", 1), self.inner["event_ready"], NUMBER_BITS)
        restart, ends = self._input("scan_start", 1), self.inner["bin_end"]
        ports = {"i_clk": ClockSignal(), "i_rst": ResetSignal(), "i_scan_start": restart, "o_bin_end": ends}
        setattr(m.submodules, TIMER, Instance(BinTimer.module_name, **ports))
        self.driven.add("bin_end")
        self._drive(m, "event_valid", valid)
        self._drive(m, "event_channel", channel_of(number, config.inputs))
        self._drive(m, "scan_start", restart)

    @staticmethod
    def _numbered(m: Module, offer: Value, ready: Value, bits: int) -> tuple[Signal, Value]:
        """Return the number of the offered event, and whether an event is offered."""
        left, number = Signal(NUMBER_BITS), Signal(bits)
        taken = (left != 0) & ready
        m.d.sync += [left.eq(left + offer - taken), number.eq(number + taken)]
        return number, left != 0

    def _comparators(self, m: Module) -> None:
        """Add ideal comparators for the analog front end."""
        config, inner = self.block.config, self.inner
        if not isinstance(config, ReadoutConfig) or "above" not in inner:
            return
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
        self._drive(m, "above", Cat(above))
        self._drive(m, "below", Cat(below))
        self._drive(m, "sample_valid", valid)


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
