"""Join a block and its checker to one design for a solver."""

from typing import Any

from amaranth.asserts import AnyConst
from amaranth.back import rtlil
from amaranth.hdl import (
    ClockSignal,
    Elaboratable,
    Fragment,
    Instance,
    Module,
    ResetSignal,
    Shape,
    Signal,
)
from amaranth.lib import wiring

from eskin.rtl import yosys
from eskin.rtl.block import Block, RtlilModules
from eskin.verify.proofs.checker import Checker, inputs

TOP = "bench"


class Bench(Elaboratable):
    """Block under proof with its checker; all inputs are free unless the checker drives them.

    ``bad`` and ``seen`` are outputs of the design by the name of the property: it fails; its case happens.
    """

    def __init__(self, checker: Checker[Any], clocked: bool) -> None:
        self.checker, self.clocked = checker, clocked
        self.free: list[Signal] = []
        self.bad = {name: Signal(name=f"bad_{name}") for name in checker.proved}
        self.seen = {name: Signal(name=f"seen_{name}") for name in checker.proved}

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        checker = self.checker
        m.submodules.checker = checker
        driven = checker.drive(m, self._input)
        block = checker.block(checker.config)
        wires: dict[str, Any] = {"i_clk": ClockSignal(), "i_rst": ResetSignal()} if self.clocked else {}
        for name, member in block.signature.members.items():
            inward = member.flow is wiring.In
            wire = getattr(checker, name)
            if inward and name not in driven:
                m.d.comb += wire.eq(self._input(name, Shape.cast(member.shape).width))
            wires[f"{'i' if inward else 'o'}_{name}"] = wire
        wires |= {f"o_{name}": getattr(checker, name) for name in checker.inner(checker.config)}
        m.submodules.dut = Instance(block.module_name, **wires)
        constants = checker.constants(checker.config)
        for name in constants:
            m.d.comb += getattr(checker, name).eq(AnyConst(len(getattr(checker, name))))
        told = {*block.signature.members, *checker.inner(checker.config), *driven, *constants}
        if left := set(inputs(checker)) - told:
            raise AssertionError(f"nothing drives {', '.join(sorted(left))} of {type(checker).__name__}")
        for name in self.bad:
            ok, seen = getattr(checker, f"ok_{name}"), getattr(checker, f"seen_{name}")
            m.d.comb += [self.bad[name].eq(~ok), self.seen[name].eq(seen)]
        return m

    def _input(self, name: str, width: int) -> Signal:
        """Return a new input of the design."""
        self.free.append(Signal(width, name=name))
        return self.free[-1]

    @property
    def ports(self) -> list[Signal]:
        """Input ports, then output ports in the order of ``bad`` and ``seen``."""
        return [*self.free, *self.bad.values(), *self.seen.values()]


def rtlil_of(block: Block[Any]) -> str:
    """Return the RTLIL of a block and of the blocks within it."""
    made = RtlilModules(async_reset=False)
    made.add(block)
    return made.text


def design(checker: Checker[Any], mutant: str = "") -> tuple[str, Bench]:
    """Return the RTLIL of block, checker and bench (top module ``bench``), and the bench.

    The first clock of a run stands for the one that ends a reset. Later resets are free, at any time. ``mutant`` is
    RTLIL that takes the place of the block's own.
    """
    text = mutant or rtlil_of(checker.block(checker.config))
    name = checker.block.module_name
    bench = Bench(checker, yosys.is_clocked(text[text.rindex(f"module \\{name}\n") :]))
    fragment = Fragment.get(bench, "formal")
    return text + "\n" + rtlil.convert(fragment, name=TOP, ports=bench.ports, emit_src=False), bench


def exposing(checker: Checker[Any]) -> str:
    """Return the Yosys command that exposes the registers observed by a checker."""
    name, places = checker.block.module_name, checker.places(checker.config)
    renamed = "".join(f"rename {place} {wire}; " for wire, place in places.items())
    return (f"flatten {name}; cd {name}; {renamed}cd ..; " if places else "") + "".join(
        f"expose {name}/w:{register}; " for register in inputs(checker) if register in checker.inner(checker.config)
    )


def cutting(checker: Checker[Any]) -> str:
    """Return the Yosys command that makes the outputs of given modules free."""
    return "".join(f"delete {module}/c:* {module}/p:*; " for module in checker.cut)
