"""How a component becomes one Verilog module, however many instances of it there are."""

from __future__ import annotations

import re
from typing import Any

from amaranth.back import rtlil
from amaranth.hdl import ClockDomain, ClockSignal, Instance, Module, ResetSignal, Value
from amaranth.lib import wiring

from model.config import ReadoutConfig


class Block(wiring.Component):
    """A component of the readout, configured by a ``ReadoutConfig`` and nothing else.

    Since all instances of a block in a readout are alike, its Verilog is emitted once, and its parents refer to
    it by name. Everywhere else (Amaranth's simulator, formal) it is an ordinary submodule.

    Attributes
    ----------
    module_name : str
        Name of the Verilog module.
    """

    module_name: str
    _MustUse__silence = True  # of many equal blocks one is elaborated: the others' warnings would be false

    def __init__(self, config: ReadoutConfig, ports: dict[str, Any]) -> None:
        self.config = config
        super().__init__({name: port for name, port in ports.items() if port is not None})

    def connect(self, m: Module, name: str, outside: Value) -> None:
        """Connect a port of this block to a signal of its parent, in the port's direction."""
        port = getattr(self, name)
        inward = self.signature.members[name].flow is wiring.In
        m.d.comb += port.eq(outside) if inward else outside.eq(port)

    def place(self, m: Module, name: str, platform: Any) -> None:
        """Add this block to a parent as its submodule ``name``; its ports are this component's signals."""
        m.submodules[name] = platform.instance(self) if isinstance(platform, Netlist) else self


class Netlist:
    """The platform that collects the RTLIL of every distinct block while a design is elaborated.

    Parameters
    ----------
    async_reset : bool
        Whether flops reset asynchronously.
    """

    def __init__(self, async_reset: bool) -> None:
        self.async_reset = async_reset
        self.modules: dict[str, str] = {}

    def add(self, block: Block) -> str:
        """Return the RTLIL text of a block, made on first use, after those of the blocks within it."""
        if block.module_name not in self.modules:
            text = rtlil.convert(
                block,
                name=block.module_name,
                platform=self,
                emit_src=False,
                missing_domain=lambda name: ClockDomain(name, async_reset=self.async_reset),
            )
            self.modules[block.module_name] = _in_order(text, ["clk", "rst", *block.signature.members])
        return self.modules[block.module_name]

    def instance(self, block: Block) -> Instance:
        """Return an instance of a block by name, wired to the block's own port signals."""
        clocked = re.search(r"^  wire .*input \d+ +\\clk$", self.add(block), re.MULTILINE)
        wires: dict[str, Any] = {"i_clk": ClockSignal(), "i_rst": ResetSignal()} if clocked else {}
        for name, member in block.signature.members.items():
            wires[f"{'i' if member.flow is wiring.In else 'o'}_{name}"] = getattr(block, name)
        return Instance(block.module_name, **wires)


def _in_order(text: str, names: list[str]) -> str:
    """Return the RTLIL of a module with its ports numbered in the order of some names."""
    present = [name for name in names if re.search(rf"^  wire .*put \d+ .*\\{name}$", text, re.MULTILINE)]
    for number, name in enumerate(present, 1):
        text = re.sub(rf"^(  wire .*put) \d+ (.*\\{name})$", rf"\1 {number} \2", text, flags=re.MULTILINE)
    return text
