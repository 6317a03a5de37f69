"""N-LCS: a leaking reference with fraction bits, and one comparator."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal

from eskin.rtl.encoders.encoder import Shared, Taxel, compare


def build(m: Module, taxel: Taxel, shared: Shared, platform: Any) -> tuple[Any, Any]:
    """Add the reference and the comparator."""
    config = taxel.config
    fraction, shift = config.fraction_bits, config.leak_shift
    charge = Signal(config.sample_bits - 1 + fraction, init=config.reference_reset << fraction)
    reference = Signal(config.sample_bits - 1)
    m.d.comb += reference.eq(charge[fraction:])
    step: Any = config.step
    # (u + 2**(k-1)) >> k without the adder: rounding up adds the highest bit that is shifted out.
    rounded = charge[shift:] + charge[shift - 1 : shift]
    fits = ~reference[config.step.bit_length() - 1 :].all()
    if config.registers != "none":
        step = taxel.step << (config.step - 1).bit_length()
        shifted = Cat(Const(0, 1), charge) >> taxel.leak_shift
        rounded = shifted[1:] + shifted[:1]
        fits = ~(reference | (step - 1)[: len(reference)]).all()
    rise = Mux(shared.on, step << fraction, 0)
    share = Signal(len(rounded))
    m.d.comb += share.eq(rounded)
    leak = Mux(taxel.decay, share, 0)
    with m.If(shared.moves):
        m.d.sync += charge.eq(Mux(taxel.enable, (charge + rise - leak)[: len(charge)], charge.init))
    above, below = compare(m, taxel, shared, reference, step)
    return above & fits, below
