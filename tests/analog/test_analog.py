"""Test the analog taxel: its models and netlists, and loops of transistors and Verilog."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from eskin.analog import ngspice
from eskin.analog.characterise import check, subcircuit, varied
from eskin.analog.circuit import PINS, FrontEnd, Taxel
from eskin.analog.decision import compare, decide
from eskin.analog.loop import play
from eskin.analog.models import NMOS, kit, models, sizes
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from studies.analog import LOOPS, missed, netlist_of, touch

try:
    MISSING = ngspice.missing() or str(kit() and "")
except InputError as error:
    MISSING = str(error)
needs_ngspice = pytest.mark.skipif(bool(MISSING), reason=MISSING)

LCS = ReadoutConfig(rows=1, columns=1, sample_bits=8, resolution=6, frontend="analog", clocks_per_sample=16)
TAXEL = Taxel(FrontEnd(), LCS)


def test_a_netlist_says_which_models_it_needs() -> None:
    assert sizes(f"Mx d g s b {NMOS} w=0.42u l=1.5e-07 as=1\n* M2 a b c d x w=1u l=1u") == {(NMOS, 420, 150)}


@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_a_size_without_a_model_is_refused() -> None:
    assert models("tt", {(NMOS, 420, 150)}).count(".model") == 1
    with pytest.raises(InputError, match=r"no model .* for a transistor 0.01 um wide and 0.15 um long"):
        models("tt", {(NMOS, 10, 150)})


def test_a_comparator_needs_the_pins() -> None:
    with pytest.raises(InputError, match=f"must have a line '.subckt comparator {' '.join(PINS)}'"):
        FrontEnd(comparator=".subckt comparator a b\n.ends").circuit()


def test_a_dac_has_the_bits_above_the_grid() -> None:
    nlcs, cw = LCS.replace(encoding="nlcs"), LCS.replace(encoding="cw-lcs", sample_bits=10)
    assert [Taxel(FrontEnd(), one).bits for one in (LCS, LCS.replace(sample_bits=12), nlcs, cw)] == [8, 8, 7, 10]
    assert Taxel(FrontEnd(), nlcs).reference_bits(64) == [False] * 7  # the middle of the scale
    assert TAXEL.reference_bits(-1) == [True] * 8
    assert Taxel(FrontEnd(), cw).width_levels(4) == [False, False, True]


@pytest.mark.parametrize("size", ["w=2u l=1u", "w = 2e-6 l = 1u"])
def test_every_transistor_of_a_comparator_has_mismatch(size: str) -> None:
    pair = "\n".join(f"M{gate} out {gate} vss vss {NMOS} {size}" for gate in ("inp", "inn"))
    netlist = f" .subckt  comparator {' '.join(PINS)}\n{pair}\n.ends"
    first, *transistors, _ = varied(netlist, "other", np.random.default_rng(1)).splitlines()
    assert first.split()[:2] == [".subckt", "other"]
    shifts_v = [float(line.rpartition("delvto=")[2]) for line in transistors]
    assert len({*shifts_v} - {0.0}) == 2


def test_a_comparator_needs_an_end() -> None:
    with pytest.raises(InputError, match=r"must have a line '\.ends' after '\.subckt comparator'"):
        varied(f".subckt comparator {' '.join(PINS)}", "other", np.random.default_rng(1))


@needs_ngspice
@pytest.mark.parametrize(
    ("part", "other", "sentence"),
    [
        ("xn inp t", "xn inn t", "outp must be high if inp is 0.1 V above inn.*outp is low"),
        ("w=4u", "w=", "a transistor needs a model, then w and l, .* not: Minp xn inp t"),
        ("vdd vss nor", "vdd vss nand", "ngspice cannot simulate the circuit: Error: unknown subckt"),
        ("Mtail t clk vss vss", "Mtail t clk vss", "Error on line: .* not enough nodes"),
    ],
)
def test_a_wrong_comparator_is_refused(part: str, other: str, sentence: str) -> None:
    netlist = "\n".join(subcircuit(FrontEnd().cells))
    assert part in netlist
    with pytest.raises(InputError, match=sentence):
        check(FrontEnd(comparator=netlist.replace(part, other)))


def test_the_study_reads_a_netlist(tmp_path: Path) -> None:
    netlist = tmp_path / "mine.sp"
    netlist.write_bytes(b"")
    with pytest.raises(InputError, match="must have a line"):
        FrontEnd(comparator=netlist_of(netlist)).circuit()
    netlist.write_bytes(b"M1 d g s b\r\n + model \xff")
    assert netlist_of(netlist) == "M1 d g s b  model \N{REPLACEMENT CHARACTER}"


@needs_ngspice
def test_a_decision_from_the_charge_is_that_of_the_whole_taxel() -> None:
    gain = 0.976
    for reference, threshold, answer in ((5, 5 + 1, 1), (-3, -3 - 1, 2)):
        for outside, expected in ((0.5, answer), (-0.5, 0)):
            away = outside if answer == 1 else -outside
            x_v = TAXEL.front_end.supply_v / 2 + (threshold * gain + away) * TAXEL.unit_v
            whole = decide(TAXEL, x_v, reference, LCS.step, 1 / 1.28e6)
            above, below = compare(TAXEL, x_v, reference, LCS.step, gain)
            assert whole.above + 2 * whole.below == expected == above + 2 * below
            assert 0.1e-12 < whole.energy_j < 1e-12


@needs_ngspice
@pytest.mark.parametrize("name", [name for name, config in LOOPS.items() if config.taxels == 1])
def test_transistors_and_verilog_give_the_events_of_the_model(name: str, tmp_path: Path) -> None:
    config = LOOPS[name].replace(clocks_per_sample=16)
    signal = touch(config)[::10]
    found = play(config, FrontEnd(), signal, tmp_path, gain=0.95)
    assert found.happened == found.should_happen
    assert len(found.events) > 20
    behaved = play(config, FrontEnd(), signal, tmp_path, gain=0.95, noise_v=0.0)
    assert missed(found.events, behaved.events, config) <= 0.05 * len(found.events)


def test_an_offset_moves_the_events(tmp_path: Path) -> None:
    signal = np.full((4, 1), 1.4)
    ideal, moved = (
        play(LCS, FrontEnd(), signal, tmp_path, offsets_v=np.full((1, 2), volts), noise_v=0.0)
        for volts in (0.0, 0.5 * TAXEL.unit_v)
    )
    assert len(ideal.events) == 1
    assert len(moved.events) == 0
    assert dataclasses.replace(ideal, expected=moved.events).different == 1
