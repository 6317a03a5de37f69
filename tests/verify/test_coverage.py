"""Test coverage: counts, functional points, waivers, and detection of gaps."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from eskin.base.workers.engine import Local
from eskin.cocotb_tests.runner import build_cache as store
from eskin.model.bus.config import BusConfig
from eskin.verify.coverage import plan, stimuli
from eskin.verify.coverage.constructs import Construct, files, named, read
from eskin.verify.coverage.plan import Run, runs
from eskin.verify.coverage.points.render import points
from eskin.verify.coverage.run import Reached, closing_line, judge, play
from eskin.verify.coverage.waivers import Waiver, waivers

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
POINTS = "`COVER(both, x == 3)\n"


def counted(file: str, line: int, page: str, what: str, count: int) -> str:
    """Return a line of a file in Verilator's format."""
    fields = {"f": file, "l": str(line), "n": "9", "page": f"{page}/eskin_a", "o": what, "h": "top.*"}
    return f"C '{''.join(f'{chr(1)}{key}{chr(2)}{value}' for key, value in fields.items())}' {count}\n"


def construct(kind: str, what: str) -> Construct:
    """Return a construct of the text."""
    return Construct(kind, "eskin_a.1234.v", 1, 1, what, "assign low = x & 2'h1;")


def test_counts_are_read_by_module_and_line_and_instances_are_one() -> None:
    text = named(TEXT, {"eskin_a": POINTS})
    own, cover = files(text)
    counts = counted(own, 10, "v_branch", "if", 0) + counted(own, 6, "v_toggle", "low[0]:0->1", 3)
    counts += counted(own, 6, "v_toggle", "low[0]:0->1", 4) + counted("harness.v", 3, "v_line", "block", 1)
    counts += counted(cover, 1, "v_user", "point_both", 2)
    found = read("# SystemC::Coverage-3\n" + counts, text)
    assert [(c.kind, c.module, c.line, c.what, count) for c, count in found.items()] == [
        ("branch", "eskin_a", 10, "if", 0),
        ("toggle", "eskin_a", 6, "low[0]:0->1", 7),
        ("point", "eskin_a", 1, "point_both", 2),
    ]
    assert [c.source for c in found][::2] == ["else if (x[0] & low[1]) y <= 1'h1;", POINTS.strip()]


def test_points_leave_a_module_what_it_is() -> None:
    text = named(TEXT, {"eskin_a": POINTS})
    assert text.endswith(f"{POINTS}endmodule\n")
    assert files(text).keys() > files(named(TEXT, {})).keys()
    with pytest.raises(ValueError, match="no module eskin_b"):
        named(TEXT, {"eskin_b": POINTS})


def test_an_unreached_construct_needs_a_waiver() -> None:
    branch, bit, point = construct("branch", "if"), construct("toggle", "low[1]:0->1"), construct("point", "point_both")
    reached = Reached(Counter({branch: 0, bit: 0, construct("line", "block"): 5, point: 1}), ["one"])
    verdict = judge(reached, [Waiver("toggle", "eskin_a", "x has no second bit there", "low*")])
    assert verdict.problems == [f"not reached, and no reason given: {branch.said}"]
    assert closing_line(reached, verdict) == (
        "coverage: 1 of 1 lines, 0 of 1 branches, 0 of 0 conditions, 1 of 1 toggles, 1 of 1 points (1 waived)"
    )
    reached.counts[point] = 0
    listed = [Waiver(("toggle", "branch"), "eskin_a", "any")]
    assert judge(reached, listed).problems == [f"not reached, and no reason given: {point.said}"]


@pytest.mark.command("coverage")  # builds take long
def test_a_waiver_that_explains_nothing_is_refused() -> None:
    waiver, other = Waiver("branch", "eskin_a", "why not"), Waiver("toggle", "eskin_a", "none", "low")
    reached = Reached(Counter({construct("branch", "if"): 0}))
    assert judge(reached, [waiver, other]).problems == ["explains nothing: toggle eskin_a low: none"]
    assert judge(reached, [waiver, other], whole=False).problems == []


def test_every_waiver_gives_a_reason_and_names_a_module() -> None:
    assert all(len(one.reason) > 20 and one.module and (one.what or one.source) for one in waivers())


def test_a_waiver_names_a_construct() -> None:
    one = construct("toggle", "low[1]:1->0")
    for what, source in (("low[1]:1->0", ()), ("low[*", ()), (("high", "l*w[1]*"), ()), ((), "assign low = *")):
        assert Waiver("toggle", ("eskin_b", "eskin_a"), "why", what, source).explains(one)
    for fields in ({"what": "low[2]:*"}, {"what": "low"}, {"source": "low = *"}, {"kind": "line"}, {"module": "eskin"}):
        assert not Waiver(**{"kind": "toggle", "module": "eskin_a", "reason": "why"} | fields).explains(one)


def test_every_point_of_a_design_has_a_name_of_its_own() -> None:
    for run in runs():
        of_modules = points(run.config)
        for text in of_modules.values():
            lines = [line for line in text.splitlines() if not line.startswith("//")]
            assert all(line.startswith(("`COVER(", "`RESETS(")) for line in lines)
            assert len({line.partition(",")[0] for line in lines}) == len(lines)
        points_of = sum(text.count("`") for text in of_modules.values())
        assert points_of > 6 if not isinstance(run.config, BusConfig) else points_of == 0, run.name
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
    reached = play([Run("tiny", TINY, stimuli.readout)], tmp_path, Local(1))
    problems = judge(reached, waivers(), whole=False).problems
    dead = Counter(problem.split()[6] for problem in problems if "dead" in problem)
    assert dead == {"branch": 1, "condition": 1, "toggle": 2}
    assert any("point eskin_readout" in problem and "point_lowest_code" in problem for problem in problems)


def test_coverage_reuses_cached_runs_and_ends_with_its_summary_line(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    played: list[str] = []

    def plays(config: object, folder: Path) -> None:
        played.append(folder.name)

    monkeypatch.setattr(plan, "runs", lambda: [Run("nothing", TINY, plays, small=True)])
    for _ in range(2):
        code, out, _ = call("dev coverage --small --workers 1 --out .")
        assert code == 0
        last = "coverage: 0 of 0 lines, 0 of 0 branches, 0 of 0 conditions, 0 of 0 toggles, 0 of 0 points (0 waived)"
        assert out.splitlines()[-1] == last
    assert len(played) == 1


@pytest.mark.parametrize("run", [run for run in runs() if run.small], ids=lambda run: run.name)
def test_small_runs_reach_all_that_is_not_explained(run: Run, tmp_path: Path) -> None:
    reached = play([run], tmp_path, Local(1))
    assert len(reached.of("toggle")) > 200
    assert len(reached.of("point")) > 30
    assert judge(reached, waivers(), whole=False).problems == []


def test_a_name_of_no_run_is_one_sentence(refuses: Any) -> None:
    refuses("no run begins with 'frmaes'; the name of the first run is 'plain'", "dev coverage --only frmaes")
