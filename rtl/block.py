"""Blocks whose Verilog module is written once for any number of instances."""

from collections.abc import Iterable
from typing import Any, Generic, TypeVar

from amaranth.back import rtlil
from amaranth.hdl import ClockDomain, ClockSignal, Instance, Module, ResetSignal, Value
from amaranth.lib import wiring

from eskin.rtl import yosys

Config = TypeVar("Config")

yosys.offer_to_amaranth()


def numbered(name: str, number: int, count: int) -> str:
    """Return the name of one of several equal submodules, such as ``row_02`` of 12, so that the names sort."""
    return f"{name}_{number:0{len(str(count - 1))}}"


class Block(wiring.Component, Generic[Config]):
    """A component configured only by the parameter object of its readout.

    Since all instances of a block in a readout are alike, its Verilog is emitted once, and its parents refer to
    it by name. Everywhere else (Amaranth's simulator, formal) it is an ordinary submodule.
    """

    module_name: str
    """Name of the Verilog module."""
    config: Config
    _MustUse__silence = True  # only one of many equal blocks is elaborated; warnings about the others would be false

    def __init__(self, config: Config, ports: dict[str, Any]) -> None:
        self.config = config
        super().__init__({name: port for name, port in ports.items() if port is not None})

    def connect(self, m: Module, name: str, outside: Value) -> None:
        """Connect a port of this block to a signal of its parent, in the direction of the port."""
        port = getattr(self, name)
        inward = self.signature.members[name].flow is wiring.In
        m.d.comb += port.eq(outside) if inward else outside.eq(port)

    def connect_all(self, m: Module, other: wiring.Component, names: Iterable[str]) -> None:
        """Connect ports of this block to the ports of the same names of its parent, or of a neighbour."""
        for name in names:
            self.connect(m, name, getattr(other, name))

    def place(self, m: Module, name: str, platform: Any) -> None:
        """Add this block to a parent as submodule ``name``.

        In the Verilog the parent's wire to a port is named after both: ``row_0_request``.
        """
        if not isinstance(platform, RtlilModules):
            m.submodules[name] = self
            return
        m.submodules[name] = platform.instance(self)
        for port in self.signature.members:
            Value.cast(getattr(self, port)).name = f"{name}_{port}"


class RtlilModules:
    """Platform that collects the RTLIL of every distinct block during elaboration."""

    def __init__(self, async_reset: bool) -> None:
        self.async_reset = async_reset
        self.modules: dict[str, str] = {}
        self.blocks: dict[str, Block[Any]] = {}

    @property
    def text(self) -> str:
        """RTLIL text of all blocks, submodules first."""
        return "\n".join(self.modules.values())

    def add(self, block: Block[Any]) -> str:
        """Return the RTLIL text of a block, generated at first use.

        A block of another kind or configuration must not have the same module name: one of them would be lost.
        """
        first = self.blocks.setdefault(block.module_name, block)
        if (type(first), first.config) != (type(block), block.config):
            raise ValueError(
                f"two different blocks are named {block.module_name}: {type(first).__name__} of {first.config} and "
                f"{type(block).__name__} of {block.config}; give one block another name"
            )
        if block.module_name not in self.modules:
            text = rtlil.convert(
                block,
                name=block.module_name,
                platform=self,
                emit_src=False,
                missing_domain=lambda name: ClockDomain(name, async_reset=self.async_reset),
            )
            self.modules[block.module_name] = yosys.in_order(text, ["clk", "rst", *block.signature.members])
        return self.modules[block.module_name]

    def instance(self, block: Block[Any]) -> Instance:
        """Return an instance of a block's module, wired to the port signals of the block."""
        clocked = yosys.is_clocked(self.add(block))
        wires: dict[str, Any] = {"i_clk": ClockSignal(), "i_rst": ResetSignal()} if clocked else {}
        for name, member in block.signature.members.items():
            wires[f"{'i' if member.flow is wiring.In else 'o'}_{name}"] = getattr(block, name)
        return Instance(block.module_name, **wires)
