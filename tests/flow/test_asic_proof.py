"""Test the equivalence proof of the clock-gated netlist, also on faulty netlists."""

import dataclasses
import functools
import re
import tempfile
from pathlib import Path

import pytest

from eskin.flow.asic.clocks import ClockError
from eskin.flow.asic.equivalence import Equivalence, design_of, prove
from eskin.flow.asic.structure import check
from eskin.flow.asic.synthesis import Netlist, synthesise
from eskin.flow.gatesim.flat_netlist import flatten
from eskin.flow.liberty.library import Library, read
from eskin.flow.power.liberty_power import LibertyPower
from eskin.model.cases import AXES, singles, values_of
from eskin.model.config import ReadoutConfig
from tests.flow import example_library

CONFIG = ReadoutConfig(rows=2, columns=1, link="four_phase")
FEW = ReadoutConfig(sample_bits=6, resolution=3, window_period=3, leak_period=9, closing_shift=1, fraction_bits=2)
NETLISTS = singles(FEW, **AXES)
"""Small readouts with every value of every axis."""


@functools.cache
def made(without: tuple[str, ...] = (), reset: str = "sync") -> Netlist:
    """Return the cached netlist of a small readout."""
    path = example_library.written(Path(tempfile.mkdtemp()), without=without)
    return synthesise(CONFIG.replace(reset=reset), read(path))


@functools.cache
def proof_of(without: tuple[str, ...] = (), reset: str = "sync") -> Equivalence:
    """Return the cached proof of the netlist of a small readout."""
    return prove(made(without, reset))


def swapped(old: str, new: str, number: int = 1, **options: str) -> Netlist:
    """Return the netlist with occurrences of a text replaced."""
    whole = made(**options)
    text = re.sub(old, new, whole.text, count=number, flags=re.MULTILINE)
    assert text != whole.text
    return dataclasses.replace(whole, text=text)


@pytest.mark.quick
def test_every_flop_and_output_is_proved() -> None:
    proof = proof_of()
    outputs = 1 + CONFIG.event_bits  # request and address
    assert proof.holds
    assert not proof.unproved
    assert proof.proved == proof.of == proof.flops + outputs
    assert proof.flops > proof.gated_flops > proof.flops // 2


@pytest.mark.parametrize("config", NETLISTS, ids=lambda config: "-".join(values_of(config).values()))
def test_the_netlist_of_every_kind_of_readout_is_proved(config: ReadoutConfig, library: Library) -> None:
    netlist = synthesise(config, library)
    assert prove(netlist).holds
    assert "SLUMBER" in netlist.text  # clock gates


def test_flops_that_hold_the_inverse_are_proved_too() -> None:
    # Quill's flop has no preset: those that the reset sets hold the inverse.
    proof = proof_of(reset="async")
    assert proof.holds


def test_a_gate_built_of_a_latch_is_proved_as_well() -> None:
    proof = proof_of(without=("SLUMBER",))
    assert proof.holds
    assert proof.gated_flops == proof_of().gated_flops


def test_the_delivered_verilog_is_proved_and_stops_the_same_flops() -> None:
    own = made()
    delivered = synthesise(CONFIG, own.library, delivered=True)
    proof = prove(delivered)
    assert proof.holds
    assert (proof.flops, proof.gated_flops) == (proof_of().flops, proof_of().gated_flops)
    assert delivered.text.count("SLUMBER") == own.text.count("SLUMBER") > 4


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("^  NEITHER ", "  UNLESS "),
        ("^  UNLESS ", "  NEITHER "),
        (r"(^  PERCH (?:.|\n)*?\.NEXT\()[^()]*", r"\g<1>rst"),
        (r"(^  SLUMBER (?:.|\n)*?\.WANTED\()[^()]*", r"\g<1>rst"),
        (r"(^  PERCH (?:.|\n)*?\.WIPE\()[^()]*", r"\g<1>aer_ack"),
    ],
)
def test_a_wrong_cell_or_wire_is_found(old: str, new: str) -> None:
    proof = prove(swapped(old, new))
    assert not proof.holds
    assert proof.unproved


