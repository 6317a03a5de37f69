"""Arithmetic of potentials, as in ``model/classifier/network.py``."""

from __future__ import annotations

from amaranth.hdl import Cat, Module, Mux, Signal, Value, signed

from eskin.model.classifier.config import Leak, NeuronReset


def add(m: Module, left: Value, right: Value, bits: int, saturates: bool) -> Value:
    """Return a signed sum that saturates at a bit width."""
    exact = Signal(signed(max(len(left), len(right)) + 1), name="exact")
    m.d.comb += exact.eq(left + right)
    if not saturates or len(exact) <= bits:
        return exact[:bits].as_signed()
    above = exact[bits - 1 :]
    fits = above.all() | ~above.any()
    end = Cat((~exact[-1]).replicate(bits - 1), exact[-1])
    return Mux(fits, exact[:bits], end).as_signed()


def fire(
    m: Module, v: Value, threshold: int, floor: int | None, reset: NeuronReset, leaks: Leak
) -> tuple[Value, Value, Value]:
    """Return the clipped potential, its spike, and its value after reset and leak."""
    held = Signal(signed(len(v)), name="held")
    spike = Signal(name="spike")
    rest = Signal(signed(len(v)), name="rest")
    m.d.comb += [
        held.eq(v if floor is None else Mux(v < floor, floor, v)),
        spike.eq(held > threshold),
        rest.eq(Mux(spike, held - threshold if reset == "subtract" else 0, held)),
    ]
    return held, spike, leak(m, rest, leaks)


def leak(m: Module, v: Value, leaks: Leak) -> Value:
    """Return v after a leak, with the bit width of v; a shift of 0 means no leak."""
    if not leaks.shift:
        return v
    lost = v
    if leaks.factor > 1:
        exact = v * leaks.factor
        lost = Signal(exact.shape(), name="leak_product")
        m.d.comb += lost.eq(exact)
    return (v - (lost >> leaks.shift))[: len(v)].as_signed()
