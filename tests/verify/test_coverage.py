"""Test coverage: counts, functional points, waivers, and detection of gaps."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.runner import build_cache as store
from eskin.verify.coverage import plan, stimuli
from eskin.verify.coverage.constructs import Construct, modules, read, with_points
from eskin.verify.coverage.plan import Run, runs
from eskin.verify.coverage.points.designs import points
from eskin.verify.coverage.points.point import Point
from eskin.verify.coverage.run import Reached, closing_line, judge, play
from eskin.verify.coverage.waivers import Waiver, chosen, claim, guards, unproved, waivers

TEXT = """// a comment
module eskin_a(clk, rst, x, y);
  input wire clk;
  input wire rst;
  input wire [1:0] x;
  output reg y;
  wire [1:0] low;
  assign low = x & 2'h1;
  always @(posedge clk)
    if (rst) y <= 1'h0;
    else if (x[0] & low[1]) y <= 1'h1;
endmodule
"""


def counted(line: int, page: str, what: str, count: int, file: str = "eskin_readout.v") -> str:
    """Return a line of a file in Verilator's format."""
    fields = {"f": f"/somewhere/{file}", "l": str(line), "n": "9", "page": f"{page}/eskin_a", "o": what, "h": "top.*"}
    return f"C '{''.join(f'{chr(1)}{key}{chr(2)}{value}' for key, value in fields.items())}' {count}\n"


def construct(kind: str, what: str) -> Construct:
    """Return a construct of the text."""
    return Construct(kind, "eskin_a", modules(TEXT)[0].digest, 1, 1, what, "")


def test_counts_are_read_by_module_and_line_and_instances_are_one() -> None:
    counts = counted(11, "v_branch", "if", 0) + counted(7, "v_toggle", "low[0]:0->1", 3)
    counts += counted(7, "v_toggle", "low[0]:0->1", 4) + counted(3, "v_line", "block", 1, "harness.v")
    found = read("# SystemC::Coverage-3\n" + counts, TEXT, "eskin_readout.v")
    assert [(c.kind, c.module, c.line, c.what, count) for c, count in found.items()] == [
        ("branch", "eskin_a", 10, "if", 0),
        ("toggle", "eskin_a", 6, "low[0]:0->1", 7),
    ]
    assert next(iter(found)).source == "else if (x[0] & low[1]) y <= 1'h1;"


def test_points_leave_a_module_what_it_is() -> None:
    text = with_points(TEXT, [("eskin_a", "both", "x == 3")])
    assert "  point_both: cover property (@(posedge clk) x == 3);\nendmodule\n" in text
    assert [module.digest for module in modules(text)] == [module.digest for module in modules(TEXT)]
    with pytest.raises(ValueError, match="no module eskin_b"):
        with_points(TEXT, [("eskin_b", "both", "x == 3")])


def test_a_proof_tells_what_can_never_be_from_what_was_not_played() -> None:
    never = [construct("toggle", "low[1]:0->1"), construct("condition", "(x[0]==1 && low[1]==1) => 1")]
    sometimes = construct("toggle", "low[0]:0->1")
    claims = {one: claim(one, once=False) for one in [*never, sometimes]}
    assert unproved(TEXT, "eskin_a", claims) == [sometimes]
    assert unproved(TEXT, "eskin_a", {never[0]: claim(never[0], once=True)}) == [never[0]]
    assert claim(construct("condition", "((a & b)[3]==1) => 1"), False) == "((((a & b) >> 3) & 1'b1)==1)"


def test_a_module_within_is_part_of_the_proof_although_synthesis_keeps_it() -> None:
    inner = "module inner(input wire [1:0] x, output wire [1:0] z);\n  assign z = x;\nendmodule\n"
    inner = f'(* keep_hierarchy = "yes" *)\n{inner}'
    whole = inner + TEXT.replace(
        "assign low = x & 2'h1;", "wire [1:0] z;\n  inner i(.x(x & 2'h1), .z(z));\n  assign low = z;"
    )
    never = construct("toggle", "low[1]:0->1")
    assert unproved(whole, "eskin_a", {never: claim(never, once=False)}) == []


def test_what_is_executed_under_a_condition_counts_only_there() -> None:
    lines = [
        "  always @(posedge clk)",
        "    if (rst) y <= 1'h0;",
        "    else if (a | (b & c)) y <= (a ? b : c) ? d :",
        "        e;",
    ]
    assert guards(lines, 3, 40) == guards(lines, 4, 9) == ["!(rst)", "(a | (b & c))"]
    assert guards(lines, 3, 15) == ["!(rst)"]
    assert guards(["  assign y = a & b;"], 1, 14) == []
    choice = "  assign y = (a & b) ? c : d;"
    assert chosen(choice, choice.index("c :") + 1, other=False) == "(a & b)"
    assert chosen(choice, choice.index("c :") + 2, other=True) == "!((a & b))"
    assert chosen("  assign y = (x ? a : b) ? c : d;", 28, other=False) == "1'b1"


def reached_of(*found: tuple[Construct, int]) -> Reached:
    """Return the coverage of runs that cover the given constructs."""
    digest = modules(TEXT)[0].digest
    return Reached(Counter(dict(found)), {("eskin_a", digest): TEXT}, {("lcs", "held"): 1}, ["one"])


