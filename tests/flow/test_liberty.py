"""Test the Liberty reader: error messages for invalid content, and units of numbers."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.flow.liberty.boolean import evaluate, verilog_of
from eskin.flow.liberty.library import Library, read
from eskin.flow.liberty.tables import FALL, RISE
from tests.flow import example_library

TEXT = example_library.library()

HOSTILE = {
    "no number": (
        "nom_voltage : 1.2",
        "nom_voltage : abc",
        "nom_voltage of the library must be a number from 0.001 on",
    ),
    "not a number": ("area : 2;", "area : nan;", "area of cell HOOT must be a number from 0 on, not nan"),
    "infinite": ("area : 2;", "area : 1e999;", "area of cell HOOT must be a number from 0 on, not "),
    "negative": ("area : 2;", "area : -2;", "area of cell HOOT must be a number from 0 on, not -2"),
    "several": ("area : 2;", "area (2, 3);", "area of cell HOOT must be a number from 0 on, not (2"),
    "absurd": ("area : 2;", "area : 1e300;", "area of cell HOOT must be a number from 0 on, not 1e"),
    "no direction": (
        "direction : input",
        "direction : sideways",
        "direction of pin A of cell HOOT must be one of input, output, inout, internal, not sideways",
    ),
    "given twice": ("area : 2;", "area : 2; area : 3;", "area of cell HOOT stands twice"),
    "unit of one word": (
        "(1,pf)",
        "(1)",
        "capacitive_load_unit of the library must be a number and a unit such as",
    ),
    "no unit": (
        "(1,pf)",
        "(a,zz)",
        "capacitive_load_unit of the library must be a number and a unit such as",
    ),
    "unknown unit": ('"1ns"', '"1xs"', "time_unit of the library must be a number and a unit such as 1ps, not 1xs"),
    "unit of nothing": ('"1pW"', '"0pW"', "leakage_power_unit of the library must be a number and a unit such as 1pW"),
    "half a flop": ("ff (STATE, INVERSE)", "ff (STATE)", "the brackets of ff of cell PERCH must hold 2 names, not 1"),
    "no pin": ("pin (BEAT)", "pin ()", "the brackets of pin of cell PERCH must hold 1 name, not 0"),
    "pin twice": ("pin (NEXT)", "pin (BEAT)", "pin (BEAT) of cell PERCH stands twice"),
    "cell twice": ("cell (ECHO)", "cell (HOOT)", "cell (HOOT) of the library stands twice"),
    "no capacitance": (
        "capacitance : 0.002",
        "capacitance : wide",
        "capacitance of pin A of cell HOOT must be a",
    ),
}
"""Text of the library, its replacement, and the sentence."""

RISE_OF = "values of cell_rise of timing of pin Z of cell HOOT"
TABLES = {
    "no number": ('("0.038, 0.434", ', '("0.038, x", ', f"{RISE_OF} must be rows"),
    "not finite": ('("0.038, 0.434", ', '("nan, 1", ', f"{RISE_OF} must be rows"),
    "ragged": ('("0.038, 0.434", ', '("1", ', f"{RISE_OF} must be rows"),
    "too few": ('("0.038, 0.434", "0.134, 0.53")', '("0.038, 0.434")', f"the {RISE_OF} do not fit the template"),
    "unknown template": ("cell_rise (delay) {", "cell_rise (lost) {", f"the {RISE_OF} do not fit the template"),
    "no template": ("cell_rise (delay) {", "cell_rise () {", f"the {RISE_OF} do not fit the template"),
    "no transition": (
        "rise_transition (delay)",
        "rise_lost (delay)",
        "timing of pin Z of cell HOOT has a delay from A without a transition",
    ),
}
"""As above, in the first table of the library."""


def written(folder: Path, text: str) -> Path:
    """Return the path of a written library file."""
    path = folder / "own.lib"
    path.write_text(text)
    return path


def library_of(folder: Path, text: str = TEXT) -> Library:
    return read(written(folder, text))


@pytest.mark.parametrize(("right", "wrong", "sentence"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_content_is_one_sentence(right: str, wrong: str, sentence: str, tmp_path: Path) -> None:
    assert right in TEXT
    with pytest.raises(InputError) as error:
        library_of(tmp_path, TEXT.replace(right, wrong, 1))
    is_sentence(error, tmp_path, sentence)


@pytest.mark.parametrize(("right", "wrong", "sentence"), TABLES.values(), ids=TABLES)
def test_a_hostile_table_is_one_sentence_once_it_is_looked_at(
    right: str, wrong: str, sentence: str, tmp_path: Path
) -> None:
    assert right in TEXT
    library = library_of(tmp_path, TEXT.replace(right, wrong, 1))
    assert library.cells["ECHO"].ways
    with pytest.raises(InputError) as error:
        _ = library.cells["HOOT"].ways
    is_sentence(error, tmp_path, sentence)


def test_an_expression_that_cannot_be_is_one_sentence() -> None:
    with pytest.raises(InputError, match=r"^the expression 'A &' of the cell library cannot be read: [^\n]*$"):
        verilog_of("A &")
    with pytest.raises(InputError, match=r"^the expression 'A OWL' of the cell library has the unknown name 'OWL'$"):
        evaluate("A OWL", {"A": np.array([True])})


def is_sentence(error: pytest.ExceptionInfo[InputError], folder: Path, sentence: str) -> None:
    said = str(error.value)
    assert said.startswith(f"the cell library {folder / 'own.lib'} is wrong: {sentence}")
    assert said.endswith("; give another .lib")
    assert "\n" not in said


@pytest.mark.parametrize("text", ["", "library", "library () { }", "library (own) { }", "\0", "library (own) {" * 9])
def test_a_library_of_nothing_is_one_sentence_and_exit_code_2(text: str, refuses: Any, folder: Path) -> None:
    written(folder, text)
    refuses("own.lib", "asic --lib=own.lib --out=new")


@pytest.mark.parametrize(
    ("text", "values", "verilog"),
    [
        ("A B", "0001", "(A & B)"),
        ("A + B", "0111", "(A | B)"),
        ("A ^ B", "0110", "(A ^ B)"),
        ("A'", "1100", "~A"),
        ("0", "0", "1'b0"),
    ],
)
def test_an_operator_has_its_values_and_its_verilog(text: str, values: str, verilog: str) -> None:
    bits = {"A": np.array([False, False, True, True]), "B": np.array([False, True, False, True])}
    assert "".join(str(int(bit)) for bit in np.ravel(evaluate(text, bits))) == values
    assert verilog_of(text) == verilog


def test_a_unit_without_quotes_is_the_same_unit(tmp_path: Path) -> None:
    scales = library_of(tmp_path, TEXT.replace('"1ns"', "10ns").replace("(1,pf)", "(0.5,ff)")).scales
    assert (scales.time, scales.capacitance) == (pytest.approx(10e-9, abs=0), pytest.approx(0.5e-15, abs=0))


def test_a_pin_without_a_capacitance_has_that_of_the_library(tmp_path: Path) -> None:
    text = TEXT.replace("capacitance : 0.002;", "", 1).replace(
        "nom_process", "default_input_pin_cap : 0.007; nom_process"
    )
    assert library_of(tmp_path, text).cells["HOOT"].pins["A"].load_f == pytest.approx(7e-15, abs=0)


def test_a_table_is_the_same_whichever_variable_comes_first(tmp_path: Path) -> None:
    plain = library_of(tmp_path).cells["HOOT"].ways[0].delay[RISE]
    template = re.search(r"lu_table_template \(delay\) \{.*?\}", TEXT)
    assert template
    other_way = re.sub(r"_([12])", lambda found: f"_{3 - int(found[1])}", template[0])
    turned = TEXT.replace(template[0], other_way)
    turned = turned.replace('("0.038, 0.434", "0.134, 0.53")', '("0.038, 0.134", "0.434, 0.53")')
    other = library_of(tmp_path, turned).cells["HOOT"].ways[0].delay[RISE]
    assert np.array_equal(plain.values, other.values)
    slews, loads = np.array([0.02e-9, 0.3e-9, 1.0e-9]), np.array([0.2e-12, 0.05e-12, 0.001e-12])
    wanted = [0.03 + 0.2 * slew + 4.0 * load for slew, load in zip(slews * 1e9, loads * 1e12, strict=True)]
    assert plain.at(slews, loads) * 1e9 == pytest.approx(wanted)
    assert plain.at(slews, loads).tolist() == [other.at(slew, load) for slew, load in zip(slews, loads, strict=True)]


def test_edges_that_belong_together_follow_from_the_sense(tmp_path: Path) -> None:
    cells = library_of(tmp_path).cells
    assert cells["HOOT"].ways[0].edges == [(RISE, FALL), (FALL, RISE)]
    assert cells["ECHO"].ways[0].edges == [(RISE, RISE), (FALL, FALL)]
    assert len(cells["DIFFER"].ways[0].edges) == 4
    assert cells["PERCH"].launch == "BEAT"
    assert cells["PERCH"].ways[0].edges == [(RISE, RISE), (RISE, FALL)]
