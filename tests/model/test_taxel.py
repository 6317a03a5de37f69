"""Test the encoders with literal vectors, the second model, and their error bounds."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import KINDS
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import Stimulus, simulate
from eskin.model.taxel import (
    count_events,
    counts_of_events,
    decode,
    encode,
    encode_timed,
    error_bound,
    slope_limit,
    uncontended_events,
)
from tests.model.refused import refused


def one(encoding: str, **parameters: Any) -> ReadoutConfig:
    """Return the configuration of one taxel with D = 4 codes of 8 bits."""
    common: dict[str, Any] = {"rows": 1, "columns": 1, "sample_bits": 8, "resolution": 4}
    return ReadoutConfig(encoding=encoding, **common | parameters)  # type: ignore[arg-type]


def column(*codes: int) -> NDArray[np.int16]:
    return np.array(codes, np.int16)[:, None]


def counts(config: ReadoutConfig, *codes: int) -> list[int]:
    return encode(config, column(*codes))[:, 0].tolist()


# -- the second model, one decision after the other ---------------------------------------------------


def second(
    config: ReadoutConfig, samples: NDArray[np.integer[Any]]
) -> tuple[list[tuple[int, int, int]], NDArray[np.float64]]:
    """Return events (clock, taxel, sign), and the reference after each tick, of the independent model."""
    events, reference = [], np.zeros(samples.shape)
    unit = 2**config.fraction_bits if config.encoder.leaks else 1
    for number in range(samples.shape[1]):
        taxel = KINDS[config.encoding](Settings.of(config.to_dict()))
        phase = math.floor((number // config.columns) * config.leak_period / config.rows)
        for tick, code in enumerate(samples[:, number].tolist()):
            taxel.sample, due = code, tick % config.leak_period == phase
            for clock in range(config.decisions_per_tick):
                first = clock == 0
                taxel.clock(enabled=True, taken=True, sample=None, tick=first, leak=first and due, decisions=None)
                if taxel.request is not None:
                    events.append((tick * config.clocks_per_sample + clock, number, 1 if taxel.request else -1))
            reference[tick, number] = taxel.reference / unit
    return sorted(events), reference


@st.composite
def configs(draw: st.DrawFn, encodings: tuple[str, ...] = registry.NAMES) -> ReadoutConfig:
    bits = draw(st.sampled_from([3, 4, 8, 12, 15, 16, 17, 24]))
    encoding = draw(st.sampled_from(encodings))
    config = ReadoutConfig(
        rows=draw(st.integers(1, 3)),
        columns=draw(st.integers(1, 3)),
        encoding=encoding,  # type: ignore[arg-type]
        sample_bits=bits,
        # Up to 2**(N + 2) events a sample, one by one in the second model: keep N small, but for the top one.
        resolution=draw(st.sampled_from(sorted({1, min(2, bits - 2), min(5, bits - 2), bits - 2}))),
        decide_every=draw(st.sampled_from(["clock", "sample"])),
        clocks_per_sample=draw(st.sampled_from([1, 2, 3, 5, 40])),
        closing_shift=draw(st.sampled_from([0, 1, 2, 16])),
        window_period=draw(st.sampled_from([1, 2, 3, 7])),
        leak_shift=draw(st.sampled_from([1, 2, 5, 6, 16])),
        leak_period=draw(st.sampled_from([1, 2, 3, 7])),
        fraction_bits=draw(st.sampled_from([0, 1, min(8, 31 - bits), 31 - bits])),
    )
    level = draw(st.integers(config.encoder.lowest(config) // config.grid, (config.full_scale - 1) // config.grid))
    return config.replace(reference_reset=draw(st.sampled_from([0, level * config.grid])))


@st.composite
def signals(draw: st.DrawFn, config: ReadoutConfig, slope: int | None = None) -> NDArray[np.int32]:
    """Return random samples (ticks, taxels), with steps of at most ``slope`` if given."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    low, high, n = -config.full_scale, config.full_scale - 1, config.taxels

    def codes() -> NDArray[np.int64]:
        return np.where(rng.random(n) < 0.5, rng.integers(low, high + 1, n), rng.choice([low, 0, high], n))

    x, lines = codes() if slope is None else np.full(n, config.reference_reset), []
    for _ in range(draw(st.integers(1, 40))):
        step = codes() if slope is None else rng.integers(-slope, slope + 1, n)
        x = np.clip(x + step * (rng.random(n) < 0.5), low, high)
        lines.append(x)
    return np.array(lines, np.int32)


# -- literal vectors, D = 4 --------------------------------------------------------------------------


LCS, CW_LCS = one("lcs"), one("cw-lcs", window_period=2)
NLCS = one("nlcs", leak_shift=2, leak_period=4, fraction_bits=0)
FAST_LEAK = one("nlcs-bipolar", leak_shift=1, leak_period=1, fraction_bits=0, reference_reset=-100)
BIPOLAR = {"leak_period": 1000, "decide_every": "sample"}


