"""Test receptive fields: the rule, array edges, rejected fields, and the default field."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import eskin
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.encoders.fields import CHOICES, Field, kind, signals
from eskin.model.frame_config import FrameConfig
from eskin.model.readout import Stimulus, simulate
from eskin.model.registers.driver import Registers
from eskin.model.registers.file import RegisterFile, Settings, Write
from eskin.model.taxel import count_events, decode, encode_timed, error_bound, slope_limit
from eskin.model.tiles.config import TilesConfig
from eskin.rtl.verilog import verilog

TWO = ReadoutConfig(rows=1, columns=2, sample_bits=4, resolution=1)


@pytest.mark.parametrize(
    ("field", "samples", "signal"),
    [
        (([0, 1], 0), (7, 7), 7),
        (([0, 1], 0), (-8, -1), -8),
        (([0, 1], 1), (2, 3), 2),  # 2.5
        (([0, 1], 1), (3, 4), 4),  # 3.5
        (([0, 1], 1), (-2, -3), -2),  # -2.5
        (([0, 1, 1], 2), (1, -4), -2),  # -1.75
        (([0, 1, 1], 2), (1, 1), 1),  # 0.75
        (([], 0), (7, 7), 0),
    ],
)
def test_sums_are_rounded_half_to_even_and_saturate(field: Any, samples: tuple[int, int], signal: int) -> None:
    config = TWO.replace(receptive_fields=[field, [[0], 0]])
    assert signals(config, np.array([samples]))[0].tolist() == [signal, samples[0]]


def test_a_missing_neighbour_is_the_own_sample() -> None:
    assert kind("neighbours", 3, 3, 4) == Field((1, 3, 5, 7), 2)
    assert kind("both", 3, 3, 4) == Field((1, 3, 4, 4, 4, 4, 5, 7), 3)
    assert kind("neighbours", 3, 3, 2) == Field((1, 2, 2, 5), 2)
    assert kind("both", 1, 1, 0) == Field((0,) * 8, 3)
    level = np.full((1, 12), -77)
    for name in ("neighbours", "both"):
        assert np.array_equal(signals(ReadoutConfig(rows=3, columns=4, receptive_fields=name), level), level)


def test_own_samples_give_the_same_configuration_and_verilog() -> None:
    own = TWO.replace(receptive_fields=[{"taxels": [0]}, [[1], 0]])
    assert own == TWO
    assert "receptive_fields" not in own.to_dict()
    assert verilog(own) == verilog(TWO)
    assert "eskin_fields" not in verilog(TWO)


def test_lists_come_back_from_json_and_from_text() -> None:
    config = TWO.replace(receptive_fields=[{"taxels": [1, 0], "shift": 1}, {"taxels": []}])
    assert ReadoutConfig.from_json(config.to_json()) == config == TWO.replace(receptive_fields="[[[0,1],1],[[],0]]")
    older = config.to_dict()
    older["fields"] = older.pop("receptive_fields")  # the key in files of earlier versions
    assert ReadoutConfig.from_dict(older) == config
    assert hash(config) == hash(TWO.replace(receptive_fields=config.receptive_fields))


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_encoders_see_the_signal_and_decoders_rebuild_it(encoding: Any) -> None:
    config = ReadoutConfig(
        rows=2, columns=2, encoding=encoding, receptive_fields=[[[0, 3], 1], [[], 0], [[2], 0], [[1, 1, 2], 2]]
    )
    plain = config.replace(receptive_fields="own")
    samples = np.rint(800 * np.sin(np.arange(2000)[:, None] / [60, 90, 70, 80])).astype(np.int16)
    seen = signals(config, samples)
    counts, late = encode_timed(config, samples)
    expected, _ = encode_timed(plain, seen)
    assert np.abs(counts).sum() > 100
    assert not counts[:, 1].any()
    assert np.array_equal(counts[:, [0, 2, 3]], expected[:, [0, 2, 3]])
    assert np.array_equal(count_events(config, samples), np.abs(counts.astype(int)).sum(0))
    low, high = error_bound(config)
    error = (seen - decode(config, counts, late))[:, [0, 2, 3]]
    assert np.abs(np.diff(seen, axis=0)).max() < slope_limit(config)
    assert error.max() <= high
    assert error.min() >= low or not config.has_polarity
    events = eskin.encode(config, samples)
    assert np.array_equal(np.bincount(events["y"] * 2 + events["x"], minlength=4)[1], 0)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        (
            "all",
            "receptive_fields must be own, neighbours, both, settable, "
            "or a list with taxels and shift of every taxel, not 'all'",
        ),
        (
            7,
            "receptive_fields must be own, neighbours, both, settable, "
            "or a list with taxels and shift of every taxel, not 7",
        ),
        ("[1", "receptive_fields are not JSON: "),
        ([[[0], 0]], "receptive_fields must list a field for each of the 2 taxels, not 1"),
        ([[[0], 0], [0]], 'receptive_fields[1] must be like {"taxels": [0, 1], "shift": 1}, not [0]'),
        ([[[0], 0], {"taxel": [0]}], 'receptive_fields[1] must be like {"taxels": [0, 1], "shift": 1}, not {'),
        ([[[0], 0], [[2], 0]], "the taxels of receptive_fields[1] must be in 0..1, not 2"),
        ([[[0], 0], [[True], 0]], "the taxels of receptive_fields[1] must be a list of whole numbers, not [True]"),
        (
            [[[0], 0], [[1, 1, 0], 3]],
            "the shift of receptive_fields[1] must be in 0..2 for 3 taxels, not 3; a larger one only loses bits",
        ),
        ([[[0], 0], [[1] * 257, 9]], "receptive_fields[1] must have at most 256 taxels, not 257"),
        ("settable", "receptive_fields settable need registers in which a host chooses them; set registers to spi"),
        ([[[], 0], [[], 0]], "receptive_fields must leave a taxel on, but no field has a taxel"),
    ],
)
def test_wrong_receptive_fields_are_refused_in_one_sentence(fields: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(sentence)}"):
        TWO.replace(receptive_fields=fields)


def test_tiles_frames_and_other_numbers_of_taxels_refuse_fields() -> None:
    config = ReadoutConfig(rows=2, columns=2, receptive_fields="both")
    with pytest.raises(InputError, match="tiles of a skin have no receptive fields"):
        TilesConfig.of(config, 2, 2)
    with pytest.raises(InputError, match="receptive fields belong to the spiking readout"):
        FrameConfig(readout=config)
    with pytest.raises(InputError, match="one column for each of the 4 taxels, not 5, since receptive fields"):
        encode_timed(config, np.zeros((3, 5), int))


def test_a_host_chooses_the_field_of_each_taxel() -> None:
    config = ReadoutConfig(rows=3, columns=6, receptive_fields="settable", registers="spi", clocks_per_sample=8)
    file = RegisterFile(config)

    def exchange(sent: bytes) -> bytes:
        address, word = int.from_bytes(sent[:2], "big"), int.from_bytes(sent[2:], "big")
        if address >> 15:
            file.clock(Write(address & 0x7FFF, word))
        return bytes(2) + file.read(address & 0x7FFF).to_bytes(4, "big")

    chip = Registers(config, exchange)
    for number, name in enumerate(CHOICES):
        chip.choose(name, range(number, 18, 4))
    told = Settings.of(config, file.signals()).receptive_fields
    choice = np.array([[told >> 2 * taxel & 3 for taxel in range(18)]], np.uint8)
    assert choice[0].tolist() == [taxel % 4 for taxel in range(18)]

    walk = np.cumsum(np.random.default_rng(3).integers(-60, 61, (40, 18)), 0)
    own = Stimulus.from_samples(config, walk)
    kept = dataclasses.replace(own, enable=choice != CHOICES.index("off"))
    set_up = dataclasses.replace(kept, choice_clock=np.zeros(1, np.int64), choice=choice)
    plain = ReadoutConfig.from_dict(config.to_dict() | {"registers": "none", "receptive_fields": "own"})
    built = [kind(CHOICES[taxel % 4], 3, 6, taxel) if taxel % 4 < 3 else Field(()) for taxel in range(18)]
    assert np.array_equal(simulate(config, set_up), simulate(plain.replace(receptive_fields=built), own))
    assert np.array_equal(simulate(config, kept), simulate(plain, kept))
    assert len(simulate(config, set_up)) > 300

    with pytest.raises(InputError, match="a field must be one of own, neighbours, both, off, not 'all'"):
        chip.choose("all", [0])
    with pytest.raises(
        InputError, match="the chip has built-in fields own; build a chip with receptive_fields=settable"
    ):
        Registers(config.replace(receptive_fields="own"), exchange).choose("own", [0])
    with pytest.raises(InputError, match="a choice needs receptive_fields settable, not own"):
        simulate(config.replace(receptive_fields="own"), set_up)
