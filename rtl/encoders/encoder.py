"""Interface of an encoder in hardware: reference, and digital comparators or ports for analog ones."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from amaranth.hdl import Const, Module, Mux, Signal, signed

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block

Taxel = Block[ReadoutConfig]
"""The block with the encoder in it, whose class imports the encoders."""


@dataclass(frozen=True)
class Shared:
    """Signals shared by a taxel and its encoder.

    Attributes
    ----------
    pending : Signal
        Register: a request waits.
    enabled : Signal
        Register: the mask of the clock before, so that a masked taxel is reset once and then stands still; where the
        taxel ``sleeps``, it also has taken a sample since.
    on, off : Signal
        A free taxel steps up, or down, in this clock; where both are high, up.
    wants_event : Signal
        An enabled taxel, if it is free, raises a request in this clock.
    moves : Signal
        Enable of request, polarity and reference.
    closing : Signal
        The window may close in this clock.
    narrows : Signal
        The window closes by a step at the end of this clock, unless the taxel steps (analog front end).
    """

    pending: Signal
    enabled: Signal
    on: Signal
    off: Signal
    wants_event: Signal = field(metadata={"wire": "asks"})  # the Verilog has this name
    moves: Signal
    closing: Signal
    narrows: Signal


Build = Callable[[Module, Taxel, Shared, Any], tuple[Any, Any]]
"""Function that adds reference, state and comparators to a taxel, and returns the step-up and step-down signals.

The last argument is the platform. The reference moves where ``shared.moves`` is high: up where ``shared.on`` is, else
down where ``shared.off`` is, and to its reset value where the taxel is masked. A step that would leave the scale
is not due.
"""


def compare(m: Module, taxel: Taxel, shared: Shared, reference: Any, half_width: Any) -> tuple[Any, Any]:
    """Add digital comparators, or ports for analog ones; return whether x is above and below the window.

    Reference and half-width are in units of the encoder's grid. Flops drive the DACs.
    """
    config = taxel.config
    low_bits = (config.grid - 1).bit_length()
    if config.frontend == "analog":
        m.d.comb += taxel.reference_code.eq(reference << low_bits)
        if config.closes:
            m.d.comb += taxel.half_width.eq(half_width << low_bits)
        return taxel.above, taxel.below if config.has_polarity else Const(0)

    sample = Signal(signed(config.sample_bits - low_bits), name="newest")
    newest: Any = taxel.sample[low_bits:].as_signed()
    if not config.has_polarity:  # a sample below zero counts as zero and causes no request
        sample = Signal(config.sample_bits - 1, name="newest")
        newest = Mux(taxel.sample[-1], 0, taxel.sample[:-1])
    takes = taxel.enable & taxel.sample_valid
    if not taxel.sleeps:
        takes |= ~taxel.enable & shared.enabled
        newest = Mux(taxel.enable, newest, 0)
    with m.If(takes):
        m.d.sync += sample.eq(newest)
    difference = Signal(signed(len(sample) + 1))
    m.d.comb += difference.eq(sample - reference)
    above = Signal()
    over = difference > half_width if config.encoder.strict else difference >= half_width
    if not config.has_polarity:
        m.d.comb += above.eq(over)
        return above, Const(0)
    below = Signal()
    m.d.comb += [above.eq(over), below.eq(difference < -half_width)]
    return above, below
