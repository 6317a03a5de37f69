"""Example cells as transistors in SPICE."""

import itertools


def pull(kind: str, *transistors: str) -> list[str]:
    """Return transistors of one channel type, each as DRAIN GATE SOURCE."""
    bulk = "vss" if kind == "n" else "vdd"
    return [f"{line} {bulk} sky130_fd_pr__{kind}fet_01v8__model l=1.5e-07 w=8.4e-07" for line in transistors]


def inverter(source: str, output: str) -> list[str]:
    return [*pull("n", f"{output} {source} vss"), *pull("p", f"{output} {source} vdd")]


def switch(one: str, other: str, high: str, low: str) -> list[str]:
    """Return a transmission gate that conducts while a net is high and its inverse low."""
    return [*pull("n", f"{one} {high} {other}"), *pull("p", f"{one} {low} {other}")]


def latch(source: str, output: str, high: str, low: str) -> list[str]:
    """Return an inverting latch that is open while ``high`` is high."""
    inner, back = f"{output}_in", f"{output}_back"
    return [
        *switch(source, inner, high, low),
        *inverter(inner, output),
        *inverter(output, back),
        *switch(back, inner, low, high),
    ]


def cell(name: str, pins: str, *lines: list[str]) -> str:
    """Return a cell as SPICE text."""
    body = [f"M{number} {line}" for number, line in enumerate(itertools.chain(*lines))]
    return "\n".join([f".subckt {name} vdd vss {pins}", *body, f".ends {name}\n"])


CLOCKS = [*inverter("clk", "low"), *inverter("low", "high")]
XOR = [
    *inverter("i0", "n0"),
    *inverter("i1", "n1"),
    *pull("n", "a i0 vss", "q i1 a", "b n0 vss", "q n1 b"),
    *pull("p", "c i0 vdd", "c i1 vdd", "q n0 c", "q n1 c"),
]


def nand(*inputs: str) -> list[str]:
    nets = ["nq", *(f"s{number}" for number in range(1, len(inputs))), "vss"]
    ends = [f"{upper} {gate} {lower}" for upper, gate, lower in zip(nets, inputs, nets[1:], strict=False)]
    return [*pull("n", *ends), *pull("p", *(f"nq {gate} vdd" for gate in inputs))]


FLOP = [*CLOCKS, *latch("i", "m", "low", "high"), *latch("m", "q", "high", "low")]
FALLING = [*CLOCKS, *latch("i", "m", "high", "low"), *latch("m", "q", "low", "high")]
INVERTING = [*CLOCKS, *inverter("i", "n"), *latch("n", "m", "low", "high"), *latch("m", "q", "high", "low")]
OPEN = [*CLOCKS, *latch("i", "m", "high", "low"), *inverter("m", "q")]

LIBRARY = "".join(
    [
        cell("inv_x0", "i nq", inverter("i", "nq")),
        cell("buf_x2", "i q", inverter("i", "n"), inverter("n", "q")),
        cell("nand2_x0", "nq i0 i1", nand("i0", "i1")),
        cell("nand3_x0", "nq i0 i1 i2", nand("i0", "i1", "i2")),
        cell("nor2_x0", "nq i0 i1", pull("n", "nq i0 vss", "nq i1 vss"), pull("p", "s i0 vdd", "nq i1 s")),
        cell("xor2_x0", "i0 i1 q", XOR),
        cell("dff_x1", "i clk q", FLOP),
        cell("fill_w2", ""),
    ]
)
"""Enough for a readout."""

XOR_BY_ANOTHER_NAME = cell("nexor2_x0", "i0 i1 q", XOR)
"""As the generator makes it."""
