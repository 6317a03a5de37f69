"""Test the model of the frame readout: complete samples, exact bits, error messages, command frames."""

import dataclasses
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame import FrameModel, FrameStimulus, Inputs, simulate
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code, pack, unpack
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.presets import preset
from eskin.skin.textures.rates import measure_rates
from tests.conftest import Call

SMALL = FrameConfig(readout=ReadoutConfig(rows=1, columns=3, resolution=6))
WORDS = np.array([1, 2, 3, 0], np.uint64)
EMPTY = FrameStimulus.from_samples(SMALL, np.zeros((1, 3)))


@st.composite
def configs(draw: st.DrawFn) -> FrameConfig:
    sample_bits = draw(st.integers(3, 24))
    resolution = draw(st.integers(1, sample_bits - 2))
    return FrameConfig(
        readout=ReadoutConfig(
            rows=draw(st.integers(1, 4)),
            columns=draw(st.integers(1, 3)),
            sample_bits=sample_bits,
            resolution=resolution,
        ),
        word_bits=draw(st.integers(resolution, 64)),
        settle_clocks=draw(st.integers(1, 4)),
        conversion_clocks=draw(st.none() | st.integers(1, 12)),
    )


def random_samples(config: FrameConfig, frames: int, seed: int) -> np.ndarray:
    full_scale = config.readout.full_scale
    return np.random.default_rng(seed).integers(-full_scale, full_scale, (frames, config.taxels))


# -- numbers -----------------------------------------------------------------------------------------


@given(configs(), st.integers(0, 4), st.integers(0, 2**32))
def test_unpack_is_the_inverse_of_pack(config: FrameConfig, frames: int, seed: int) -> None:
    codes = adc_code(config, random_samples(config, frames, seed))
    words = pack(config, codes)
    assert words.shape == (frames, config.words_per_frame)
    assert np.array_equal(unpack(config, words), codes)
    assert np.array_equal(pack(config, codes & ((1 << config.resolution) - 1)), words)
    assert not words.size or int(words.max()) < 1 << config.word_bits


def test_default_is_the_frame_readout_of_the_paper() -> None:
    config = FrameConfig()
    assert config.bit_rate_hz == 6 * 64 * 20_000
    assert (config.words_per_frame, config.frame_clocks) == (24, 64 * (1 + 1 + 7) + 1)
    assert config.clock_hz == 577 * 20_000
    assert FrameConfig(readout=ReadoutConfig(clocks_per_sample=1000)).clock_hz == 20e6


def test_words_are_filled_from_the_low_end() -> None:
    assert pack(SMALL, np.array([[1, 2, -1]])).tolist() == [[1 | 2 << 6 | 0xF << 12, 0b11]]
    assert pack(SMALL, np.array([[0, 0, 1]])).tolist() == [[1 << 12, 0]]


def test_a_frame_that_is_not_whole_is_left_out() -> None:
    words = np.append(pack(SMALL, np.array([[1, 2, -1]])).ravel(), 5)
    assert unpack(SMALL, words, np.array([1, 0, 1])).tolist() == [[1, 2, -1]]


# -- the readout -------------------------------------------------------------------------------------


def test_without_a_start_nothing_happens_and_without_a_sample_the_codes_are_zero() -> None:
    config = FrameConfig()
    model = FrameModel(config)
    for _ in range(40):
        model.clock(Inputs())
    assert model.idle
    empty = FrameStimulus.from_samples(config, np.zeros((0, config.taxels), int), drain=4 * config.frame_clocks)
    assert not len(simulate(config, empty).words)
    run = simulate(config, dataclasses.replace(empty, frame_clock=np.array([0])))
    assert run.words["data"].tolist() == [0] * config.words_per_frame


