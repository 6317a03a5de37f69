"""Write the project folder for a shuttle."""

import json
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.flow.asic.synthesis import ties
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library
from eskin.flow.tapeout import pins
from eskin.flow.tapeout.case import FRAMES, case
from eskin.flow.tapeout.shuttles import DENSITY, Shuttle
from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import registers
from eskin.rtl import yosys
from eskin.rtl.delivery import timing
from eskin.rtl.registers.loader import SampleLoader
from eskin.rtl.verilog import block_verilog, header, verilog

TEMPLATES = Path(__file__).parent / "templates"
SCRIPT = (
    "read_verilog {sources}; synth -flatten -top {top}; dfflibmap -liberty cells.lib; abc -liberty cells.lib; "
    "opt_clean -purge; read_liberty -lib -ignore_miss_func cells.lib; {ties}splitnets; "
    "rename -enumerate -pattern g% c:*; opt_clean -purge; check -assert -mapped; "
    "write_verilog -noattr -noexpr netlist.v"
)


@dataclass(frozen=True)
class Mapped:
    """A chip as library cells."""

    # netlist, cells: Verilog of netlist and library cells, without delays
    netlist: str = field(repr=False)
    cells: str = field(repr=False)
    area_um2: float  # of the cells alone: no wires, no clock tree, no filling


@dataclass(frozen=True)
class Tapeout:
    """A chip for a shuttle."""

    shuttle: Shuttle
    config: ReadoutConfig
    top: str
    author: str
    title: str
    size: str  # tiles or slot
    sources: dict[str, str]  # Verilog by file name, the top first

    def write(self, folder: Path, netlist: Mapped | None) -> list[Path]:
        """Write the project folder, and return its files."""
        files = {f"src/{name}": text for name, text in self.sources.items()}
        files["docs/info.md"] = self._filled("info.md", **self._facts())
        wires = ".ui_in(ui_in), .uo_out(uo_out), .uio_in(uio_in), .uio_out(uio_out), .uio_oe(uio_oe)"
        instance = f"  {self.top} chip ({wires}, .ena(ena), .clk(clk), .rst_n(rst_n));\n"
        pads = instance if self.shuttle.tiny else (TEMPLATES / "pads.v").read_text()
        files["test/tb.v"] = self._filled("tb.v", instance=pads)
        files["test/test.py"] = (TEMPLATES / "test.txt").read_text()
        files["test/expected.json"] = json.dumps(case(self.config)) + "\n"
        files["test/requirements.txt"] = (TEMPLATES / "requirements.txt").read_text()
        cells = " ".join(f"$(PDK_ROOT)/{self.shuttle.pdk}/{path}" for path in self.shuttle.cells)
        power = "-DUSE_POWER_PINS -DUNIT_DELAY=\\#1" if self.shuttle.name == "tt-sky" else ""
        sources = " ".join([*self.sources] if self.shuttle.tiny else ["chip_core.sv", *self.sources])
        files["test/Makefile"] = self._filled("makefile.txt", sources=sources, cells=cells, defines=power)
        if netlist is not None:
            files["test/gate_level_netlist.v"], files["test/cells.v"] = netlist.netlist, netlist.cells
        files |= self._tiny() if self.shuttle.tiny else self._wafer()
        paths = []
        for name, text in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as file:
                file.write(text.encode())
            paths.append(path)
        return paths

    @property
    def period_ns(self) -> float:
        """Clock period in ns, to a picosecond."""
        return round(1e9 / self.config.clock_hz, 3)

    def _tiny(self) -> dict[str, str]:
        """Return the files required by Tiny Tapeout."""
        project = {
            "title": self.title,
            "author": self.author,
            "discord": "",
            "description": "Level-crossing converters, arbiter and AER bus for a tactile array",
            "language": "Verilog",
            "clock_hz": round(self.config.clock_hz),
            "tiles": self.size,
            "top_module": self.top,
        }
        lines = ["project:", *(f"  {key}: {json.dumps(value)}" for key, value in project.items()), "  source_files:"]
        lines += [f"    - {json.dumps(name)}" for name in self.sources]
        lines.append("pinout:")
        groups = {"ui": pins.INPUTS, "uo": pins.outputs(self.config), "uio": pins.addresses(self.config)}
        for group, names in groups.items():
            lines += [f"  {group}[{bit}]: {json.dumps(name)}" for bit, name in enumerate(names)]
        lines.append("yaml_version: 6")
        # Beside the settings of every flow, those that Tiny Tapeout requires: its tiles have one grid of power lines.
        settings = self._filled("config.json", density=round(100 * DENSITY), period=self.period_ns)
        return {
            "info.yaml": "\n".join(lines) + "\n",
            "src/config.json": settings,
            "src/project.sdc": self._constraints(),
        }

    def _constraints(self) -> str:
        """Return the timing constraints of the chip behind the pins of Tiny Tapeout."""
        signals = {f"ui_in[{bit}]": name for bit, name in enumerate(pins.INPUTS)}
        asynchronous = [pin for pin, name in signals.items() if name in pins.ASYNCHRONOUS]
        acks = [pin for pin, name in signals.items() if name == "aer_ack"]
        timed = [pin for pin in signals if pin not in asynchronous + acks]
        return timing(
            self.config,
            header=header(self.config, "#").replace("eskin_readout:", f"{self.top}:", 1),
            base="sample rate times clocks per sample",
            clock="clk",
            reset="rst_n",
            driven="ui_in[*] uio_in[*] ena",
            inputs=" ".join([*timed, "uio_in[*]", "ena"]),
            outputs="uo_out[*] uio_out[*] uio_oe[*]",
            ack=" ".join(acks),
            spi=" ".join(asynchronous),
            synchronised="rst_n",
            end=(TEMPLATES / "librelane.sdc").read_text(),
        )

    def _wafer(self) -> dict[str, str]:
        """Return the files to copy over the template of wafer.space."""
        settings: dict[str, Any] = {
            "meta": {"version": 3, "flow": "Chip"},
            "VERILOG_FILES": [f"dir::../src/{name}" for name in ("chip_top.sv", "chip_core.sv", *self.sources)],
            "CLOCK_PERIOD": self.period_ns,
        }
        core = self._filled("chip_core.sv")
        return {"src/chip_core.sv": core, "librelane/eskin.json": json.dumps(settings, indent=2) + "\n"}

    def _facts(self) -> dict[str, Any]:
        """Return the facts for the documentation."""
        clocks = pins.CLOCKS_PER_BIT * self.config.taxels * self.config.sample_bits + pins.CLOCKS_BESIDE
        (identity,) = (register.reset for register in registers(self.config) if register.name == "id")
        return {
            "encoding": self.config.encoding,
            "resolution": self.config.resolution,
            "sample_bits": self.config.sample_bits,
            "frame_clocks": clocks,
            "clock_mhz": f"{self.config.clock_hz / 1e6:g}",
            "rate": f"{self.config.clock_hz / clocks:,.0f}",
            "frames": FRAMES,
            "identity": f"{identity:08x}",
        }

    def _filled(self, template: str, **values: Any) -> str:
        config = self.config
        plain = {"top": self.top, "rows": config.rows, "columns": config.columns, "taxels": config.taxels}
        return Template((TEMPLATES / template).read_text()).substitute(plain | values)


