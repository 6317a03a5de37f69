"""Top level of a design on a board: its clock, and its connection to the pins."""

from typing import Any

from amaranth.hdl import ClockDomain, ClockSignal, Elaboratable, Module, ResetSignal, Signal

from eskin.board.bitstream.boards import FpgaBoard
from eskin.board.config import BoardConfig
from eskin.board.gateware.top import SKIN_PINS, Board

START_BITS = 10
"""Bits of the count of clocks for which a design without PLL stays in reset: block RAMs start late."""


class Clock(Elaboratable):
    """System clock: the crystal, or a PLL of it; the design is in reset at the start, or until the PLL locks."""

    def __init__(self, board: FpgaBoard) -> None:
        self.board = board

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        clock, locked, slow = Signal(), Signal(), Signal()
        m.domains.sync = ClockDomain()
        m.d.comb += slow.eq(platform.request(platform.default_clk, 0).i)
        crystal_hz, clock_hz = platform.default_clk_frequency, self.board.clock_hz
        if self.board.family.pll is not None:
            m.submodules.pll = self.board.family.pll(crystal_hz, clock_hz, slow, clock, locked)
            platform.add_clock_constraint(clock, clock_hz)
        else:
            m.d.comb += clock.eq(slow)
        waits = Signal(2, init=3)  # LOCK is asynchronous to the clock
        m.domains.start = start = ClockDomain(reset_less=True, local=True)
        m.d.comb += [start.clk.eq(clock), ClockSignal("sync").eq(clock), ResetSignal("sync").eq(waits[1])]
        m.d.start += [waits[0].eq(~locked), waits[1].eq(waits[0])]
        if self.board.family.pll is None:
            count = Signal(START_BITS)
            m.d.comb += locked.eq(count.all())
            m.d.start += count.eq(count + ~locked)
        return m


class OnBoard(Elaboratable):
    """Top level with a design connected to the pins: serial line, two LEDs, and another chip or a skin."""

    def __init__(self, config: BoardConfig, board: FpgaBoard) -> None:
        self.config, self.board = config, board

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.clock = Clock(self.board)
        m.submodules.board = board = Board(self.config)
        uart = platform.request("uart", 0)
        m.d.comb += [
            board.rx.eq(uart.rx.i),
            uart.tx.o.eq(board.tx),
            platform.request("led", 0).o.eq(~board.rx),
            platform.request("led", 1).o.eq(~board.tx),
        ]
        if self.config.chip is None:
            platform.add_resources([self.board.aer_pins()])
            aer = platform.request("aer", 0)
            m.d.comb += [
                board.aer_req.eq(aer.req.i),
                board.aer_req_off.eq(aer.req_off.i),
                aer.ack.o.eq(board.aer_ack),
                board.aer_addr.eq(aer.addr.i),
            ]
        elif self.config.sensor is not None:
            platform.add_resources([self.board.skin_pins(self.config.chip.readout.rows)])
            skin = platform.request("skin", 0)
            m.d.comb += [getattr(skin, name).o.eq(getattr(board, name)) for name in SKIN_PINS if name != "miso"]
            m.d.comb += board.miso.eq(skin.miso.i)
        return m
