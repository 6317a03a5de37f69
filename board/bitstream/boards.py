"""Supported boards: pin connections and clock of a design; board definitions come from amaranth-boards."""

from typing import Any

from amaranth.build import Attrs, Pins, Resource, Subsignal
from amaranth.hdl import ClockDomain, ClockSignal, Elaboratable, Instance, Module, ResetSignal, Signal

from eskin.base.errors import InputError
from eskin.board.config import BoardConfig
from eskin.board.gateware.top import SKIN_PINS, Board
from eskin.board.sensor import MOST_ROWS

BOARDS = {
    "ulx3s": "ULX3S_85F_Platform",
    "ulx3s-45f": "ULX3S_45F_Platform",
    "ulx3s-25f": "ULX3S_25F_Platform",
    "ulx3s-12f": "ULX3S_12F_Platform",
}
"""Names that a user gives, and the platforms of ``amaranth_boards.ulx3s``; plain ``ulx3s`` is the most common board."""


def header_pins(name: str, open_pins: str, **signals: str) -> Resource:
    """Return signals at 3.3 V pins of the header, each as direction and pins; open pins are ``DOWN`` or ``NONE``."""
    parts = [Subsignal(signal, Pins(text[2:], dir=text[0], conn=("gpio", 0))) for signal, text in signals.items()]
    return Resource(name, 0, *parts, Attrs(IO_TYPE="LVCMOS33", PULLMODE=open_pins))


def aer_pins() -> Resource:
    """Return the pins for a foreign chip."""
    address = "i 1+ 1- 2+ 2- 3+ 3- 4+ 4- 5+ 5- 6+ 6-"
    return header_pins("aer", "DOWN", req="i 0+", req_off="i 7+", ack="o 0-", addr=address)


def skin_pins(rows: int) -> Resource:
    """Return the pins for a skin: the rows from pin 0+ on, and the SPI converter."""
    driven = [f"{pair}{sign}" for pair in range(MOST_ROWS // 2) for sign in "+-"][:rows]
    return header_pins("skin", "NONE", rows=f"o {' '.join(driven)}", sclk="o 8+", cs_n="o 8-", mosi="o 9+", miso="i 9-")


CRYSTAL_HZ, SYSTEM_HZ = 25_000_000, 50_000_000
VCO_HZ = 600_000_000  # the PLL allows 400 to 800 MHz (Lattice, FPGA-DS-02012, sysCLOCK)

UNUSED_INPUTS = (
    "RST", "STDBY", "PHASESEL0", "PHASESEL1", "PHASEDIR", "PHASESTEP", "PHASELOADREG", "PLLWAKESYNC", "ENCLKOP",
)  # fmt: skip


def platform_of(board: str) -> Any:
    """Return the Amaranth platform of a board."""
    if board not in BOARDS:
        raise InputError(f"--board must be one of {', '.join(BOARDS)}, not {board!r}")
    from amaranth_boards import ulx3s

    return getattr(ulx3s, BOARDS[board])()


class Clock(Elaboratable):
    """PLL that multiplies the 25 MHz of the crystal to 50 MHz; the design is in reset until the PLL locks."""

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        clock, locked, slow = Signal(), Signal(), Signal()
        m.domains.sync = ClockDomain()
        m.d.comb += slow.eq(platform.request("clk25", 0).i)
        m.submodules.pll = Instance(
            "EHXPLLL",
            p_CLKI_DIV=1,
            p_CLKFB_DIV=SYSTEM_HZ // CRYSTAL_HZ,
            p_CLKOP_DIV=VCO_HZ // SYSTEM_HZ,
            p_CLKOP_ENABLE="ENABLED",
            p_CLKOP_CPHASE=VCO_HZ // SYSTEM_HZ // 2 - 1,
            p_CLKOP_FPHASE=0,
            p_FEEDBK_PATH="CLKOP",
            i_CLKI=slow,
            i_CLKFB=clock,
            **{f"i_{name}": 0 for name in UNUSED_INPUTS},
            o_CLKOP=clock,
            o_LOCK=locked,
        )
        waits = Signal(2, init=3)  # LOCK is asynchronous to the clock
        m.domains.start = start = ClockDomain(reset_less=True, local=True)
        m.d.comb += [start.clk.eq(clock), ClockSignal("sync").eq(clock), ResetSignal("sync").eq(waits[1])]
        m.d.start += [waits[0].eq(~locked), waits[1].eq(waits[0])]
        platform.add_clock_constraint(clock, SYSTEM_HZ)
        return m


class OnBoard(Elaboratable):
    """Top level with a design connected to the pins: serial line, two LEDs, and another chip or a skin."""

    def __init__(self, config: BoardConfig) -> None:
        self.config = config

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.clock = Clock()
        m.submodules.board = board = Board(self.config)
        uart = platform.request("uart", 0)
        m.d.comb += [
            board.rx.eq(uart.rx.i),
            uart.tx.o.eq(board.tx),
            platform.request("led", 0).o.eq(~board.rx),
            platform.request("led", 1).o.eq(~board.tx),
        ]
        if self.config.chip is None:
            platform.add_resources([aer_pins()])
            aer = platform.request("aer", 0)
            m.d.comb += [
                board.aer_req.eq(aer.req.i),
                board.aer_req_off.eq(aer.req_off.i),
                aer.ack.o.eq(board.aer_ack),
                board.aer_addr.eq(aer.addr.i),
            ]
        elif self.config.sensor is not None:
            platform.add_resources([skin_pins(self.config.chip.readout.rows)])
            skin = platform.request("skin", 0)
            m.d.comb += [getattr(skin, name).o.eq(getattr(board, name)) for name in SKIN_PINS if name != "miso"]
            m.d.comb += board.miso.eq(skin.miso.i)
        return m
