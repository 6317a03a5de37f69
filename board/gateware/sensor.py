"""Scan a resistive matrix: drive a row, wait until it settles, and convert all columns with an SPI converter."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import Component, In, Out

from eskin.board.sensor import PARTS, SensorConfig
from eskin.model.config import ReadoutConfig

SYNCHRONISER_CLOCKS = 2
LATER_CLOCKS = 1  # from the rise of SCLK to the sampled level: delay of pins and wires


class Scanner(Component):
    """Send one sample for each taxel in each period, row by row.

    In each frame, MOSI and CS change while SCLK is low. A bit of MISO is read one clock after the rising edge of SCLK,
    and arrives two clocks later. A scan that is due waits until it is allowed.
    """

    _MustUse__silence = True  # some users read the ports without elaboration

    def __init__(self, config: SensorConfig, readout: ReadoutConfig, clock_hz: int) -> None:
        self.config, self.readout, self.clock_hz = config, readout, clock_hz
        super().__init__(
            {
                "rows": Out(readout.rows),  # one is high during the scan of a row; all are low between scans
                "sclk": Out(1),
                "cs_n": Out(1, init=1),
                "mosi": Out(1),
                "miso": In(1),
                "allowed": In(1),  # a scan may begin
                "restart": In(1),  # the next scan begins as soon as it is allowed
                "valid": Out(1),
                "sample": Out(readout.sample_bits),  # signed, for one clock
                "late": Out(1),  # a scan begins more than a period after it was due: ticks between are lost
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        part = PARTS[self.config.part]
        half, pause = self.config.half_clocks(self.clock_hz), self.config.pause_clocks(self.clock_hz)
        settle = self.config.settle_clocks(self.clock_hz)
        frames = self.readout.columns + part.latency
        wait, bit = Signal(range(max(half, pause, settle))), Signal(range(part.frame_bits))
        frame, word = Signal(range(frames + 1)), Signal(part.frame_bits)
        begins, rises, ends = Signal(), Signal(), Signal()
        m.submodules.synchroniser = FFSynchronizer(self.miso, miso := Signal(), stages=SYNCHRONISER_CLOCKS)
        m.d.comb += self.mosi.eq(word[-1])
        with m.If(wait != 0):
            m.d.sync += wait.eq(wait - 1)
        with m.FSM():
            with m.State("REST"), m.If(self._due(m, begins) & self.allowed):
                m.d.comb += begins.eq(1)
                m.d.sync += [self.rows.eq(1), wait.eq(settle - 1), frame.eq(0)]
                m.next = "SETTLE"
            with m.State("SETTLE"), m.If(wait == 0):
                self._open(m, word, frame, bit, wait, half)
            with m.State("LOW"), m.If(wait == 0):
                m.d.comb += rises.eq(1)
                m.d.sync += [self.sclk.eq(1), wait.eq(half - 1)]
                m.next = "HIGH"
            with m.State("HIGH"), m.If(wait == 0):
                m.d.sync += [self.sclk.eq(0), word.eq(word << 1), wait.eq(half - 1), bit.eq(bit + 1)]
                m.next = "LOW"
                with m.If(bit == part.frame_bits - 1):
                    m.next = "CLOSE"
            with m.State("CLOSE"), m.If(wait == 0):
                m.d.sync += [self.cs_n.eq(1), wait.eq(pause - 1), frame.eq(frame + 1)]
                m.next = "PAUSE"
            with m.State("PAUSE"), m.If(wait == 0):
                m.d.comb += ends.eq(frame > part.latency)
                self._open(m, word, frame, bit, wait, half)
                with m.If(frame == frames):
                    m.d.sync += [self.cs_n.eq(1), self.rows.eq(self.rows << 1), wait.eq(settle - 1), frame.eq(0)]
                    m.next = "SETTLE"
                    with m.If(self.rows[-1]):
                        m.next = "REST"
        self._take(m, rises, ends, miso)
        return m

    def _due(self, m: Module, begins: Signal) -> Signal:
        """Return whether a scan must begin: after a restart, and then once per period."""
        period = round(self.clock_hz / self.readout.sample_rate_hz)
        count, due, missed, runs = Signal(range(period)), Signal(init=1), Signal(), Signal()
        m.d.comb += self.late.eq(begins & missed)
        with m.If(begins):
            m.d.sync += [due.eq(0), missed.eq(0), runs.eq(1)]
        with m.If(~runs):
            m.d.sync += count.eq(period - 1)
        with m.Elif(count != 0):
            m.d.sync += count.eq(count - 1)
        with m.Else():
            m.d.sync += [count.eq(period - 1), due.eq(1), missed.eq(due & ~begins)]
        with m.If(self.restart):
            m.d.sync += [due.eq(1), missed.eq(0), runs.eq(0)]
        return due

    def _open(self, m: Module, word: Signal, frame: Signal, bit: Signal, wait: Signal, half: int) -> None:
        """Begin an SPI frame with the number of a channel.

        After the last channel, further frames collect the late codes.
        """
        part = PARTS[self.config.part]
        last = self.readout.columns - 1
        channel = Mux(frame > last, last, frame)
        m.d.sync += [
            self.cs_n.eq(0),
            word.eq(Const(part.first, part.frame_bits) | (channel << part.channel_bit)),
            bit.eq(0),
            wait.eq(half - 1),
        ]
        m.next = "LOW"

    def _take(self, m: Module, rises: Signal, ends: Signal, miso: Signal) -> None:
        """Collect the bits of a code, and convert it to a signed sample of the readout's width."""
        bits, width = PARTS[self.config.part].bits, self.readout.sample_bits
        came, code = Signal(SYNCHRONISER_CLOCKS + LATER_CLOCKS), Signal(bits)
        m.d.sync += came.eq(Cat(rises, came))
        with m.If(came[-1]):
            m.d.sync += code.eq(Cat(miso, code))
        signed = Cat(code[:-1], ~code[-1])
        m.d.comb += self.valid.eq(ends)
        m.d.comb += self.sample.eq(Cat(Const(0, width - bits), signed) if width >= bits else signed[bits - width :])