def sources_of(config: ReadoutConfig, top: str) -> dict[str, str]:
    """Return the Verilog of a chip by file name: pins, sample loader, readout."""
    requests = config.protocol.requests  # ON first
    address = "aer_addr" if config.address_bits else "1'b0"
    text = Template((TEMPLATES / "top.v").read_text()).substitute(
        top=top,
        rows=config.rows,
        columns=config.columns,
        taxels=config.taxels,
        last_sample_bit=config.taxels * config.sample_bits - 1,
        last_address_bit=max(config.address_bits - 1, 0),
        request_wires=", ".join(reversed(requests)),
        request_ports="\n".join(f"      .{name}({name})," for name in reversed(requests)),
        request_pins=", ".join(["1'b0", *requests][-2:]),
        address_pins=f"{{{pins.ADDRESS_PINS - max(config.address_bits, 1)}'b0, {address}}}"
        if config.address_bits < pins.ADDRESS_PINS
        else address,
        output_enables=f"{(1 << config.address_bits) - 1:02x}",
    )
    loader = header(config, "//") + block_verilog(SampleLoader(config))
    return {f"{top}.v": text, "eskin_loader.v": loader, "eskin_readout.v": verilog(config)}


def mapped(sources: dict[str, str], top: str, library: Library) -> Mapped:
    """Return a chip mapped to library cells, from its Verilog by file name."""
    script = SCRIPT.format(sources=" ".join(sources), top=top, ties=ties(library))
    files = {name: text.encode() for name, text in sources.items()} | {"cells.lib": library.content}
    try:
        netlist = yosys.run(script, "", "netlist.v", files)
    except yosys.YosysError as error:
        raise InputError(f"the cell library {library.path} lacks cells for {top}: {error.reason}") from None
    kinds = Counter(re.findall(r"^  (\w+) \w+ \($", netlist, re.MULTILINE))
    if bare := sorted(kind for kind in kinds if not library.cells[kind].area_um2 > 0):
        raise InputError(f"the cell library {library.path} states no area for {bare[0]}; give --size without --lib")
    area = sum(library.cells[kind].area_um2 * count for kind, count in kinds.items())
    return Mapped(netlist, models(library, set(kinds)), area)


def plan(
    config: ReadoutConfig,
    shuttle: Shuttle,
    library: Library | None,
    size: str | None,
    top: str,
    author: str,
    title: str,
) -> tuple[Tapeout, Mapped | None]:
    """Return a chip for a shuttle, and its mapped cells if a library is given."""
    if not re.fullmatch(r"tt_um_[a-z0-9_]+", top):
        raise InputError(f"--top must begin with tt_um_, then small letters, digits and _, not {top!r}")
    if not author.strip() or not title.strip():
        raise InputError("the shuttle asks for an author and a title; give --author NAME and --title TEXT")
    if size is not None and size not in shuttle.sizes:
        raise InputError(f"{shuttle.name} has the sizes {', '.join(shuttle.sizes)}, not {size}")
    if size is None and library is None:
        raise InputError("the size of the chip is unknown: add --lib typ.lib, or --size " + next(iter(shuttle.sizes)))
    sources = sources_of(config, top)
    cells = None if library is None else mapped(sources, top, library)
    needed = size if cells is None else shuttle.smallest(cells.area_um2)
    order = list(shuttle.sizes)
    if size is not None and cells is not None and order.index(size) < order.index(str(needed)):
        raise InputError(f"{cells.area_um2:,.0f} um2 of cells need {needed}, more than {size}; leave --size out")
    return Tapeout(shuttle, config, top, author, title, size or str(needed), sources), cells
