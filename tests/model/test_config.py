"""Test eskin.model.config: error messages, JSON round trip, and derived numbers."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.links.registry import NAMES
from tests.model.refused import refused

ENCODERS = ", ".join(registry.NAMES)

GOOD = ReadoutConfig(resolution=7)

REFUSALS: list[tuple[dict[str, Any], str]] = [
    ({"rows": 0}, "rows must be in 1..64, not 0"),
    ({"rows": 8.0}, "rows must be of type int, not 8.0"),
    ({"rows": True}, "rows must be of type int, not True"),
    ({"rows": 4.5}, "rows must be of type int, not 4.5"),
    ({"encoding": ["lcs"]}, f"encoding must be one of {ENCODERS}, not ['lcs']"),
    ({"encoding": "sigma"}, f"encoding must be one of {ENCODERS}, not 'sigma'"),
    ({"link": "spi"}, f"link must be one of {', '.join(NAMES)}, not 'spi'"),
    ({"frontend": "dc"}, "frontend must be one of digital, analog, not 'dc'"),
    ({"reset": "none"}, "reset must be one of sync, async, not 'none'"),
    ({"decide_every": "day"}, "decide_every must be one of clock, sample, not 'day'"),
    ({"resolution": 0}, "resolution must be in 1..sample_bits - 2 = 10, not 0"),
    ({"sample_bits": 3, "resolution": 2}, "resolution must be in 1..sample_bits - 2 = 1, not 2"),
    ({"encoding": "nlcs", "fraction_bits": 20}, "fraction_bits must be in 0..31 - sample_bits = 19, not 20"),
    ({"clocks_per_sample": 0}, "clocks_per_sample must be in 1..16777216, not 0"),
    ({"sample_rate_hz": math.nan}, "sample_rate_hz must be a positive number of hertz, not nan"),
    ({"sample_rate_hz": math.inf}, "sample_rate_hz must be a positive number of hertz, not inf"),
    ({"sample_rate_hz": 1e-300}, "sample_rate_hz must be in 1e-09..1e+12 hertz, not 1e-300"),
    ({"registers": "i2c"}, "registers must be one of none, spi, not 'i2c'"),
    (
        {"registers": "spi", "encoding": "nlcs", "leak_period": 7},
        "leak_period must be at least the number of rows, 8, with registers=spi, not 7",
    ),
    ({"sample_rate_hz": "fast"}, "sample_rate_hz must be of type float, not 'fast'"),
    ({"reference_reset": -2049}, "reference_reset must be in -2048..2047, not -2049"),
    ({"encoding": "nlcs", "reference_reset": -16}, "reference_reset must be in 0..2047, not -16"),
    ({"reference_reset": 8}, "reference_reset must be a multiple of 16 codes (a level of the encoder), not 8"),
    (
        {"encoding": "cw-lcs", "reference_reset": 2},
        "reference_reset must be a multiple of 4 codes (a level of the encoder), not 2",
    ),
]


@pytest.mark.parametrize(("fields", "sentence"), REFUSALS, ids=lambda value: str(value))
def test_refuses_with_a_sentence(fields: dict[str, Any], sentence: str) -> None:
    with refused(sentence):
        ReadoutConfig(**fields)


def test_a_link_with_two_requests_has_no_address_bit_for_the_polarity() -> None:
    bits = {
        link: ReadoutConfig(rows=2, columns=4, link=link).address_bits for link in ("four_phase", "four_phase_dual")
    }
    assert bits == {"four_phase": 4, "four_phase_dual": 3}


def test_default_leak_is_close_to_200_ms() -> None:
    assert ReadoutConfig(encoding="nlcs").tau_s == pytest.approx(0.2, rel=0.001)


@given(tau_s=st.floats(5e-5, 500.0), rate_hz=st.sampled_from([1000.0, 20_000.0, 200_000.0]))
def test_from_tau_is_within_five_per_cent_or_refuses(tau_s: float, rate_hz: float) -> None:
    try:
        config = ReadoutConfig.from_tau(tau_s, 1 / rate_hz)
    except InputError:
        config = None
    if config is None:  # too short for any leak, or too long
        assert tau_s < 20 / rate_hz or tau_s > 2**20 * 63 / rate_hz
        return
    assert config.encoding == "nlcs"
    assert config.tau_s == pytest.approx(tau_s, rel=0.05)


@given(tau_s=st.floats(0.08, 100.0))
def test_from_tau_is_within_one_per_cent_with_fine_steps(tau_s: float) -> None:
    config = ReadoutConfig.from_tau(tau_s, 1 / 20_000, resolution=8, rows=3)
    assert config.leak_shift in (5, 6)
    assert config.tau_s == pytest.approx(tau_s, rel=0.01)
    assert (config.resolution, config.rows) == (8, 3)


@pytest.mark.parametrize(
    ("tau_s", "ts_s", "nearest"),
    [
        (5e-324, 5e-5, ["7.21e-05"]),
        (1e-6, 5e-5, ["7.21e-05"]),
        (1e9, 5e-5, ["3.33e+03"]),
        (1e308, 5e-5, ["3.33e+03"]),
        (0.0016, 1e-3, ["0.00144", "0.00289"]),
        (0.002, 1e-3, ["0.00144", "0.00289"]),
        (0.0032, 1e-3, ["0.00289", "0.00348"]),
    ],
)
def test_from_tau_names_the_nearest_reachable_ones(tau_s: float, ts_s: float, nearest: list[str]) -> None:
    near = " or ".join(nearest)
    with refused(f"tau {tau_s:g} s is not reachable with a sample period of {ts_s:g} s; the nearest is {near} s"):
        ReadoutConfig.from_tau(tau_s, ts_s)
    for near_s in map(float, nearest):
        assert ReadoutConfig.from_tau(near_s, ts_s).tau_s == pytest.approx(near_s, rel=0.005)


# -- exchange ----------------------------------------------------------------------------------------


@given(
    fields=st.fixed_dictionaries(
        {},
        optional={
            "rows": st.integers(1, 64),
            "columns": st.integers(1, 64),
            "encoding": st.sampled_from(registry.NAMES),
            "resolution": st.integers(1, 10),
            "link": st.sampled_from(["stream", "four_phase"]),
            "sample_rate_hz": st.floats(1e-3, 1e9),
            "clocks_per_sample": st.integers(1, 2**24),
        },
    )
)
def test_json_round_trip(fields: dict[str, Any]) -> None:
    config = ReadoutConfig(**fields)
    again = ReadoutConfig.from_json(config.to_json())
    assert again == config
    assert again.to_json() == config.to_json()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: ReadoutConfig.from_tau(0.0, 5e-5), "tau must be a positive number of seconds, not 0.0"),
        (lambda: ReadoutConfig.from_tau(math.nan, 5e-5), "tau must be a positive number of seconds, not nan"),
        (lambda: ReadoutConfig.from_tau(0.2, -1.0), "sample period must be a positive number of seconds, not -1.0"),
        (
            lambda: ReadoutConfig.from_json(""),
            "the configuration is not JSON: Expecting value: line 1 column 1 (char 0)",
        ),
        (lambda: ReadoutConfig.from_json("[1]"), "a configuration must be a JSON object, not list"),
        (lambda: GOOD.replace(sample_bits=8), "resolution must be in 1..sample_bits - 2 = 6, not 7"),
    ],
)
def test_calls_that_are_refused_with_a_sentence(call: Callable[[], object], sentence: str) -> None:
    with refused(sentence):
        call()


def test_unknown_fields_are_named() -> None:
    for call in (ReadoutConfig.from_dict, lambda fields: ReadoutConfig().replace(**fields)):
        with pytest.raises(InputError, match=r"^unknown configuration field 'row'; known fields are clocks_per_"):
            call({"row": 8})


def test_load_names_a_file_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "none.json"
    with refused(f"cannot read the configuration {path}: No such file or directory"):
        ReadoutConfig.load(path)
    path.write_text('{"rows": 3}')
    assert ReadoutConfig.load(path) == ReadoutConfig(rows=3)