@pytest.mark.parametrize(
    ("config", "codes", "expected"),
    [
        (LCS, [3, 4, 7, 8, 20], [0, 1, 0, 1, 3]),  # ON where x - u = D
        (LCS, [-4, -5, -8, -9], [0, -1, 0, -1]),  # OFF only beyond -D
        (LCS, [127, -128, 0], [31, -62, 31]),  # full scale: up to 124, down to -124, back to 0
        (LCS, [5, 0, 5, -1, 5], [1, 0, 0, -1, 1]),  # noise below D after a crossing is silent
        (one("lcs", decide_every="sample"), [20, 20, 20, -20], [1, 1, 1, -1]),  # one event per tick
        (one("lcs", clocks_per_sample=2), [20, 20, 20, -20], [2, 2, 1, -2]),
        (CW_LCS, [3, 3, 3], [0, 1, 0]),  # closes by 1 every second tick: x = 3 crosses h = 3 in the clock after
        (CW_LCS, [1] * 8, [0, 0, 0, 0, 0, 1, 0, 0]),  # h = 4, 3, 2, 1; then it is open again and u = 1
        (CW_LCS, [-3] * 8, [0, 0, 0, -1, 0, 0, 0, 0]),  # h = 2 at tick 3, as OFF needs less than -h; u = -2
        (CW_LCS, [0, 0, 11], [0, 0, 3]),  # 3, then by D to 7 and 11
        (CW_LCS, [0] * 12 + [1, 0], [0] * 12 + [1, 0]),  # floor of one closing step
        # Tick 0 leaks nothing; the next leak is at tick 4.
        (NLCS, [0, 4, 5, 8, 9, -128], [0, 0, 1, 0, 1, 0]),  # fires beyond D, never at D; no OFF
        (NLCS, [0] + [20] * 8, [0, 4, 0, 0, 1, 0, 0, 0, 1]),  # u = 16 leaks to 12 at ticks 4 and 8; back a clock later
        (NLCS, [0, 7, *[0] * 8, 7], [0, 1, *[0] * 8, 1]),  # 4 leaks to 3 and 2
        # D is 4, and only beyond it an event: -5 is the first code beyond.
        *((one("nlcs-bipolar", fraction_bits=f, **BIPOLAR), [0, -4, -5, 4, 5], [0, 0, -1, 1, 1]) for f in (8, 0)),
        # The leak of -100 is -50, far more than D: with it, ON at -90 would lead to OFF in the same tick.
        (FAST_LEAK, [-90, -90], [2, -10]),
    ],
)
def test_vectors(config: ReadoutConfig, codes: list[int], expected: list[int]) -> None:
    assert counts(config, *codes) == expected


def test_rows_that_leak_in_successive_ticks_leak_only_in_their_own() -> None:
    config = one("nlcs", rows=4, leak_shift=2, leak_period=4, fraction_bits=0)
    fired = encode(config, np.full((8, 4), 20, np.int16)) > 0  # at once, and after every leak of u = 16
    assert [np.flatnonzero(row).tolist() for row in fired.T] == [[0, 4], [0, 1, 5], [0, 2, 6], [0, 3, 7]]


@pytest.mark.parametrize("taxels", [0, 70_000])
def test_samples_of_any_number_of_taxels_are_encoded(taxels: int) -> None:
    assert encode(one("lcs"), np.tile(column(4, 0), taxels)).tolist() == [[1] * taxels, [0] * taxels]


