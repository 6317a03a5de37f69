"""Bipolar N-LCS: a signed reference that leaks to zero, and two comparators."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, signed

from eskin.rtl.encoders.encoder import Shared, Taxel, compare


def build(m: Module, taxel: Taxel, shared: Shared, platform: Any) -> tuple[Any, Any]:
    """Add the reference, and comparators with the reference rounded down to a code."""
    config = taxel.config
    fraction, shift, low = config.fraction_bits, config.leak_shift, (config.step - 1).bit_length()
    charge = Signal(signed(config.sample_bits + fraction), init=config.reference_reset << fraction)
    reference = Signal(signed(config.sample_bits))
    m.d.comb += reference.eq(charge[fraction:])
    half_width: Any = config.step
    # (u + 2**(k-1)) >> k without the adder: rounding up adds the highest bit that is shifted out.
    share = Signal(signed(len(charge)))
    rounded: Any = (charge >> shift) + charge[min(shift, len(charge)) - 1]
    if config.registers != "none":
        half_width = taxel.step << low
        shifted = Cat(Const(0, 1), charge).as_signed() >> taxel.leak_shift
        rounded = (shifted >> 1) + shifted[0]
    fall = Signal(signed(config.sample_bits))
    m.d.comb += [share.eq(rounded), fall.eq(-half_width)]
    above, below = compare(m, taxel, shared, reference, half_width)
    analog = config.frontend == "analog"
    moved = Signal(signed(config.sample_bits + analog))
    stepped: Any = moved
    step = Mux(shared.on, half_width, Mux(shared.off, fall, 0))
    if analog:
        # A step that would leave the scale is not made. If both comparators fire, the taxel steps up.
        step = Mux(taxel.above, half_width, fall)
        fits = Signal()
        m.d.comb += fits.eq(moved[-1] == moved[-2])
        above, below = above & fits, below & fits & ~taxel.above
        stepped = Mux(shared.on | shared.off, moved[:-1], reference)
    m.d.comb += moved.eq((reference + step)[: len(moved)])
    # A step towards zero replaces the leak.
    leaks = Signal()
    m.d.comb += leaks.eq(taxel.decay & ~Mux(charge[-1], shared.on, shared.off))
    after = Signal.like(charge)
    m.d.comb += after.eq((Cat(charge[:fraction], stepped).as_signed() - Mux(leaks, share, 0))[: len(charge)])
    with m.If(shared.moves):
        m.d.sync += charge.eq(Mux(taxel.enable, after, charge.init))
    return above, below
