"""Receptive fields: sums of samples at the inputs of the encoders."""

from collections import Counter
from collections.abc import Collection
from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value, signed
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import SETTABLE, Field, fields_of, kind
from eskin.rtl.block import Block


class Fields(Block[ReadoutConfig]):
    """Combinational adders of the samples of every receptive field.

    Sums of the same taxels are one adder. A sorted list is halved, so that the sum of left and upper neighbour is also
    that of the right and lower neighbour of the taxel between them: four neighbours take two adders a taxel.

    Attributes
    ----------
    sample, signal : In(rows * columns * W), Out(rows * columns * W)
        Codes of the sensors, and of the fields; 0 for a taxel that is off.
    choice : In(2 * rows * columns)
        Number of each taxel's field in ``model.encoders.fields.CHOICES`` (``receptive_fields="settable"``).
    """

    module_name = "eskin_fields"

    def __init__(self, config: ReadoutConfig) -> None:
        bits = config.taxels * config.sample_bits
        choice = In(2 * config.taxels) if config.receptive_fields == SETTABLE else None
        super().__init__(config, {"sample": In(bits), "choice": choice, "signal": Out(bits)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        self._sums: dict[tuple[int, ...], Value] = {}
        bits = self.config.sample_bits
        for taxel, field in enumerate(fields_of(self.config)):
            name = f"field_{taxel}"
            settable = self.config.receptive_fields == SETTABLE
            signal = self._chosen(m, taxel, name) if settable else self._of(m, field, name)
            m.d.comb += self.signal.word_select(taxel, bits).eq(signal)
        return m

    def _of(self, m: Module, field: Field, name: str) -> Value:
        """Return the signal of a receptive field."""
        if not field.taxels:
            return Const(0, self.config.sample_bits)
        bits = self.config.sample_bits
        exact = Signal(signed(bits + (len(field.taxels) - 1).bit_length()), name=f"{name}_sum")
        signal = Signal(signed(bits), name=name)
        m.d.comb += exact.eq(self._weighted(m, field))
        fits = len(field.taxels) <= 1 << field.shift
        m.d.comb += signal.eq(rounded(exact, field.shift) if fits else saturated(m, rounded(exact, field.shift), bits))
        return signal

    def _chosen(self, m: Module, taxel: int, name: str) -> Value:
        """Return the signal of the receptive field that a host chooses."""
        bits, (rows, columns) = self.config.sample_bits, (self.config.rows, self.config.columns)
        choice = self.choice[2 * taxel : 2 * taxel + 2]
        own, around = self._sum(m, (taxel,)), Signal(signed(bits + 2), name=f"{name}_around")
        m.d.comb += around.eq(self._weighted(m, kind("neighbours", rows, columns, taxel)))
        exact, signal = Signal(signed(bits + 3), name=f"{name}_sum"), Signal(signed(bits), name=name)
        # In the order of the numbers of CHOICES.
        one_of_two = Mux(choice[0], around << 1, own << 3), Mux(choice[0], 0, (own << 2) + around)
        m.d.comb += exact.eq(Mux(choice[1], one_of_two[1], one_of_two[0]))
        m.d.comb += signal.eq(rounded(exact, 3))
        return signal

    def _weighted(self, m: Module, field: Field) -> Value:
        """Return the sum of a field, whose taxels may count more than once."""
        weights = Counter(field.taxels)
        total: Any = 0
        for place in range(max(weights.values()).bit_length()):
            if listed := tuple(taxel for taxel in sorted(weights) if weights[taxel] >> place & 1):
                total = total + (self._sum(m, listed) << place)
        return Value.cast(total)

    def _sum(self, m: Module, taxels: tuple[int, ...]) -> Value:
        """Return the sum of the samples of the given taxels."""
        bits = self.config.sample_bits
        if len(taxels) == 1:
            return self.sample.word_select(taxels[0], bits).as_signed()
        if taxels not in self._sums:
            half = len(taxels) // 2
            found = Signal(signed(bits + (len(taxels) - 1).bit_length()), name=f"sum_{_listed(taxels)}")
            m.d.comb += found.eq((self._sum(m, taxels[:half]) + self._sum(m, taxels[half:]))[: len(found)])
            self._sums[taxels] = found
        return self._sums[taxels]


def rounded(value: Value, shift: int) -> Value:
    """Return a signed value divided by 2**shift, rounded half to even."""
    if not shift:
        return value
    up = value[shift - 1] & (value[: shift - 1].any() | value[shift])
    return (value >> shift) + up


def saturated(m: Module, value: Value, bits: int) -> Value:
    """Return a signed value saturated to a bit width."""
    exact = Signal(signed(max(len(value), bits + 1)))
    m.d.comb += exact.eq(value)
    fits = ~exact[bits - 1 :].any() | exact[bits - 1 :].all()
    return Mux(fits, exact[:bits], Cat((~exact[-1]).replicate(bits - 1), exact[-1]))


def _listed(taxels: Collection[int]) -> str:
    """Return a signal name for a list of taxels."""
    return "_".join(map(str, taxels)) if len(taxels) <= 8 else f"of_{len(taxels)}_from_{min(taxels)}"
