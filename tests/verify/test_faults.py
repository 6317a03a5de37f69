"""Test that bit flips have only the documented effects, and that a violation is found."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eskin.model.classifier.config import ClassifierConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.readout import Readout
from eskin.verify.faults.bench import bench_gates, inside
from eskin.verify.faults.cases import CASES, ack_never_falls, cases
from eskin.verify.faults.outcomes import CLASSES, UnlikeModel, Upset
from eskin.verify.faults.plan import FEW, FIELDS, Trial, classifiers, hosts, surroundings, tiles, trials
from eskin.verify.faults.run import problems_of, run, upsets_of
from studies.faults import RESULT
from tests.planted import planted

HANDSHAKE = FEW.replace(link="four_phase")
LOADED = Trial(FEW, calm=False, stride=17)
NEVER = "never recovers"
STAYS = "stays until the host writes anew, which only a setting may"

HANGS = (
    ("self.event_ready.eq(~setup & ~request & ~ack_sync)", "self.event_ready.eq(idle & ~ack_sync)"),
    (
        "        request = Signal()\n",
        "        request = Signal()\n        idle = Signal(init=1)\n        ended = Signal()\n",
    ),
    (
        "        if self.config.address_bits:\n            address",
        "        with m.If(self.event_valid & self.event_ready):\n            m.d.sync += idle.eq(0)\n"
        "        with m.Elif(request & ack_sync & ~setup):\n            m.d.sync += idle.eq(1)\n"
        "        if self.config.address_bits:\n            address",
    ),
)
"""Idle is a flop of its own, set by the end of a handshake alone."""


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


def test_receptive_fields_have_no_flop_and_leave_the_limits_of_all_blocks() -> None:
    lines, problems = run(Trial(FIELDS, stride=19))
    assert problems == []
    flops = {line["block"]: line["flops"] for line in lines}
    assert (flops.pop("fields"), min(flops.values()) > 0) == (0, True)
    with planted("encoders.fields", ("m.d.comb += self.signal", "m.d.sync += self.signal")):
        assert inside(bench_gates(Readout(FIELDS)), "fields")


FORGETS = (
    ("self.event_valid.eq(waiting.any()),", "self.event_valid.eq(waiting.any() & (skip == 0)),"),
    (
        "        first = Signal(columns)\n",
        "        first = Signal(columns)\n        skip = Signal(4)\n"
        "        with m.If((skip != 0) & self.event_ready & waiting.any()):\n"
        "            m.d.sync += skip.eq(skip - 1)\n",
    ),
)
"""An upset of the counter loses as many events as it then counts, and is over with that."""


def test_under_load_an_upset_leaves_signals_no_further_off_than_stated() -> None:
    lines, problems = run(LOADED)
    assert problems == []
    assert {line["block"]: line["off"] for line in lines} == {"arbiter": 2, "taxel": 0}


def test_a_link_that_an_upset_stops_for_good_is_found() -> None:
    trial = Trial(HANDSHAKE, stride=9)
    with planted("links.four_phase", *HANGS):
        found = list(upsets_of(trial, "link"))
    never = {upset.flop for upset in found if upset.outcome == NEVER}
    assert {"link.idle", "link.aer_req"} <= never  # lost itself, or the handshake that would bring it back
    assert not any(u.outcome == NEVER for u in upsets_of(trial, "link"))


FRAMES = next(trial for trial in trials(small=True) if isinstance(trial.config, FrameConfig))


def test_a_frame_readout_is_right_again_after_two_frames() -> None:
    (line,), problems = run(FRAMES)
    assert problems == []
    assert line["block"] == "frame_readout"
    assert line["never recovers"] == 0
    assert line["others changed"] > line["others moved"] > 0


def test_a_merge_loses_repeats_or_changes_one_event_at_most() -> None:
    (line,), problems = run(Trial(tiles()[1], stride=5))
    assert problems == []
    assert (line["block"], line["flops"], line["lost"], line["added"]) == ("merge", 22, 1, 1)
    assert line["others changed"] > line["others moved"] > 0


def test_an_upset_setting_stays_until_the_host_writes_it_and_others_recover() -> None:
    lines, problems = run(Trial(hosts()[-1], stride=197))
    assert problems == []
    of = {line["block"]: line for line in lines}
    assert set(of) == {"host", "pattern", "registers", "settable_ticks", "spi"}
    assert of["host"]["until written"] > 0  # the step of all taxels
    assert of["registers"]["until written"] > 0
    assert of["settable_ticks"]["until written"] == 0 < of["settable_ticks"]["others changed"]


@pytest.mark.parametrize("config", classifiers(), ids=lambda config: str(config.readout))
def test_a_classifier_is_right_again_with_the_next_scan_and_its_weights_once_loaded(config: ClassifierConfig) -> None:
    lines, problems = run(Trial(config, stride=53))
    assert problems == []
    of = {line["block"]: line for line in lines}
    assert set(of) == {"classifier", "weights"}
    assert of["weights"]["until written"] > of["classifier"]["until written"] == 0
    assert of["classifier"]["others changed"] > 0


WAITS = ("moves = ~valid | block.event_ready", "moves = (~valid & ~full) | (valid & block.event_ready)")
SEQUENCER = replace(FRAMES, stride=9), "sequencer", "frame", NEVER
HOST, ALL = Trial(hosts()[0], stride=97), Trial(hosts()[0], stride=97, mode=2)
FOUND: list[tuple[Any, ...]] = [
    (LOADED, "arbiter.skip", "arbiter", "signals of others are 8 steps off for good, 4 stated", *FORGETS),
    (*SEQUENCER, ("row_ends.eq(~column[:-1].any())", "row_ends.eq(column[-1])")),
    (*SEQUENCER, ("row_ends & ~row[:-1].any()", "row_ends & row[-1]")),
    (*SEQUENCER, ("converting.eq(started & ~resting),", "converting.eq(started),")),
    (*SEQUENCER, ("            m.d.sync += Cat(started, resting).eq(0b10)\n", "")),
    *((Trial(config, stride=9), "(valid|full|event_valid)", "tiles.relay", NEVER, WAITS) for config in tiles()[:2]),
    (HOST, "host.spi.count", "registers.spi", NEVER, ("[count.eq(0), in_data.eq(0)]", "[in_data.eq(0)]")),
    (ALL, "host.registers.test_mode", "registers.file", NEVER, ("m.If(write):", "m.If(write & (kept <= field.most)):")),
    (ALL, "host.pattern.at_row", "registers.pattern", STAYS, ("place >= count - 1)", "place == count - 1)")),
    (replace(HOST, mode=1), "host.pattern.count", "registers.pattern", STAYS, ("(count - 1) & gap)", "count - 1)")),
    (
        Trial(hosts()[2], stride=97),
        "ticks.line",
        "registers.decay",
        STAYS,
        ("Cat(~line[:-1].any(), line[:-1])", "line.rotate_left(1)"),
    ),
    (
        Trial(classifiers()[0], stride=2),
        "state",
        "classifier.core",
        NEVER,
        ("with m.Default():  # OUTPUTS", "with m.Case(State.OUTPUTS):  #"),
    ),
]
"""Trials, the flops to flip, a file of the RTL, what must be reported with a bug in it, and the edits that plant it."""


@pytest.mark.parametrize("found", FOUND, ids=lambda found: found[1])
def test_a_block_that_an_upset_stops_or_shifts_for_good_is_found(found: tuple[Any, ...]) -> None:
    trial, flops, file, problem, *edits = found
    with planted(file, *edits):
        assert problem in {problems_of(trial, upset) for upset in upsets_of(trial, flops)}


@pytest.mark.quick
def test_an_upset_beyond_the_stated_bounds_is_a_problem() -> None:
    trial = Trial(HANDSHAKE, calm=True)
    taxel = Upset("row_0.taxel_1.pending", 9, "others changed", 3, 3, 0, 0, 1)
    assert problems_of(trial, taxel) == "0 events of others lost and 1 added, 0 stated"
    link = Upset("link.setup", 9, "others changed", -1, 1000, 2, 1, 0)
    assert problems_of(trial, link) == "others answer 2 ticks later by other events, 1 stated"
    loaded = Trial(HANDSHAKE, calm=False)
    assert problems_of(loaded, link) == problems_of(loaded, replace(link, off=2)) == ""
    assert problems_of(loaded, replace(link, off=3)) == "signals of others are 3 steps off for good, 2 stated"
    assert problems_of(loaded, replace(taxel, off=1)) == "signals of others are 1 steps off for good, 0 stated"
    mask = Upset("host.registers.mask_rest_taxels[0]", 9, "until written", -1, 9, -1, 0, 0, may_stay=True)
    assert problems_of(Trial(hosts()[0]), mask) == ""
    count = Upset("host.pattern.count[14]", 9, "until written", -1, 9, -1, 0, 0)
    assert problems_of(Trial(hosts()[0]), count) == STAYS
    gone = Upset("link.setup", 9, CLASSES[-1], -1, 1000, 2, 1, 0)
    assert problems_of(Trial(HANDSHAKE, calm=False), gone) == NEVER


def test_gates_that_are_not_the_model_are_refused() -> None:
    wrong_step = ("fall.eq(-half_width)", "fall.eq(-half_width - 1)")
    with planted("encoders.lcs", wrong_step), pytest.raises(UnlikeModel, match="do not give the model's events"):
        list(upsets_of(Trial(FEW, stride=99)))


@pytest.mark.parametrize("config", surroundings(small=True), ids=lambda config: str(config.link))
def test_hostile_surroundings_do_what_is_stated(config: object) -> None:
    for case in cases(config):  # type: ignore[arg-type]
        good, runs = case.holds(config)  # type: ignore[arg-type]
        assert good == runs > 0, case.name


def test_a_link_that_does_not_wait_for_ack_to_fall_is_found() -> None:
    with planted("links.four_phase", ("~setup & ~request & ~ack_sync", "~setup & ~request")):
        good, runs = ack_never_falls(HANDSHAKE)
    assert good < runs


def test_the_study_writes_outcomes_and_a_figure(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eskin.verify.faults.plan.trials", lambda: [Trial(FEW, stride=50)])
    monkeypatch.setattr("eskin.verify.faults.plan.surroundings", lambda: [FEW])
    monkeypatch.setattr("eskin.verify.faults.cases.CASES", CASES[:2])
    data, figure = RESULT.make("faults", folder)
    found = json.loads(data.read_text())
    assert found["result"] == "faults: 250 upsets, 0 of them for good, 2 hostile runs, 0 beyond what is stated"
    assert {line["block"] for line in found["blocks"]} == {"arbiter", "taxel"}
    assert figure.stat().st_size > 10_000
    monkeypatch.setattr("eskin.verify.faults.run.run", None)
    data.unlink()
    RESULT.make("faults", folder)
    assert {name: value for name, value in json.loads(data.read_text()).items() if name in found} == found, "resumed"
