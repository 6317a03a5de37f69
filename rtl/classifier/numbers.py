"""Arithmetic of potentials, as in ``model/classifier/network.py``."""

from amaranth.hdl import Cat, Module, Mux, Signal, Value, signed

from eskin.model.classifier.config import Leak, NeuronReset, bits_of, highest, lowest


def add(m: Module, left: Value, right: Value, bits: int, saturates: bool) -> Value:
    """Return a signed sum that saturates at a bit width."""
    wide = max(len(left), len(right))
    fits = wide < bits
    exact = Signal(signed(wide if wide == bits else wide + 1), name="exact")
    m.d.comb += exact.eq(left + right)
    if fits or not saturates:
        return exact[:bits].as_signed()
    if wide > bits:
        above = exact[bits - 1 :]
        over, negative = ~above.all() & above.any(), exact[-1]
    else:
        over, negative = (left[-1] == right[-1]) & (left[-1] != exact[-1]), left[-1]
    return Mux(over, Cat((~negative).replicate(bits - 1), negative), exact[:bits]).as_signed()


def fire(
    m: Module, v: Value, threshold: int | Value, floor: int | None, reset: NeuronReset, leaks: Leak | Value
) -> tuple[Value, Value, Value]:
    """Return the clipped potential, its spike, and its value after reset and leak.

    Threshold and leak are constants, or a positive number and a shift of the neuron.

    The floor is below the threshold, so both comparisons use ``v``. After a reset to zero the potential is between
    floor and threshold and may need fewer bits than ``v``. A potential of 0 does not fire and stays 0.
    """
    held = Signal(signed(len(v)), name="held")
    spike = Signal(name="spike")
    low, high = lowest(len(v)) if floor is None else floor, highest(len(v))
    if reset == "zero" and isinstance(threshold, int):
        high = threshold
    if reset == "delayed":
        m.d.comb += [held.eq(v if floor is None else Mux(v < floor, floor, v)), spike.eq(v > threshold)]
        return held, spike, (leak(m, held, leaks) - Mux(spike, threshold, 0))[: len(v)].as_signed()
    rest = Signal(signed(int(bits_of((low, high)))), name="rest")
    m.d.comb += [
        held.eq(v if floor is None else Mux(v < floor, floor, v)),
        # > would need an inverter for each bit of v
        spike.eq(v >= threshold + 1 if isinstance(threshold, int) else v > threshold),
        rest.eq(Mux(spike, held - threshold if reset == "subtract" else 0, held)),
    ]
    return held, spike, leak(m, rest, leaks)


def leak(m: Module, v: Value, leaks: Leak | Value) -> Value:
    """Return v after a leak, with the bit width of v; a shift of 0 means no leak."""
    if isinstance(leaks, Value):
        shifted = Signal(signed(len(v)), name="leak_shifted")
        m.d.comb += shifted.eq(Mux(leaks.any(), v >> leaks, 0))
        return (v - shifted)[: len(v)].as_signed()
    if not leaks.shift:
        return v
    lost = v
    if leaks.factor > 1:
        exact = v * leaks.factor
        lost = Signal(exact.shape(), name="leak_product")
        m.d.comb += lost.eq(exact)
    return (v - (lost >> leaks.shift))[: len(v)].as_signed()