def test_what_is_not_reached_needs_a_reason() -> None:
    branch, bit = construct("branch", "if"), construct("toggle", "low[1]:0->1")
    reached = reached_of((branch, 0), (bit, 0), (construct("line", "block"), 5))
    verdict = judge(reached, [Waiver("toggle", "x has no second bit there", signal="low", proof=True)])
    assert verdict.problems == [f"not reached, and no reason given: {branch.said}"]
    assert closing_line(reached, verdict) == (
        "coverage: 1 of 1 lines, 0 of 1 branches, 1 of 1 toggles, 0 of 0 conditions (1 explained), 1 of 1 points"
    )
    reached.points["lcs", "wraps"] = 0
    assert judge(reached, [Waiver(("toggle", "branch"), "any")]).problems == ["not reached: lcs: wraps"]


def test_a_waiver_that_explains_nothing_is_refused() -> None:
    waiver, other = Waiver("branch", "why not"), Waiver("toggle", "none", signal="low")
    reached = reached_of((construct("branch", "if"), 0))
    assert judge(reached, [waiver, other]).problems == ["explains nothing: the waiver of toggle low: none"]
    assert judge(reached, [waiver, other], whole=False).problems == []


def test_a_reason_that_is_not_true_is_refused() -> None:
    bit = construct("toggle", "low[0]:0->1")
    verdict = judge(reached_of((bit, 0)), [Waiver("toggle", "never changes", proof=True)])
    assert verdict.problems == [f"reason not proved: {bit.said}"]


def test_every_waiver_gives_a_reason() -> None:
    assert all(len(waiver.reason) > 20 for waiver in waivers())


@pytest.mark.parametrize(
    ("kind", "what", "source", "fits", "others"),
    [
        ("toggle", "low[1]:1->0", "wire [3:0] low;", ["low", "low[1]", "low[3:0]", "l*w"], ["low[2]", "lower", "*x"]),
        ("condition", "(a[2]==1 && b==0) => 0", "assign x = a[2] & b;", ["a", "a[2]==1", "b==0"], ["a[2]==0", "x"]),
        ("branch", "cond_else", "assign x = a ? b : c;", ["x"], ["a", "b"]),
    ],
)
def test_a_waiver_names_a_construct(kind: str, what: str, source: str, fits: list[str], others: list[str]) -> None:
    one = Construct(kind, "eskin_a", "", 1, 1, what, source)
    operator = {"toggle": "1->0", "condition": "=> 0", "branch": "cond_else"}[kind]
    assert all(Waiver(kind, "why", ("eskin_b", "eskin_a"), name, operator).explains(one) for name in fits)
    assert not any(Waiver(kind, "why", signal=name).explains(one) for name in others)
    assert not Waiver(kind, "why", operator="0->1").explains(one)
    assert not Waiver("line", "why").explains(one)
    assert not Waiver(kind, "why", "eskin").explains(one)


def test_every_point_of_a_design_has_a_name_of_its_own() -> None:
    for run in runs():
        found = points(run.config)
        assert len(found) == len({point.label for point in found}) > 6, run.name
    assert len({run.name for run in runs()}) == len(runs()) > 40


TINY = plan.SMALL.replace(rows=2, columns=2, resolution=2)
DEAD = "  assign event_col"
PLANTED = """  reg dead;
  always @(posedge clk)
    if (rst) dead <= 1'h0;
    else if (event_valid & ~(|waiting)) dead <= 1'h1;
"""


def test_a_dead_line_and_a_stimulus_that_is_missing_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = store.verilog_text(TINY)
    assert text.count(DEAD) == 1
    monkeypatch.setattr("eskin.verify.coverage.run.verilog_text", lambda config: text.replace(DEAD, PLANTED + DEAD))
    monkeypatch.setattr(stimuli, "LONG", [])
    monkeypatch.setattr(stimuli, "SIGNALS", ("rare",))
    reached = play([Run("tiny", TINY, stimuli.readout)], tmp_path, lambda *_: None)
    problems = judge(reached, waivers(), whole=False).problems
    assert [problem for problem in problems if "dead" in problem and "no reason given" in problem] == [
        next(problem for problem in problems if problem.startswith("not reached, and no reason given: branch"))
    ]
    assert "not reached: lcs digital stream: lowest code" in problems


def test_what_is_kept_is_not_played_again_and_the_command_ends_with_its_one_line(
    call: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    played: list[str] = []

    def plays(config: object, folder: Path) -> None:
        played.append(folder.name)

    monkeypatch.setattr(plan, "runs", lambda: [Run("nothing", TINY, plays, small=True)])
    monkeypatch.setattr(
        "eskin.verify.coverage.run.points", lambda config: [Point("lcs", "held", "eskin_taxel", "pending")]
    )
    for _ in range(2):
        code, out, _ = call("dev coverage --small --out .")
        assert code == 1
        last = "coverage: 0 of 0 lines, 0 of 0 branches, 0 of 0 toggles, 0 of 0 conditions (0 explained), 0 of 1 points"
        assert out.splitlines()[-2:] == ["not reached: lcs: held", last]
    assert len(played) == 1


@pytest.mark.parametrize("run", [run for run in runs() if run.small], ids=lambda run: run.name)
def test_small_runs_reach_all_that_is_not_explained(run: Run, tmp_path: Path) -> None:
    reached = play([run], tmp_path, lambda *_: None)
    assert len(reached.of("toggle")) > 200
    assert len(reached.points) > 30
    assert judge(reached, waivers(), whole=False).problems == []


def test_a_name_of_no_run_is_one_sentence(refuses: Any) -> None:
    refuses(
        "no run begins with 'frmaes'; the name of the first run is 'lcs digital stream'", "dev coverage --only frmaes"
    )