@pytest.mark.parametrize(("bits", "resolution"), [(3, 1), (16, 14), (20, 15), (24, 22)])
@pytest.mark.parametrize("encoding", registry.NAMES)
def test_full_scale_square_is_followed_to_the_end(encoding: str, bits: int, resolution: int) -> None:
    config = one(encoding, sample_bits=bits, resolution=resolution, clocks_per_sample=2**24, fraction_bits=0)
    config = config.replace(leak_period=1000)
    top, d = config.full_scale - 1, config.step
    square = np.array([top, -top - 1, top, -top - 1], np.int32)[:, None]
    got = encode(config, square)[:, 0].tolist()
    if not config.has_polarity:
        assert got == [-(-top // d) - 1, 0, 0, 0]
    elif encoding == "nlcs-bipolar":  # strict both ways; at the end a step stays out where x - u is D or -D - 1
        first = -(-top // d) - 1
        assert got[0] == first
        for low, high in itertools.pairwise(got):
            assert low * high < 0
        u = np.cumsum(got) * d
        assert (np.abs(square[:, 0] - u) <= d + (square[:, 0] < 0)).all()
    else:
        swing = 2 ** (resolution + 2) - 1
        assert got == [2 ** (resolution + 1) - 1, -(swing - 1), swing - 1, -(swing - 1)]


# -- against the second model ------------------------------------------------------------------------


@settings(max_examples=300)
@given(st.data())
def test_encoders_equal_the_second_model(data: st.DataObject) -> None:
    config = data.draw(configs())
    samples = data.draw(signals(config))
    expected, reference = second(config, samples)
    got, late = encode_timed(config, samples)
    events = uncontended_events(config, got, late)
    signs = [1 if p else -1 for p in events["p"].tolist()]
    taxels = (events["y"].astype(int) * config.columns + events["x"]).tolist()
    assert list(zip((events["t"] - 3).tolist(), taxels, signs, strict=True)) == expected
    assert np.array_equal(decode(config, got, late), reference)
    assert np.array_equal(encode(config, samples), got)
    assert np.array_equal(count_events(config, samples), np.abs(got.astype(np.int64)).sum(axis=0))
    for back, sent in zip(counts_of_events(config, events, len(samples)), (got, late), strict=True):
        assert np.array_equal(back, sent)


@settings(max_examples=100)
@given(st.data())
def test_uncontended_events_are_those_of_a_one_taxel_array(data: st.DataObject) -> None:
    config = data.draw(configs()).replace(rows=1, columns=1)
    if config.has_polarity:  # silent at x = 0, before the first sample
        config = config.replace(
            reference_reset=data.draw(st.sampled_from([0, min(config.step, config.full_scale // 2)]))
        )
    samples = data.draw(signals(config))
    end = len(samples) * config.clocks_per_sample + 3
    alone = simulate(config, Stimulus.from_samples(config, samples, clocks=end))
    assert np.array_equal(uncontended_events(config, *encode_timed(config, samples)), alone)


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_counting_in_blocks_leaves_no_seam(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    samples = np.cumsum(rng.integers(-9, 10, (3_000, 6)), axis=0).clip(-128, 127).astype(np.int16)
    config = one(encoding, rows=2, columns=3, window_period=5, leak_shift=2, leak_period=97)
    totals = np.abs(encode(config, samples)).sum(axis=0)
    monkeypatch.setattr("eskin.model.taxel._BLOCK_BYTES", 100)  # 8 ticks
    assert totals.all()
    assert np.array_equal(count_events(config, samples), totals)


# -- bounds ------------------------------------------------------------------------------------------


@settings(max_examples=300)
@given(st.data())
def test_reconstruction_keeps_its_bound_within_the_slope_limit(data: st.DataObject) -> None:
    config = data.draw(configs())
    assume(slope_limit(config) >= 0)
    samples = data.draw(signals(config, slope=int(min(slope_limit(config), 2**24))))
    error = samples - decode(config, *encode_timed(config, samples))
    low, high = error_bound(config)
    assert error.max() <= high
    if not config.has_polarity:
        # Falling: below the leaky peak hold of the input.
        phase = np.arange(config.taxels) // config.columns * config.leak_period // config.rows
        peak = np.full(config.taxels, config.reference_reset * 2**config.fraction_bits)
        for tick, x in enumerate(samples):
            leak = (peak + 2 ** (config.leak_shift - 1)) >> config.leak_shift
            peak = np.maximum(peak - np.where(tick % config.leak_period == phase, leak, 0), x * 2**config.fraction_bits)
            assert (x - error[tick] <= peak / 2**config.fraction_bits).all()
    else:
        assert error.min() >= low


@settings(max_examples=100)
@given(st.data())
def test_nlcs_follows_a_fall_no_steeper_than_its_leak(data: st.DataObject) -> None:
    config = data.draw(configs(("nlcs",))).replace(rows=1, columns=1, reference_reset=0)
    assume(slope_limit(config) >= 0)
    limit = int(slope_limit(config))
    x, line = 0, []
    for tick in range(data.draw(st.integers(1, 60))):
        leak = (x * 2**config.fraction_bits + 2 ** (config.leak_shift - 1)) >> config.leak_shift
        fall = leak >> config.fraction_bits if tick % config.leak_period == 1 % config.leak_period else 0
        x += data.draw(st.integers(-min(fall, limit), min(limit, config.full_scale - 1 - x)))
        line.append(x)
    samples = np.array(line, np.int32)[:, None]
    error = samples - decode(config, *encode_timed(config, samples))
    low, high = error_bound(config)
    assert error.min() >= low
    assert error.max() <= high


@pytest.mark.parametrize(("shift", "period"), [(6, 63), (5, 127)])
@pytest.mark.parametrize("level", [1.5, 100])
def test_nlcs_fires_with_the_period_of_the_leaky_neuron(level: float, shift: int, period: int) -> None:
    config = ReadoutConfig(rows=1, columns=1, encoding="nlcs", leak_shift=shift, leak_period=period)
    x, d, ticks = round(level * config.step), config.step, 2_000_000
    spikes = int(count_events(config, np.full((ticks, 1), x, np.int16))[0])
    seconds = ticks / config.sample_rate_hz / (config.tau_s * math.log(x / (x - d)))
    # The leak comes in steps of 2**-k: the threshold is passed by half a step on average.
    assert -(2.0**-shift) / 2 - 0.003 < spikes / seconds - 1 < 0.003


@pytest.mark.parametrize("period", [2**15 - 1, 2**15, 2**16])
def test_a_window_may_close_after_more_ticks_than_16_bits_count(period: int) -> None:
    config = one("cw-lcs", window_period=period, closing_shift=1)
    found = encode(config, np.full((period + 5, 33), 103, np.int16))  # 100 at once, 3 where the window is D / 2
    assert np.array_equal(np.unique(np.nonzero(found)[0]), [0, period])
    assert found[[0, period]].tolist() == [[25] * 33, [1] * 33]


@pytest.mark.parametrize("wide", [15, 16])
def test_cw_lcs_goes_from_end_to_end_of_the_scale_where_16_bits_hold_it_and_where_not(wide: int) -> None:
    config = one("cw-lcs", sample_bits=16, resolution=wide - 2 - 1, closing_shift=1, clocks_per_sample=2**14)
    assert config.sample_bits - (config.closing_step.bit_length() - 1) == wide
    ends = np.repeat([[-(2**15)], [2**15 - 1], [-(2**15)]], 3, axis=0)
    samples = np.repeat(ends, 33, axis=1)
    events, reference = second(config, samples[:, :1])
    assert np.array_equal(decode(config, *encode_timed(config, samples)), np.repeat(reference, 33, axis=1))
    assert count_events(config, samples)[0] == len(events)


# -- refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        (np.zeros(4, np.int16), "samples must have the shape (ticks, taxels), not (4,)"),
        (np.zeros((4, 1)), "samples must be integer codes, not float64; eskin.encode takes floats in full scales"),
        (column(0, 128), "samples must be in -128..127 (8 bits), not 128; scale or clip them first"),
        (column(0, -129), "samples must be in -128..127 (8 bits), not -129; scale or clip them first"),
        (np.array([[65536]]), "samples must be in -128..127 (8 bits), not 65536; scale or clip them first"),
        (
            np.array([[2**64 - 1]], np.uint64),
            f"samples must be in -128..127 (8 bits), not {2**64 - 1}; scale or clip them first",
        ),
    ],
)
def test_bad_samples_are_refused(samples: Any, sentence: str) -> None:
    for call in (encode, encode_timed, count_events):
        with refused(sentence):
            call(one("lcs"), samples)


def test_other_misfits_are_refused() -> None:
    for taxels in (3, 5):
        with pytest.raises(InputError, match=f"one column for each of the 4 taxels, not {taxels}"):
            encode(one("nlcs", columns=4), np.zeros((2, taxels), np.int16))
    with pytest.raises(InputError, match=r"out must be of shape \(2, 1\) and type int16, not \(2, 1\) and int32"):
        encode(one("lcs"), column(0, 0), out=np.zeros((2, 1), np.int32))
    with pytest.raises(InputError, match="late is required for cw-lcs with several decisions per sample"):
        decode(one("cw-lcs"), column(0, 1))
    with pytest.raises(InputError, match="late is required for nlcs"):
        uncontended_events(one("nlcs"), column(0, 1))
    with pytest.raises(InputError, match="late must be a bool array"):
        decode(one("cw-lcs"), column(0, 1), column(0, 1))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="counts must have one column for each of the 1 taxels, not 2"):
        uncontended_events(one("lcs"), np.zeros((2, 2), np.int16))
    others: list[Any] = [np.zeros((2, 1)), np.zeros(3, np.int16)]
    for counts_of_another_kind in others:
        with pytest.raises(InputError, match="counts must be signed integers of shape"):
            decode(one("lcs"), counts_of_another_kind)


def test_samples_of_any_layout_give_the_same_events_and_stay_untouched() -> None:
    samples = np.random.default_rng(1).integers(-128, 128, (50, 4))
    expected = encode(one("lcs"), samples)
    for dtype in (np.int8, np.int16, np.int32, np.int64):
        given_samples: NDArray[Any] = np.asfortranarray(samples, dtype=dtype)
        assert np.array_equal(encode(one("lcs"), given_samples), expected)
        assert np.array_equal(given_samples, samples)
    out = np.empty_like(expected)
    assert encode(one("lcs"), samples, out=out) is out
    assert np.array_equal(out, expected)


def test_the_example_of_the_manual_runs() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "encoders.md").read_text()
    exec(text.split("```python\n")[1].split("```")[0], {})
