"""Combinational networks of logarithmic depth and linear area."""

from collections.abc import Sequence

from amaranth.hdl import Cat, Const, Module, Signal, Value, ValueLike


def or_tree(values: Sequence[ValueLike]) -> Value:
    """Return the bitwise OR of values as a balanced tree, ceil(log2(len)) gates deep."""
    level = [Value.cast(value) for value in values]
    while len(level) > 1:
        level = [level[i] | level[i + 1] if i + 1 < len(level) else level[i] for i in range(0, len(level), 2)]
    return level[0] if level else Const(0)


def exclusive_prefix_or(bits: Sequence[ValueLike], m: Module | None = None, name: str = "") -> list[Value]:
    """Return for every bit the OR of all lower bits, computed by a Brent-Kung network.

    Depth 2 log2(len), 2 len gates. The single bits that are set where the result is not are the first set ones;
    behind the first set bit the result is a thermometer code. In a given module the ORs of pairs, fours, eights ... of
    bits become signals such as ``<name>_4_to_7``, for the reader of the Verilog.
    """
    values = [Value.cast(bit) for bit in bits]
    return _prefix_or(values, m, name, 2)


def _prefix_or(values: list[Value], m: Module | None, name: str, size: int) -> list[Value]:
    if len(values) <= 1:
        return [Const(0, 1)] * len(values)
    pairs = [values[i] | values[i + 1] if i + 1 < len(values) else values[i] for i in range(0, len(values), 2)]
    if m is not None and len(pairs) > 4:  # otherwise each pair is used once, or is a bit of the result
        for i in range(1, len(values) // 2):
            group = Signal(name=f"{name}_{i * size}_to_{(i + 1) * size - 1}")
            m.d.comb += group.eq(pairs[i])
            pairs[i] = group
    below = _prefix_or(pairs, m, name, 2 * size)
    return [below[i // 2] | values[i - 1] if i % 2 else below[i // 2] for i in range(len(values))]


def encode(one_hot: Sequence[ValueLike]) -> Value:
    """Return the index of the only set bit; 0 if no bit is set."""
    width = (len(one_hot) - 1).bit_length()
    return Cat(or_tree([bit for i, bit in enumerate(one_hot) if i >> b & 1]) for b in range(width))
