"""No upset of a flop stops a readout or reaches further than stated, and a design in which one does is found."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from flow.__main__ import app
from flow.faults import frames
from flow.faults.bench import bench_gates
from flow.faults.cases import ack_never_falls, cases
from flow.faults.outcomes import CLASSES, UnlikeModel, Upset, upsets
from flow.faults.plan import FEW, Trial, surroundings, trials
from flow.faults.run import problems_of, run
from flow.formal.mutants import Mutant, planted
from rtl.readout import Readout

ROOT = Path(__file__).parents[2]
HANDSHAKE = FEW.replace(link="four_phase")

HANGS = Mutant(
    "idle is a flop of its own, set by the end of a handshake alone",
    "link",
    "self.event_ready.eq(~setup & ~request & ~ack_sync)",
    "self.event_ready.eq(idle & ~ack_sync)",
)
IDLE = "        request = Signal()\n"


class Hanging(Mutant):
    """The bug with its flop."""

    def source(self) -> str:
        """Return the text with both edits."""
        text = super().source().replace(IDLE, IDLE + "        idle = Signal(init=1)\n        ended = Signal()\n")
        end = "        if self.config.event_bits:\n            address"
        more = (
            "        with m.If(self.event_valid & self.event_ready):\n            m.d.sync += idle.eq(0)\n"
            "        with m.Elif(request & ack_sync & ~setup):\n            m.d.sync += idle.eq(1)\n"
        )
        return text.replace(end, more + end)


def test_every_flop_of_a_small_readout_is_upset_and_none_reaches_further_than_stated() -> None:
    trial = trials(small=True)[0]
    lines, problems = run(trial)
    assert problems == []
    of = {line["block"]: line for line in lines}
    inside = [name for name in bench_gates(Readout(trial.config)).flops if name.startswith("dut.")]
    assert sum(line["flops"] for line in lines) == len(inside) == 50
    assert of["taxel"]["others changed"] == of["taxel"]["never recovers"] == 0
    assert all(of["taxel"][what] for what in ("nothing", "own events", "others moved"))
    assert of["arbiter"]["others changed"] > 0


def test_a_link_that_an_upset_stops_for_good_is_found() -> None:
    with planted(Hanging(HANGS.name, HANGS.file, HANGS.old, HANGS.new)):
        found = list(upsets(HANDSHAKE, calm=True, stride=9, flops="link"))
    never = {upset.flop for upset in found if upset.outcome == "never recovers"}
    assert {"link.idle", "link.aer_req"} <= never  # lost itself, or the handshake that would bring it back
    assert not any(u.outcome == "never recovers" for u in upsets(HANDSHAKE, calm=True, stride=9, flops="link"))


FRAMES = trials(small=True)[-1]


def test_a_frame_readout_is_right_again_after_two_frames() -> None:
    (line,), problems = run(FRAMES)
    assert problems == []
    assert line["block"] == "frame_readout"
    assert line["never recovers"] == 0
    assert line["others changed"] > line["others moved"] > 0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("row_ends.eq(~column[:-1].any())", "row_ends.eq(column[-1])"),
        ("row_ends & ~row[:-1].any()", "row_ends & row[-1]"),
        ("converting.eq(started & ~resting),", "converting.eq(started),"),
        ("            m.d.sync += Cat(started, resting).eq(0b10)\n", ""),
    ],
)
def test_a_frame_readout_that_an_upset_stops_for_good_is_found(old: str, new: str) -> None:
    with planted(Mutant("stops", "frame", old, new)):
        found = list(frames.upsets(FRAMES.config, stride=9, flops="sequencer"))  # type: ignore[arg-type]
    assert any(upset.outcome == "never recovers" for upset in found)


def test_what_goes_beyond_what_is_stated_is_a_problem() -> None:
    trial = Trial(HANDSHAKE, calm=True)
    taxel = Upset("row_0.taxel_1.pending", 9, "others changed", 3, 3, 0, 0, 1)
    assert problems_of(trial, taxel) == "0 events of others lost and 1 added, 0 stated"
    link = Upset("link.setup", 9, "others changed", -1, 1000, 2, 1, 0)
    assert problems_of(trial, link) == "others answer 2 ticks later by other events, 1 stated"
    assert problems_of(Trial(HANDSHAKE, calm=False), link) == ""
    gone = Upset("link.setup", 9, CLASSES[-1], -1, 1000, 2, 1, 0)
    assert problems_of(Trial(HANDSHAKE, calm=False), gone) == "never recovers"


def test_gates_that_are_not_the_model_are_refused() -> None:
    bug = Mutant("OFF by a wrong step", "taxel", "fall.eq(-half_width)", "fall.eq(-half_width - 1)")
    with planted(bug), pytest.raises(UnlikeModel, match="do not give the model's events"):
        list(upsets(FEW, calm=True, stride=99))


@pytest.mark.parametrize("config", surroundings(small=True), ids=lambda config: str(config.link))
def test_hostile_surroundings_do_what_is_stated(config: object) -> None:
    for case in cases(config):  # type: ignore[arg-type]
        good, runs = case.holds(config)  # type: ignore[arg-type]
        assert good == runs > 0, case.name


def test_a_link_that_does_not_wait_for_ack_to_fall_is_found() -> None:
    bug = Mutant("ready while ACK is high", "link", "~setup & ~request & ~ack_sync", "~setup & ~request")
    with planted(bug):
        good, runs = ack_never_falls(HANDSHAKE)
    assert good < runs


def test_the_command_ends_with_its_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flow.faults.plan.trials", lambda small: [Trial(FEW, True, stride=50)])
    done = CliRunner().invoke(app, ["faults", "--small", "--out", str(tmp_path / "faults.json")])
    assert done.exit_code == 0, done.output
    last = done.output.splitlines()[-1]
    assert last == "faults: 250 upsets, 0 of them for good, 602 hostile runs, 0 beyond what is stated"
    kept = json.loads((tmp_path / "faults.json").read_text())
    assert kept["result"] == last
    assert kept["command"] == "make faults SMALL=1"
