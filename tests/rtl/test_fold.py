"""Test that the delivered Verilog is readable, and that rewriting keeps the values."""

import re

import pytest

from eskin.model.cases import axes, singles, values_of
from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys
from eskin.rtl.text.expression import Node
from eskin.rtl.text.fold import LONGEST, _bits_of, fold
from eskin.rtl.verilog import Config, top_block, verilog
from eskin.verify.proofs.delivered import prove

READOUTS = singles(ReadoutConfig(rows=8, columns=8), **axes("encoding", "frontend", "link", "reset", "decide_every"))

STEPS = """\
module steps(clk, a, b, c, s, t, sum, wide, low, least, all_of, chosen, kept);
  input wire clk;
  input wire [3:0] a;
  input wire [3:0] b;
  input wire [7:0] c;
  input wire signed [3:0] s;
  input wire signed [7:0] t;
  output wire [7:0] sum;
  output wire [7:0] wide;
  output wire [7:0] low;
  output wire least;
  output wire all_of;
  output wire [7:0] chosen;
  output reg kept;
  wire [3:0] _0_;
  wire [3:0] _1_;
  wire [3:0] _2_;
  wire [1:0] _3_;
  wire _4_;
  wire [4:0] _5_;
  wire [3:0] _6_;
  wire [7:0] _7_;
  assign _0_ = a + b;
  assign sum = _0_ + c;
  assign _1_ = ~ a;
  assign wide = _1_ | c;
  assign _2_ = $signed(s) + $signed(t);
  assign low = c & { 4'h0, _2_ };
  assign _3_ = a[0] ? 2'h1 : 2'h2;
  assign least = $signed(t) < $signed(_3_);
  assign _4_ = | { a[0], b[1], c[7] };
  assign all_of = & { _4_, clk };
  assign _5_ = a & b;
  assign _6_ = $signed(s) >>> 1'h1;
  assign _7_ = clk ? _5_ : _6_;
  assign chosen = _7_;
  always @(posedge clk)
    if (_4_) kept <= ! c;
endmodule
"""


def test_no_step_changes_its_value_where_it_is_folded() -> None:
    folded = fold(STEPS)
    rtlil = yosys.run("read_verilog steps.v; proc; write_rtlil steps.il", "", "steps.il", {"steps.v": STEPS.encode()})
    assert prove(rtlil, folded)["steps"] >= 5
    assert "assign all_of = clk & (c[7] | b[1] | a[0]);" in folded
    assert "if (c[7] | b[1] | a[0]) kept <= ~|c;" in folded
    # Not where its width or sign would change: a sum of four bits, an inverted word, a signed sum that is cut.
    parts = re.findall(r"^  wire .*?(\w+_part(?:_2)?);", folded, re.MULTILINE)
    assert sorted(parts) == ["chosen_part", "chosen_part_2", "low_part", "sum_part", "wide_part"]


def made_up(config: Config) -> list[str]:
    """Return the wires with generated names."""
    names = re.findall(r"^  (?:wire|reg) (?:signed )?(?:\[\d+:0\] )?(\w+);", verilog(config), re.MULTILINE)
    assert len(names) > 50
    return [name for name in names if re.search(r"_part(_\d+)?$|(?<!_to)_\d+$", name)]


@pytest.mark.parametrize("config", READOUTS, ids=lambda config: "-".join(values_of(config).values()))
def test_names_are_those_of_the_source(config: ReadoutConfig) -> None:
    assert made_up(config) == []


def test_lines_are_no_longer_than_a_page() -> None:
    text = verilog(ReadoutConfig(rows=12, columns=16))
    assert max(len(line) for line in text.splitlines() if not line.startswith("//")) < LONGEST + 30
    assert top_block(ReadoutConfig()).module_name in text


LATE = """\
module late(a, y);
  input wire [1:0] a;
  output wire [3:0] y;
  wire [3:0] both;
  assign both[3:2] = high;
  wire [1:0] high;
  assign high = ~ a;
  assign both[1:0] = a;
  assign y = both;
endmodule
"""


def test_a_wire_is_declared_before_its_first_use() -> None:
    lines = fold(LATE).splitlines()
    (declared,) = (number for number, line in enumerate(lines) if line == "  wire [1:0] high;")
    uses = [number for number, line in enumerate(lines) if "high" in line and number != declared]
    assert uses
    assert declared < min(uses)
    ports = ["module late(", "  input wire [1:0] a,", "  output wire [3:0] y", ");"]
    rest = [line.replace("~ a", "~a") for line in LATE.splitlines()[3:]]
    assert lines[:4] == ports
    assert sorted(lines[4:]) == sorted(rest)


def test_a_constant_has_as_many_bits_as_it_says() -> None:
    number = Node("number", "5'h1a")
    bits = [("", bit) for bit in (0, 1, 0, 1, 1)]
    assert _bits_of(number, {}) == bits
    joined = Node("join", "", (number, Node("slice", "x", (), 3, 2)))
    assert _bits_of(joined, {}) == [("x", 2), ("x", 3), *bits]
