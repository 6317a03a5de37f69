"""Test that arbiter depth grows with the logarithm of the array size, and area linearly."""

import itertools
import re

import pytest
from amaranth.hdl import Module, Signal
from amaranth.sim import Simulator
from hypothesis import given, settings
from hypothesis import strategies as st

from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys
from eskin.rtl.arbiter import Arbiter
from eskin.rtl.block import RtlilModules
from eskin.rtl.logic import encode, exclusive_prefix_or, or_tree


def gates(rows: int, columns: int) -> tuple[int, int]:
    """Return depth and number of two-input gates of an arbiter, before optimisation by synthesis."""
    rtlil = RtlilModules(async_reset=False).add(Arbiter(ReadoutConfig(rows=rows, columns=columns)))
    script = (
        "read_rtlil readout.il; hierarchy -top eskin_arbiter; proc; opt_expr; opt_merge; opt_clean; simplemap; "
        "opt_expr; opt_merge; opt_clean; tee -o said ltp -noff; tee -a said stat"
    )
    text = yosys.run(script, rtlil, "said")
    depth = re.search(r"Longest topological path in eskin_arbiter \(length=(\d+)\)", text)
    assert depth is not None
    count = sum(int(n) for n in re.findall(r"^ +(\d+) .*\$_(?:AND|OR|NOT|MUX|XOR)_$", text, re.MULTILINE))
    return int(depth[1]), count


def test_depth_is_logarithmic_and_area_linear() -> None:
    measured = {side: gates(side, side) for side in (4, 8, 16, 32, 64)}
    depths = [depth for depth, _ in measured.values()]
    steps = [later - earlier for earlier, later in itertools.pairwise(depths)]
    # Per doubling of both sides: two levels of a prefix network, and one or two of trees on the way.
    assert max(steps) <= 4, depths
    per_taxel = [count / side**2 for side, (_, count) in measured.items()]
    assert per_taxel == sorted(per_taxel, reverse=True), per_taxel
    assert per_taxel[-1] < 3, per_taxel


@pytest.mark.representative(block="logic")
@pytest.mark.parametrize("width", [1, 2, 3, 5, 8, 64])
@settings(max_examples=2)  # each makes the network anew, which takes seconds
@given(data=st.data())
def test_networks_compute_what_they_say(width: int, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(0, 2**width - 1), min_size=20, max_size=40))
    bits, prefix, index, merged = Signal(width), Signal(width), Signal(8), Signal()
    m = Module()
    below = exclusive_prefix_or(bits)
    for i in range(width):
        m.d.comb += prefix[i].eq(below[i])
    m.d.comb += [
        merged.eq(or_tree(list(bits))),
        # Of the prefix as a signal: the simulator would write out its whole network anew for every bit.
        index.eq(encode([bit & ~lower for bit, lower in zip(bits, prefix, strict=True)])),
    ]

    async def check(ctx) -> None:  # type: ignore[no-untyped-def]
        for value in values:
            ctx.set(bits, value)
            assert ctx.get(merged) == (value != 0)
            assert ctx.get(prefix) == sum(1 << i for i in range(width) if value & ((1 << i) - 1))
            assert ctx.get(index) == max((value & -value).bit_length() - 1, 0)

    simulator = Simulator(m)
    simulator.add_testbench(check)
    simulator.run()
