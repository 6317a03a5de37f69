"""Test both methods of netlist power, and cases in which they must disagree."""

import dataclasses
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.chip import network_of
from eskin.flow.gatesim import flat_netlist
from eskin.flow.liberty.library import Library, read
from eskin.flow.power import classifier
from eskin.flow.power import measure as power
from eskin.flow.power.activity import Activity, read_dump
from eskin.flow.power.event_bench import Mismatch, play
from eskin.flow.power.liberty_power import LibertyPower
from eskin.flow.power.measure import Disagreement, PowerMeter, measure, wires_f
from eskin.flow.power.opensta_power import OpenstaPower
from eskin.flow.power.results import name_of
from eskin.flow.power.scenarios import CLOSING, IDLE, LONE, SATURATED, comparisons, scenarios
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import state_at
from eskin.power.synthesis import SynthesisReport
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.classifier.memory import InputMemory
from tests.flow import example_library
from tests.flow.test_gates import Made, make

CONFIG = ReadoutConfig(rows=1, columns=2, resolution=5)


@pytest.fixture(scope="module")
def made(library: Library) -> Made:
    return make(CONFIG, library.path)


@pytest.fixture(scope="module")
def played(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Activity]]:
    """Return the activity of the nets in each scenario, and let ``measure`` take it instead of a new simulation."""
    seen = power._played(CONFIG, made.flat, made.cells, tmp_path_factory.mktemp("played"))
    with pytest.MonkeyPatch.context() as patch:
        simulate = power._played

        def known(config: ReadoutConfig, flat: flat_netlist.FlatNetlist, *more: Any) -> Any:
            return seen if flat == made.flat else simulate(config, flat, *more)

        patch.setattr(power, "_played", known)
        yield {name: activity for name, (activity, _) in seen[0].items()}


@pytest.fixture(scope="module")
def results(made: Made, played: dict[str, Activity]) -> list[dict[str, Any]]:
    return measure(CONFIG, made.netlist.text, made.library, (0.0, 200.0))


def test_both_ways_agree_and_energies_are_those_of_their_events(results: list[dict[str, Any]]) -> None:
    bare, wired = results
    for result in results:
        for stretch in result["scenarios"].values():
            assert stretch["agreement"] == pytest.approx(1, abs=0.02)
        assert result["idle_w_per_taxel"] > result["leakage_w_per_taxel"] > 0
        assert result["energy_per_lone_event_j"] > 0
        assert result["energy_per_event_j"] > 0
    busy = bare["scenarios"][SATURATED]
    assert busy["events"] == busy["clocks"]
    assert bare["scenarios"][IDLE]["events"] == 0
    assert bare["scenarios"][LONE]["events"] == 16
    assert wired["leakage_w"] == bare["leakage_w"]
    assert wired["energy_per_event_j"] > 1.2 * bare["energy_per_event_j"]
    assert math.isclose(sum(busy["blocks"].values()), busy["power_w"] - busy["inputs_w"], rel_tol=1e-9)


def test_the_power_model_reads_what_is_written(results: list[dict[str, Any]]) -> None:
    report = SynthesisReport.from_dict(json.loads(json.dumps(results[0])))
    assert report.power_w(2, 0.0) == pytest.approx(2 * results[0]["idle_w_per_taxel"])
    assert name_of(results[0]) == "lcs-digital-1x2-quill_typ"
    assert name_of(results[1]) == "lcs-digital-1x2-quill_typ-wires"