@settings(max_examples=60)
@given(
    configs(),
    st.lists(st.integers(1, 20), min_size=1, max_size=5),
    st.lists(st.integers(0, 1), min_size=1, max_size=9).filter(any),
    st.integers(0, 2**32),
)
def test_every_sample_of_every_frame_leaves_once_and_in_order(
    config: FrameConfig, conversion: list[int], ready: list[int], seed: int
) -> None:
    samples = random_samples(config, 5, seed)
    span = config.taxels * (config.settle_clocks + 21) + 20 * len(ready) * (config.words_per_frame + 2)
    clock = np.arange(5) * span
    stimulus = FrameStimulus(samples, clock, clock, 5 * span, np.array(conversion), np.array(ready, np.uint8))
    run = simulate(config, stimulus)
    assert run.idle
    assert not len(run.overruns)
    assert np.array_equal(unpack(config, run.words["data"], run.words["sync"]), adc_code(config, samples))
    assert run.starts[:, 1].tolist() == list(range(config.taxels)) * 5
    taken = np.array(ready)[run.words["t"] % len(ready)]
    assert taken.all()


@settings(max_examples=40)
@given(configs(), st.integers(0, 2**32))
def test_frame_clocks_are_the_shortest_period(config: FrameConfig, seed: int) -> None:
    samples = random_samples(config, 4, seed)
    for period in (config.frame_clocks, config.frame_clocks - 1):
        clock = np.arange(4) * period
        stimulus = FrameStimulus(samples, clock, clock, 5 * period + 10, np.array([config.adc_clocks]))
        run = simulate(config, stimulus)
        if period == config.frame_clocks:
            assert not len(run.overruns)
            assert len(run.words) == 4 * config.words_per_frame
        else:
            assert len(run.overruns) >= 1


