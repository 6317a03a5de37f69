"""Test the gate and flop counts of synthesised readouts."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.flow.gate_count import count_gates
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from tests.flow import example_library

ROOT = Path(__file__).resolve().parents[2]

LIBRARY = ROOT.parent / "shared" / "data" / "ihp-sg13g2" / "sg13g2_stdcell_typ_1p20V_25C.lib"


def test_flops_are_those_of_the_design_and_an_analog_front_end_has_a_strobe_instead_of_a_sample() -> None:
    config = ReadoutConfig(rows=2, columns=3)
    per_taxel = 8 + 8 + 1 + 1 + 1  # sample and reference on the grid of D, request, polarity, mask
    arbiter = 1 + 1 + 3 + 3  # rows behind, row, latched columns and polarities
    counted = count_gates(config, config.taxels)
    assert counted.flops == 6 * per_taxel + arbiter
    assert counted.gates > counted.flops
    assert counted.area_um2 is None
    assert counted.flops - count_gates(config.replace(frontend="analog"), 6).flops == 6 * (8 - 1)


def test_frames_have_no_hardware_in_the_taxel() -> None:
    small, large = (
        count_gates(FrameConfig(readout=ReadoutConfig(rows=n, columns=n)), n * n).flops / n**2 for n in (4, 16)
    )
    assert large < small / 4


def library(path: Path, without: tuple[str, ...] = ()) -> Path:
    """Write a library whose flip-flop has the SkyWater name, and return its path."""
    path.write_text(example_library.library(without=without).replace("PERCH", "own__dfxtp_1"))
    return path


@pytest.mark.parametrize(
    ("real", "smallest_um2"),
    [
        (False, 2.0),
        pytest.param(True, 1.8, marks=pytest.mark.skipif(not LIBRARY.is_file(), reason=f"no {LIBRARY.name}")),
    ],
)
def test_flops_are_the_cells_with_an_ff_group_whatever_their_names(
    real: bool, smallest_um2: float, tmp_path: Path
) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    counted = count_gates(config, 2, LIBRARY if real else library(tmp_path / "own.lib"))
    assert counted.flops == count_gates(config, 2).flops > 30
    assert counted.gates > counted.flops
    largest_um2 = 60.0  # more than any flop of the libraries
    assert counted.area_um2 is not None
    assert smallest_um2 < counted.area_um2 / (counted.flops + counted.gates) < largest_um2


def test_a_library_that_does_not_do_is_one_sentence(tmp_path: Path) -> None:
    path = library(tmp_path / "own.lib", without=("NEITHER", "UNLESS"))
    sentence = r"lacks cells: the readout needs a flip-flop, an inverter, .* \(Yosys: [^\n]+\)$"
    with pytest.raises(InputError, match=rf"^the cell library {path} {sentence}"):
        count_gates(ReadoutConfig(rows=1, columns=1), 1, path)


def test_a_classifier_is_counted_without_its_memories(call: Any, refuses: Any, folder: Path) -> None:
    config = ClassifierConfig(inputs=4, hidden=8, classes=2, lanes=2, clocks_per_bin=100, membrane_bits=12)
    config = config.replace(own_parameters=True)
    shapes = ((4, 8), (8, 8), (8, 2), (8,), (2,))
    network = IntegerNetwork(config, *(np.zeros(shape, int) for shape in shapes))
    IntegerWeights(network, ("a", "b")).save(folder / "integer.npz")
    code, out, error = call("gates --classifier integer.npz --json")
    assert code == 0, error
    found = json.loads(out)["classifier"]
    assert found["memory_bits"] == config.memory_bits > 500
    # All potentials and spikes are there, and the weights are not: they alone would be more flops.
    assert 8 * (12 + 1) < found["flops"] < config.memory_bits
    sentence = "error: --rows has no effect with --classifier: leave one of the two out\n"
    refuses(sentence, "gates --classifier integer.npz --rows 3")


@pytest.mark.command("gates")
def test_command_compares_the_readouts_of_one_array(call: Any) -> None:
    code, out, error = call("gates --rows 2 --columns 2 --json")
    assert code == 0, error
    readouts = json.loads(out)["readouts"]
    assert list(readouts) == [*registry.NAMES, "frame"]
    expected = count_gates(ReadoutConfig(rows=2, columns=2, encoding="nlcs"), 4).to_dict()
    assert readouts["nlcs"] == expected
    assert readouts["frame"]["flops"] < readouts["lcs"]["flops"] < readouts["cw-lcs"]["flops"]
