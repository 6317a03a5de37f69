"""Test the clock-gated netlist: cells selected by function, and every flop with an enable gated."""

import itertools
import re
from collections import Counter
from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.flow.asic.synthesis import synthesise
from eskin.flow.gate_count import count_gates
from eskin.flow.liberty.library import Library, read
from eskin.model.config import ReadoutConfig
from eskin.rtl.gates import clock_gates
from tests.flow import example_library

CONFIG = ReadoutConfig(rows=1, columns=2)
INSTANCE = re.compile(r"^  (\w+) (?:\\\S+|\w+) +\($", re.MULTILINE)


def library_without(folder: Path, *without: str) -> Library:
    """Return the example library without given cells."""
    return read(example_library.written(folder, without=without))


def test_cells_are_found_by_what_they_are(library: Library) -> None:
    assert (library.name, library.process, library.voltage_v, library.temperature_c) == ("quill_typ", 1.0, 1.2, 25.0)
    assert library.flops == {"PERCH"}
    assert [name for name, cell in library.cells.items() if cell.latch] == ["NEST"]
    assert library.tie(0) == ("NAUGHT", "Z")
    assert library.tie(1) == ("UNITY", "Z")
    assert [cell.name for cell in library.buffers] == ["ECHO"]
    gate = library.clock_gate
    assert gate is not None
    assert gate.gate is not None
    assert (gate.name, gate.gate.clock, gate.gate.enable, gate.gate.gated, gate.gate.test) == (
        *("SLUMBER", "BEAT", "WANTED", "BEATS", "TRIAL"),
    )
    flop = library.cells["PERCH"].flop
    assert flop is not None
    assert (flop.clock, flop.data, flop.clear, flop.preset, flop.rising) == ("BEAT", "NEXT", "!WIPE", "", True)
    assert library.cells["HOOT"].leakage_w == pytest.approx(20e-12, abs=0)
    assert library.cells["HOOT"].inputs == ["A"]
    assert library.cells["HOOT"].pins["A"].capacitance_f == pytest.approx(2e-15, abs=0)


def test_the_supply_is_in_volts_where_only_the_operating_conditions_have_it_in_mv(tmp_path: Path) -> None:
    path = tmp_path / "other.lib"
    text = (
        example_library.library()
        .replace("nom_voltage : 1.2;", "")
        .replace('voltage_unit : "1V"', 'voltage_unit : "1mV"')
    )
    path.write_text(text.replace("voltage : 1.2;", "voltage : 1200;"))
    assert read(path).voltage_v == pytest.approx(1.2)


def test_registers_that_share_an_enable_share_a_gate_with_test_enable(library: Library) -> None:
    made = synthesise(CONFIG, library)
    cells = Counter(INSTANCE.findall(made.text))
    assert cells["PERCH"] == count_gates(CONFIG, CONFIG.taxels).flops > 30
    assert cells["SLUMBER"] >= CONFIG.taxels  # at least the reference of every taxel
    assert made.text.count(".TRIAL(test_enable)") == cells["SLUMBER"]
    clocks = re.findall(r"^  PERCH .*?\.BEAT\((\S+) ?\)", made.text, re.MULTILINE | re.DOTALL)
    assert len(clocks) == cells["PERCH"]
    assert sum(clock != "clk" for clock in clocks) > len(clocks) // 2


@pytest.mark.parametrize("delivered", [False, True], ids=["from the RTL", "from its Verilog"])
def test_a_flop_has_the_name_of_its_register(library: Library, delivered: bool) -> None:
    """Check that no name of a port or of another wire with the same value replaces the name of a register."""
    made = synthesise(ReadoutConfig(rows=2, columns=3, resolution=4, frontend="analog"), library, delivered=delivered)
    registers = {"arbiter.behind": 1, "arbiter.event_row": 1, "arbiter.polarity": 3, "arbiter.waiting": 3}
    for row, taxel in itertools.product(range(2), range(3)):
        bits = {"compare": 1, "enabled": 1, "pending": 1, "polarity": 1, "reference": 6}
        registers |= {f"row_{row}.taxel_{taxel}.{name}": width for name, width in bits.items()}
    flops = re.findall(r"^  PERCH \\?(\S+?)(?:\[\d+\])?_reg +\($", made.text, re.MULTILINE)
    assert Counter(flops) == registers


def test_without_an_integrated_gate_one_is_built_of_a_latch(tmp_path: Path) -> None:
    made = synthesise(CONFIG, library_without(tmp_path, "SLUMBER"))
    cells = Counter(INSTANCE.findall(made.text))
    assert made.gated
    assert cells["NEST"] >= CONFIG.taxels


def test_without_latches_no_clock_is_stopped(tmp_path: Path) -> None:
    made = synthesise(CONFIG, library_without(tmp_path, "SLUMBER", "NEST"))
    assert not made.gated
    assert set(re.findall(r"\.BEAT\((\S+)\)", made.text)) == {"clk"}


def test_a_block_that_says_when_it_is_awake_has_a_gate_of_its_own() -> None:
    def module(*flops: str) -> dict:
        cells = {name: {"type": "$_DFF_P_", "connections": {"C": [2], "D": [5], "Q": [6]}} for name in flops}
        names = {
            "clk": {"bits": [2]},
            "rst": {"bits": [3]},
            "awake": {"bits": [4]},
            "d": {"bits": [5]},
            "q": {"bits": [6]},
        }
        return {"ports": {"clk": {"bits": [2]}, "rst": {"bits": [3]}}, "netnames": names, "cells": cells}

    design = {"modules": {"top": module("a"), "block": module("b", "c")}}
    design["modules"]["top"]["cells"]["link"] = {"type": "eskin_link", "connections": {"clk": [2]}}
    assert clock_gates.stop_blocks(design, synchronous_reset=True) == 2
    cells = design["modules"]["top"]["cells"]
    assert cells["a"]["connections"]["C"] == cells["block_gate"]["connections"]["gated"] == [7]
    assert cells["link"]["connections"]["clk"] == cells["block_gate"]["connections"]["clk"] == [2]
    either = cells["$awake_or_reset"]["connections"]
    assert (either["A"], either["B"], either["Y"]) == ([4], [3], cells["block_gate"]["connections"]["enable"])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            example_library.library(without=("PERCH",)),
            r"has no flip-flop: no cell of it has an ff group; give another \.lib$",
        ),
        (
            example_library.library(without=tuple(example_library.LOGIC)),
            r"has no logic gate: no cell of it has a function; give another",
        ),
        (
            example_library.library().replace("voltage : 1.2", "volts : 1.2").replace("nom_voltage", "v"),
            "has no corner: nom_",
        ),
        ("module few; endmodule", r"cannot be read as a Liberty file: .*; give a \.lib$"),
        (example_library.library()[:-200], r"cannot be read as a Liberty file: .*; give a \.lib$"),
        ("cells (few) { }", r"is not a Liberty file: it has no library\(\.\.\.\); give a \.lib$"),
    ],
)
def test_a_library_that_does_not_do_is_one_sentence(text: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "own.lib"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence) as error:
        read(path)
    assert "\n" not in str(error.value)


def test_a_library_without_the_gates_for_the_readout_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^the cell library .* lacks cells: the readout needs .* \(Yosys: .*\)$"):
        synthesise(CONFIG, library_without(tmp_path, "HOOT", "NEITHER", "UNLESS"))