def test_a_clock_that_is_stopped_by_a_plain_gate_is_refused() -> None:
    wrong = swapped(
        r"^  SLUMBER (\S+) +\((?:.|\n)*?\.BEATS\((.*?)\),(?:.|\n)*?\);", r"  NEITHER \1 (.A(clk), .B(rst), .Z(\2));"
    )
    with pytest.raises(ClockError, match=r"^the clock of the flop \S+ is not low while clk is low$"):
        prove(wrong)


def test_a_flop_that_the_second_clock_of_a_reset_sets_has_a_reset(library: Library) -> None:
    """Check the SPI slave bit that is set through a gate in the second clock of a reset."""
    netlist = synthesise(ReadoutConfig(rows=1, columns=2, registers="spi"), library)
    assert not check(netlist, design_of(netlist)).problems


def test_the_netlist_keeps_the_rules() -> None:
    for options in ({}, {"reset": "async"}, {"without": ("SLUMBER",)}):
        netlist_of = made(**options)
        found = check(netlist_of, design_of(netlist_of))
        assert not found.problems
        assert found.clock_gates >= CONFIG.taxels
        assert found.flops == proof_of(**options).flops


@pytest.mark.parametrize(
    ("old", "new", "options", "sentence"),
    [
        (r"(^  PERCH (?:.|\n)*?\.WIPE\()[^()]*", r"\g<1>aer_ack", {"reset": "async"}, r"^\S+ has no reset$"),
        (r"(^  PERCH (?:.|\n)*?\.NEXT\()[^()]*", r"\g<1>aer_ack", {}, r"^\S+ has no reset$"),
        (r"\.TRIAL\(test_enable\)", ".TRIAL(rst)", {}, r"stands still with test_enable high"),
        (
            r"^  HOOT (\S+) +\(\n    \.A\((.*)\),\n    \.Z\((.*)\)\n  \);",
            r"  NEST \1 (.OPEN(rst), .NEXT(\2), .HELD(\3));",
            {},
            r"is a latch outside of a clock gate",
        ),
    ],
)
def test_a_broken_rule_is_named(old: str, new: str, options: dict[str, str], sentence: str) -> None:
    wrong = swapped(old, new, **options)
    problems = check(wrong, design_of(wrong)).problems
    assert len(problems) >= 1
    assert any(re.search(sentence, problem) for problem in problems), problems


def test_an_output_that_drives_more_than_the_library_allows_is_named(tmp_path: Path) -> None:
    """Check loads against those of the power model; clocks are left to the layout."""
    assert not check(made(), design_of(made())).warning
    path = tmp_path / "tight.lib"
    path.write_text(example_library.library().replace("max_capacitance : 0.1;", "max_capacitance : 0.01;"))
    tight = dataclasses.replace(made(), library=read(path))
    found = check(tight, design_of(tight))
    flat = flatten(tight.text, tight.top, tight.library.content)
    kinds = tight.library.cells
    clocks = {cell.pins[pin] for cell in flat.cells for pin in kinds[cell.kind].clock_pins}
    limited = {
        cell.pins[pin]
        for cell in flat.cells
        for pin in kinds[cell.kind].outputs
        if pin in cell.pins and "max_capacitance" in kinds[cell.kind].pins[pin].entry.group
    }
    loads = LibertyPower(flat, tight.library, {}).load_f
    wanted = sorted((loads[net] for net in limited - clocks if loads.get(net, 0.0) > 0.01e-12), reverse=True)
    assert [over.load_f for over in found.overloaded] == pytest.approx(wanted)
    assert re.fullmatch(
        r"\S+/\w+ drives 0\.\d+ pF, its library allows 0\.01 pF; \d+ more outputs drive too much; "
        r"buffer these nets in the layout",
        found.warning,
    )


def test_a_latch_that_is_open_while_the_clock_is_high_is_refused() -> None:
    wrong = swapped(r"(^  NEST (?:.|\n)*?\.OPEN\()[^()]*", r"\g<1>clk", without=("SLUMBER",))
    with pytest.raises(ClockError, match=r"^the latch \S+ may be open while the clock of the flop \S+ is high$"):
        prove(wrong)
