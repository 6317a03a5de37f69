"""Base class of checkers, which observe a block and report violated properties in every clock.

A checker is a block of its own. A solver proves that its outputs never fall (``eskin.verify.proofs.bench``), and its
Verilog is bound to the delivered text (``eskin.verify.proofs.bind``). Both watch the same ports and registers.
"""

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, TypeVar

from amaranth.hdl import Array, Cat, Const, Module, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from eskin.rtl.block import Block

Config = TypeVar("Config")

SENTENCES: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("properties.toml").read_text())
"""Names and sentences of the properties, by checker."""


Promises = Iterator[tuple[str, Any, Any]]
"""Names of properties, each with an expression that it holds in this clock, and one that its case happens."""


class Checker(Block[Config]):
    """Checker of one block.

    ``ok_NAME``: the property holds in this clock. ``seen_NAME``: its case happens in this clock, so that it is not
    vacuous. ``holds_NAME``: an assumption about what is around the block holds in this clock. A bench guarantees it
    (``drive``), or the properties that need it hold as long as it held (they say so); simulation checks it where the
    block is at work.
    """

    block: ClassVar[type[Any]]
    properties: ClassVar[Mapping[str, str]] = {}
    """Names of the properties, in snake case, each with its sentence: those of ``properties.toml``."""
    only: ClassVar[Mapping[str, Callable[[Any], Any]]] = MappingProxyType({})
    """For some properties, whether a configuration has them; it has all others."""
    assumptions: ClassVar[Mapping[str, str]] = MappingProxyType({})
    cut: ClassVar[tuple[str, ...]] = ()
    """Modules in the block with free outputs in every clock."""
    together: ClassVar[bool] = False
    """Whether the properties are proved as one property, because each property needs the others."""

    def __init_subclass__(cls, **own: Any) -> None:
        super().__init_subclass__(**own)
        cls.properties = SENTENCES.get(cls.__name__, cls.properties)

    def __init__(self, config: Config) -> None:
        self.module_name = f"{self.block.module_name}_properties"
        self.proved = [name for name in self.properties if name not in self.only or self.only[name](config)]
        outputs = [f"{kind}_{name}" for name in self.proved for kind in ("ok", "seen")]
        outputs += [f"holds_{name}" for name in self.assumptions]
        super().__init__(config, {**self.observed(config), **{name: Out(1) for name in outputs}})

    def observed(self, config: Config) -> dict[str, Any]:
        """Return the checker's inputs: ports of the block, registers by name (``inner``), and ``constants``."""
        ports = {name: In(member.shape) for name, member in self.block(config).signature.members.items()}
        constants = {name: In(max(1, (count - 1).bit_length())) for name, count in self.constants(config).items()}
        return ports | self.inner(config) | constants

    def constants(self, config: Config) -> dict[str, int]:
        """Return the inputs with any value that stays constant, each with the number of its values."""
        return {}

    def inner(self, config: Config) -> dict[str, Any]:
        """Return the registers of the block that the checker observes."""
        return {}

    def places(self, config: Config) -> dict[str, str]:
        """Return the hierarchical names of checker inputs that are inside submodules."""
        return {}

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive constrained inputs of the block; return their names, all others are free."""
        return set()

    def check(self, m: Module) -> Promises:
        """Yield every property that the configuration has, and define the assumptions; other properties are ignored."""
        raise NotImplementedError

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        self._left = {*self.proved, *self.assumptions}
        for name, ok, seen in self.check(m):
            if name in self.proved:
                m.d.comb += [getattr(self, f"ok_{name}").eq(ok), getattr(self, f"seen_{name}").eq(seen)]
                self._left.discard(name)
        if self._left:
            raise AssertionError(f"{type(self).__name__} does not define {', '.join(sorted(self._left))}")
        return m

    def suppose(self, m: Module, name: str, holds: Any) -> None:
        """Define when an assumption holds."""
        m.d.comb += getattr(self, f"holds_{name}").eq(holds)
        self._left.discard(name)

    @staticmethod
    def keep(m: Module, value: Signal, clears: Any, when: Any, new: Any, start: Any = 0) -> Signal:
        """Set a register to ``start`` if ``clears`` is true, else to ``new`` if ``when`` is true."""
        with m.If(clears):
            m.d.sync += value.eq(start)
        with m.Elif(when):
            m.d.sync += value.eq(new)
        return value

    def count_to(self, m: Module, most: int, clears: Any, counts: Any, start: Any = 0, name: str = "count") -> Signal:
        """Return a number of clocks with ``counts``, up to ``most``; ``clears`` has priority and sets ``start``."""
        number = Signal(range(most + 1), name=name)
        return self.keep(m, number, clears, counts & (number != most), number + 1, start)

    @staticmethod
    def unchanged(m: Module, valid: Any, ready: Any, payload: Value) -> tuple[Value, Signal]:
        """Return whether a waiting offer is unchanged, and whether an offer waits."""
        waits = before(m, valid & ~ready, "waits")
        same = payload == before(m, payload, "payload") if len(payload) else Const(1)
        return implies(waits, valid & same), waits

    def fair(self, m: Module, given: Any, asks: Any, other: Any) -> tuple[Any, Any]:
        """Return whether none is served twice while another waits, and whether the other is served when due."""
        due, waits = Signal(name="owed"), asks & ~other
        self.keep(m, due, given, due, waits, start=waits)
        return ~(due & given & asks & ~other), due & other

    def port(self, name: str) -> Any:
        """Return an input or output of the checker, 0 if the configuration lacks it."""
        return getattr(self, name) if self.has(name) else Const(0)

    def has(self, name: str) -> bool:
        """Return True if the checker has an input or output of that name."""
        return name in self.signature.members


def before(m: Module, value: Any, name: str) -> Signal:
    """Return the value of one clock before; 0 in the first clock."""
    value = Value.cast(value)
    old = Signal(value.shape(), name=f"{name}_before")
    m.d.sync += old.eq(value)
    return old


def at_most_one(bits: Value) -> Value:
    """Return an expression that is true if at most one bit is set."""
    return (bits & (bits - 1)[: len(bits)]) == 0


def within(bits: Value, others: Value) -> Value:
    """Return an expression that is true if ``others`` contains every set bit."""
    return (bits & ~others) == 0


def implies(condition: Any, then: Any) -> Value:
    """Return the implication ``condition`` -> ``then``; both are one bit."""
    return ~Value.cast(condition).bool() | Value.cast(then).bool()


def pick(values: Any, index: Signal) -> Any:
    """Return the value at an index, or the bit of a word; 0 beyond the last."""
    nothing = Const(0, len(Value.cast(values[0])))
    return Array([*values, *[nothing] * ((1 << len(index)) - len(values))])[index]


def cyclic(m: Module, asks: Any, taken: Any) -> tuple[Signal, Any]:
    """Return the last chosen index, and whether the current choice violates round-robin order.

    Of the bits ``taken`` at most one is high.
    """
    number = len(taken)
    last = Signal(number, init=1 << (number - 1))
    with m.If(taken.any()):
        m.d.sync += last.eq(taken)
    jumps: Any = Const(0)
    for start in range(number):
        for way in range(1, number + 1):
            between = Cat(asks[(start + step) % number] for step in range(1, way))
            jumps |= last[start] & taken[(start + way) % number] & between.any()
    return last, jumps


def inputs(checker: Checker[Any]) -> Iterable[str]:
    """Return the names of a checker's inputs."""
    return [name for name, member in checker.signature.members.items() if member.flow is wiring.In]