def test_a_port_that_is_put_together_late_shows_the_same(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that late assembly of an output port does not change the activity."""
    config = CONFIG.replace(columns=3, frontend="analog")
    other = make(config, made.library.path)
    scenario = next(s for s in scenarios(config) if s.name == SATURATED)
    assert "always @(clk) #1 reference_code = {" in other.flat.verilog(gather=True)
    late, events = play(scenario, config, other.flat, other.cells, tmp_path)
    monkeypatch.setattr(flat_netlist, "WIDE", 1000)
    assert "always" not in other.flat.verilog(gather=True)
    at_once, again = play(scenario, config, other.flat, other.cells, tmp_path)
    assert events == again == scenario.events_inside > 0
    assert late.values.keys() == at_once.values.keys()
    assert all(np.array_equal(bits, at_once.values[net]) for net, bits in late.values.items())


def test_nothing_at_the_inputs_moves_but_clock_and_samples(made: Made, played: dict[str, Activity]) -> None:
    """Check that only clock and samples toggle at the inputs during the measurement."""
    for name, activity in played.items():
        inputs = {port.name: port.nets for port in made.flat.ports if port.direction == "input"}
        moved = {port for port, nets in inputs.items() if any(activity.toggles(net) for net in nets)}
        assert moved <= {"clk", "sample", "sample_valid"}
        if name in (IDLE, LONE):  # alike but for the events
            assert activity.toggles("sample_valid") == 2 / CONFIG.clocks_per_sample


def test_a_wrong_number_of_toggles_is_an_error(made: Made) -> None:
    ways = PowerMeter(
        LibertyPower(made.flat, made.library, {}), OpenstaPower(made.flat, made.library, {}), CONFIG.clock_hz
    )
    steps = np.arange(2 * 50 + 1)
    still = {net: np.zeros(1, bool) for net in made.flat.nets} | {"clk": steps % 2 == 1}
    clocks = {cell.pins["BEATS"] for cell in made.flat.cells if cell.kind == "SLUMBER"}
    right = Activity(50, still | dict.fromkeys(clocks, steps % 2 == 1))
    assert ways.measure("clocked", right, 0).agreement == pytest.approx(1, abs=0.02)

    class Halved(Activity):
        """Activity with half the toggles, as if falling edges were missed."""

        def toggles(self, net: str) -> float:
            return super().toggles(net) / 2

    ways.opensta = dataclasses.replace(ways.opensta)
    original = ways.opensta.power_w
    ways.opensta.power_w = lambda activity, hz: original(Halved(50, activity.values), hz)  # type: ignore[method-assign]
    with pytest.raises(
        Disagreement, match=r"^clocked: OpenSTA and the library's tables differ by -\d.* 5 % are allowed$"
    ):
        ways.measure("clocked", right, 0)


@pytest.mark.parametrize(("held", "joules"), [(False, 16e-15), (True, 32e-15)])
def test_both_ways_take_the_energy_of_a_clock_from_the_state_of_its_flop(
    made: Made, tmp_path: Path, held: bool, joules: float
) -> None:
    """Check a clock whose edges take 8 fJ while the flop holds 0, and 8 or 24 fJ (rise or fall) while it holds 1.

    The tied reset of the flop has an energy, too. An output toggle takes 10 fJ, and 1 fJ per ns of slew.
    """
    low, high = (
        f'internal_power () {{ when : "{when}"; rise_power (scalar) {{ values ("0.008"); }} '
        f'fall_power (scalar) {{ values ("{fall}"); }} }}'
        for when, fall in (("!HELD", 0.008), ("HELD", 0.024))
    )
    others, flop = example_library.library().split("cell (PERCH)")
    flop = re.sub(r"(clock : true; ).*", rf"\1{low} {high} }}", flop, count=1)
    flop = flop.replace("pin (WIPE) { direction : input;", f"pin (WIPE) {{ direction : input; {low}")
    path = tmp_path / "quill.lib"
    path.write_text(f"{others}cell (PERCH){flop}")
    library = read(path)
    steps = np.arange(2 * 50 + 1)
    values = {net: np.array([held]) for net in made.flat.nets} | {"clk": steps % 2 == 1}
    values |= {cell.pins["BEATS"]: steps % 2 == 1 for cell in made.flat.cells if cell.kind == "SLUMBER"}
    tables, opensta = LibertyPower(made.flat, library, {}), OpenstaPower(made.flat, library, {})
    flops = [cell.name for cell in made.flat.cells if cell.kind == "PERCH"]
    for way in (tables, opensta):
        found = way.power_w(Activity(50, values), 1e6)
        assert [found[name][0] for name in flops] == pytest.approx([1e6 * joules] * len(flops), rel=0.01)
    outputs = [opensta.costs[name].output for name in flops]
    assert outputs == [[pytest.approx(10e-15, rel=0.03, abs=0)]] * len(flops)


@pytest.mark.parametrize("slow", ["PERCH", "SLUMBER"], ids=["gates behind flops", "clock gates behind clock gates"])
def test_both_ways_agree_behind_slow_nets(made: Made, played: dict[str, Activity], slow: str) -> None:
    """Check that cells behind flops or clock gates with 1 pF have equal internal energy, whichever input causes it."""
    cells = made.library.cells
    activity = played[SATURATED]
    drivers = [cell for cell in made.flat.cells if cell.kind == slow]
    loads = {cell.pins[pin]: 1e-12 for cell in drivers for pin in cells[slow].outputs if pin in cell.pins}
    measured = {
        "PERCH": [cell.name for cell in made.flat.cells if not cells[cell.kind].memory and not cells[cell.kind].gate],
        "SLUMBER": [cell.name for cell in drivers],
    }[slow]
    own, other = (
        sum(found[name][0] for name in measured)
        for way in (LibertyPower, OpenstaPower)
        for found in [way(made.flat, made.library, loads).power_w(activity, CONFIG.clock_hz)]
    )
    assert other == pytest.approx(own, rel=0.02)


def test_energies_are_the_tables_of_the_library(made: Made) -> None:
    """Check the energy of an idle flop: two clock edges at 8 fJ plus 1 fJ per ns of slew."""
    flop = next(cell for cell in made.flat.cells if cell.kind == "PERCH")
    own = dataclasses.replace(made.flat, cells=(dataclasses.replace(flop, pins=flop.pins | {"BEAT": "clk"}),))
    steps = np.arange(2 * 50 + 1)
    values = {net: np.zeros(1, bool) for net in own.nets} | {"clk": steps % 2 == 1}
    internal, switching, leakage = LibertyPower(own, made.library, {}).power_w(Activity(50, values), 1e6)[flop.name]
    assert internal == pytest.approx(2 * 1e6 * (8e-15 + 0.1 * 1e-15))
    assert switching == 0
    assert leakage == pytest.approx(200e-12)


def test_a_netlist_that_does_something_else_has_no_power(made: Made) -> None:
    dead = re.sub(r"\.NEXT\([^)]*\)", ".NEXT(1'b0)", made.netlist.text)
    assert dead != made.netlist.text
    with pytest.raises(Mismatch, match="the netlist does not do what the model does"):
        measure(CONFIG, dead, made.library)


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_scenarios_are_what_their_names_say(encoding: str) -> None:
    config = ReadoutConfig(rows=2, columns=2, encoding=encoding)
    idle, *closing, lone, saturated, texture = scenarios(config)
    assert [s.name for s in closing] == [CLOSING] * config.closes
    assert all((s.start, s.clocks) == (lone.start, lone.clocks) for s in closing)
    assert idle.events_inside == 0
    assert saturated.events_inside == saturated.clocks > 100
    assert np.diff(lone.events["t"]).min() > 8
    assert lone.events_inside >= min(10, config.taxels)  # a leaky taxel fires once: its reference takes long to fall
    assert 0 < texture.events_inside < texture.clocks


def test_an_analog_taxel_is_asked_once_a_sample_and_once_more_for_an_event() -> None:
    config = ReadoutConfig(rows=2, columns=2, frontend="analog")
    idle, lone, *_ = scenarios(config)
    for scenario in (idle, lone):
        ticks = scenario.clocks // config.clocks_per_sample
        assert comparisons(config, scenario) == ticks * config.taxels + scenario.events_inside


def test_windows_are_closed_while_idle_and_close_before() -> None:
    config = ReadoutConfig(rows=1, columns=2, encoding="cw-lcs", window_period=8)
    idle, closing, *_ = scenarios(config)
    narrow, wide = config.closing_step, config.step
    for clock in (idle.start, idle.start + idle.clocks - 1):
        assert (state_at(config, idle.stimulus, clock).half_width == narrow).all()
    assert (state_at(config, closing.stimulus, closing.start).half_width == wide).all()
    last = state_at(config, closing.stimulus, closing.start + closing.clocks - 1).half_width
    assert ((narrow < last) & (last < wide)).all()
    assert idle.events_inside == closing.events_inside == 0
    with pytest.raises(InputError, match=r"^windows take 1500 samples to close, more than 1000; choose a shorter"):
        scenarios(config.replace(window_period=500))


def test_closing_windows_have_a_power_of_their_own(tmp_path: Path, made: Made) -> None:
    config = CONFIG.replace(encoding="cw-lcs", columns=1, window_period=4)
    found = measure(config, make(config, made.library.path).netlist.text, made.library)[0]
    assert found["closing_w_per_taxel"] > found["idle_w_per_taxel"]
    more = found["closing_w_per_taxel"] - found["idle_w_per_taxel"]
    ticks = 4 * (config.step // config.closing_step - 1)
    assert found["energy_per_closed_window_j"] == pytest.approx(more * ticks / config.sample_rate_hz, abs=0)
    lone, closing = (found["scenarios"][name] for name in (LONE, CLOSING))
    added = (lone["power_w"] - closing["power_w"]) * lone["clocks"] / config.clock_hz / lone["events"]
    assert found["energy_per_lone_event_j"] == pytest.approx(added, abs=0)


@pytest.mark.command("gatepower")
def test_a_net_that_is_missing_or_unknown_in_the_dump_is_one_sentence(tmp_path: Path) -> None:
    dump = tmp_path / "few.vcd"
    dump.write_text(
        "$var wire 1 ! n1 $end\n$var wire 2 $ w [1:0] $end\n$enddefinitions $end\n#0\n0!\nbx $\n#4\n1!\n#8\n0!\n"
    )
    seen = read_dump(dump, 4, 1, ["n1"])
    assert seen.values["n1"].tolist() == [False, True, False]
    assert seen.toggles("n1") == 2
    with pytest.raises(InputError, match=r"^the dump of the simulation has no net n2; .*$"):
        read_dump(dump, 4, 1, ["n2"])
    with pytest.raises(InputError, match=r"^net w\[1\] is unknown in the simulation; reset must make all nets known$"):
        read_dump(dump, 4, 1, ["w[1]"])


def test_wires_grow_with_what_they_cross(made: Made) -> None:
    wires = wires_f(made.flat, 1, 2, 200.0)
    assert wires_f(made.flat, 1, 2, 0.0) == {}
    assert wires["rst"] > 0.2e-15 * 200
    assert min(wires.values()) > 0


def test_power_with_wires_that_the_two_ways_do_not_agree_on_is_not_given(
    made: Made, played: dict[str, Activity], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = PowerMeter.measure

    def apart(ways: PowerMeter, name: str, *more: object) -> object:
        if any(ways.tables.wires_f.values()):
            raise Disagreement("far apart")
        return whole(ways, name, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(PowerMeter, "measure", apart)
    bare, wired = measure(CONFIG, made.netlist.text, made.library, (0.0, 200.0))
    assert bare["energy_per_event_j"] > 0
    assert wired == {"pitch_um": 200.0, "apart": "far apart"}
    monkeypatch.setattr(PowerMeter, "measure", lambda *_: (_ for _ in ()).throw(Disagreement("without wires too")))
    with pytest.raises(Disagreement, match="without wires too"):
        measure(CONFIG, made.netlist.text, made.library, (0.0, 200.0))


def test_the_energy_of_a_classifier_is_that_of_the_network_which_it_computes(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    chip = ChipConfig(
        readout=ReadoutConfig(rows=1, columns=2, resolution=6),
        classifier=ClassifierConfig(inputs=4, hidden=4, classes=2, lanes=2, bin_s=0.0004, own_parameters=True),
    )
    network = network_of(chip)
    text = classifier.cells_of(Classifier(chip.classifier), classifier.outside(chip.classifier), library)
    monkeypatch.setattr(classifier, "outside", lambda config: "")
    monkeypatch.setattr(classifier, "cells_of", lambda *_: text)
    found = classifier.measure(chip, network, library)
    assert found["events"] > 0
    assert found["energy_per_event_j"] > 0
    assert found["energy_per_clock_of_work_j"] > 0
    assert found["idle_w"] > found["leakage_w"] > 0
    assert found["agreement"] == pytest.approx([1, 1, 1], abs=0.05)
    wrong = (InputMemory, lambda given: [0] * given.config.input_words)
    monkeypatch.setitem(classifier.MEMORIES, "inputs", wrong)
    with pytest.raises(Mismatch, match=r"^the netlist of the classifier takes \d+ events and gives \d+ classes"):
        classifier.measure(chip, network, library)