def test_the_clocks_of_the_frame_readout_are_those_of_the_timing_table() -> None:
    """Check the timing table of docs/reference/frame.md: 1 x 2 taxels, N = 8, 2 settling and 3 conversion clocks."""
    config = FrameConfig(readout=ReadoutConfig(rows=1, columns=2, resolution=8), settle_clocks=2)
    model, seen = FrameModel(config), []
    for t in range(16):
        seen.append(model.outputs)
        model.clock(Inputs(int(t in (0, 5)), int(t in (6, 12)), 0x11 * (t // 6), 1))
    columns = [outputs.column_select for outputs in seen]
    assert columns == [0] + 6 * [1] + 6 * [2] + 3 * [0]
    assert [t for t, outputs in enumerate(seen) if outputs.adc_start] == [3, 9]
    assert [t for t, outputs in enumerate(seen) if outputs.frame_overrun] == [6]
    words = [(t, o.word_sync, o.word_data) for t, o in enumerate(seen) if o.word_valid]
    assert words == [(14, 1, 0x2211)]


# -- refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: FrameConfig.from_dict({"row": 1}), "unknown configuration field 'row'"),
        (lambda: SMALL.replace(word_bits=5), "word_bits must be in resolution = 6..64, not 5"),
        (lambda: SMALL.replace(word_bits=65), "word_bits must be in resolution = 6..64, not 65"),
        (lambda: SMALL.replace(settle_clocks=0), "settle_clocks must be in 1..1024, not 0"),
        (lambda: SMALL.replace(conversion_clocks=0), "conversion_clocks must be in 1..1024, not 0"),
        (lambda: FrameConfig.from_dict([]), "a configuration must be a JSON object, not list"),
        (lambda: SMALL.replace(taxels=3), "unknown parameter in taxels"),
        (lambda: FrameConfig(readout=3), "readout must be of type ReadoutConfig, not 3"),  # type: ignore[arg-type]
        (lambda: adc_code(SMALL, np.array([2048])), "samples must be in -2048..2047 (12 bits), not 2048..2048"),
        (lambda: pack(SMALL, np.zeros((1, 2), int)), "codes must have shape (frames, 3), not (1, 2)"),
        (lambda: pack(SMALL, np.full((1, 3), 64)), "codes must be in -32..63 (6 bits), not 64..64"),
        (lambda: unpack(SMALL, WORDS, np.array([1, 0, 0, 1])), "word 2: a frame of 2 words must not begin here"),
        (lambda: unpack(SMALL, WORDS, np.array([1])), "words and sync must have one shape (words,), not (4,) and (1,)"),
        (lambda: unpack(SMALL, WORDS), "words must have shape (frames, 2), not (4,)"),
        (lambda: unpack(SMALL, np.array([[0, 8]])), "the bits after the last code of a frame must be 0"),
        (
            lambda: simulate(SMALL, FrameStimulus.from_samples(SMALL, np.zeros((1, 2), int))),
            "samples must have shape (ticks, 3) for 1 x 3 taxels, not (1, 2)",
        ),
        *(
            (
                lambda clock=clock: simulate(
                    SMALL,
                    dataclasses.replace(
                        FrameStimulus.from_samples(SMALL, np.zeros((2, 3), int)), sample_clock=np.array(clock)
                    ),
                ),
                "sample_clock and frame_clock must rise from 0, with one clock for every row of samples",
            )
            for clock in ([0, 0], [1, 2], [0])
        ),
        (
            lambda: simulate(SMALL, dataclasses.replace(EMPTY, conversion=np.array([0]))),
            "conversion must be at least 1 clock",
        ),
    ],
)
def test_refusals_are_one_sentence(call: Callable[[], object], sentence: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(sentence)}"):
        call()


def test_configuration_goes_through_a_dictionary() -> None:
    config = FrameConfig(readout=ReadoutConfig(rows=3, reset="async"), word_bits=24, conversion_clocks=4)
    assert FrameConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config
    shared = FrameConfig.from_dict(ReadoutConfig(rows=3, encoding="nlcs", link="four_phase").to_dict())
    assert (shared.rows, shared.word_bits) == (3, 16)
    assert "encoding" not in shared.to_dict()
    assert config.replace(rows=5, word_bits=12).to_dict() == config.to_dict() | {"rows": 5, "word_bits": 12}


# -- the command -------------------------------------------------------------------------------------


def test_frames_compares_all_readouts_on_the_same_scans(call: Call) -> None:
    size = {"rows": 3, "columns": 3, "resolution": 3}  # 27 bits in 2 words of 16
    words = " ".join(f"--{name} {value}" for name, value in size.items())
    code, out, err = call(f"frames --dataset embedded --limit 1 {words} --frame-rate 5000 --json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    data, scan = embedded_dataset().limit(1), preset("paper")
    frame_bits = 27 * 5000
    assert report["frame"]["bits_per_s"] == frame_bits
    assert report["frame"]["words_per_s"] == 2 * 5000
    for encoder in registry.ENCODERS:
        encoding, bits = encoder.name, 4 + encoder.polarity
        config = scan.configure(ReadoutConfig.from_dict({"encoding": encoding, **size}), 0.2)
        rate = measure_rates(data, scan, config).population_rate_hz
        found = report[encoding]
        assert found["events_per_s"] == rate > 0
        assert found["bits_per_event"] == bits
        assert found["bits_per_s"] == rate * bits
        assert found["ratio_to_frame"] == pytest.approx(rate * bits / frame_bits)
        assert found["equal_frame_rate_hz"] * 27 == pytest.approx(rate * bits)


@pytest.mark.command("frames")
def test_frames_prints_a_line_for_each_readout(call: Call) -> None:
    code, out, err = call("frames --dataset embedded --limit 1 --rows 2 --columns 2 --preset physical")
    assert (code, err) == (0, "")
    titles = [*(encoder.title for encoder in registry.ENCODERS), "frame"]
    lines = out.splitlines()[4 : 4 + len(titles)]
    assert all(line.lstrip().startswith(title) for line, title in zip(lines, titles, strict=True)), out
    assert "40,000" in out  # 24 bits are 2 words of 16


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("frames --word-bits 4", "error: word_bits must be in resolution = 6..64, not 4\n"),
        ("frames --preset dream", "error: preset must be"),
        ("frames --dataset nowhere", "error: "),
        ("verilog -o out --readout film", "error: --readout must be one of spiking, frame, not 'film'\n"),
        ("verilog -o out --word-bits 8", "error: --word-bits is for the frame readout; add --readout frame\n"),
        ("verilog -o out --readout frame --word-bits 4", "error: word_bits must be in resolution = 6..64, not 4\n"),
    ],
)
def test_bad_input_is_one_sentence(refuses: Any, line: str, sentence: str) -> None:
    refuses(sentence, line)
