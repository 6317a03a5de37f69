"""LCS: a reference on a grid of D, with two comparators."""

from collections.abc import Callable
from typing import Any

from amaranth.hdl import Module, Mux, Signal, signed

from eskin.rtl.encoders.encoder import Shared, Taxel, compare


def build(
    m: Module, taxel: Taxel, shared: Shared, platform: Any, width: Callable[..., Any] | None = None
) -> tuple[Any, Any]:
    """Add the reference and the comparators; ``width`` adds a window, and returns its half-width."""
    config = taxel.config
    shape = signed(config.sample_bits - (config.grid - 1).bit_length())
    reference = Signal(shape, init=config.reference_reset // config.grid)
    half_width = 1 if config.registers == "none" else taxel.step
    if width is not None:
        half_width = width(m, taxel, shared, platform)
    fall = Signal(signed(half_width.bit_length() + 1 if isinstance(half_width, int) else len(half_width) + 1))
    m.d.comb += fall.eq(-half_width)
    above, below = compare(m, taxel, shared, reference, half_width)

    moved = Signal(signed(len(reference) + (config.frontend == "analog")))
    if config.frontend == "digital":
        turns: Any = shared.moves
        step = Mux(shared.on, half_width, Mux(shared.off, fall, 0))
    else:
        # A step that would leave the scale is not made. If both comparators fire, the taxel steps up.
        turns = shared.moves & (shared.wants_event | ~taxel.enable)
        step = Mux(taxel.above, half_width, fall)
        fits = Signal()
        m.d.comb += fits.eq(moved[-1] == moved[-2])
        above, below = above & fits, below & fits
    m.d.comb += moved.eq((reference + step)[: len(moved)])
    with m.If(turns):
        m.d.sync += reference.eq(Mux(taxel.enable, moved[: len(reference)], reference.init))
    return above, below
