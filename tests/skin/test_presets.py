"""Test the scan presets: geometry, time base, sensor, quantiser and configuration."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.paper import PaperScan
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.presets import PRESETS, Scan, preset, quantise

PAPER = PaperScan()
PHYSICAL = PhysicalScan()
ARRAYS = [(1, 1), (1, 4), (3, 5), (8, 8), (12, 16)]


def noise(height: int, width: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)


def paper_reference(config: ReadoutConfig, image: np.ndarray) -> np.ndarray:
    """Return the paper scan computed taxel by taxel from the specification."""
    every = PAPER.loop_samples(config)
    numerator, denominator, _ = signal.cont2discrete(([1000.0, 0.0], [1.0, 1007.0, 7000.0]), 1 / 1.4e6, method="foh")
    columns = []
    for row in range(config.rows):
        for column in range(config.columns):
            pixels = image[row : row + image.shape[0] - config.rows + 1, column].astype(float)
            line = signal.resample_poly(pixels[::4], 560, 1, window=("kaiser", 5.0))
            columns.append(signal.lfilter(numerator.ravel(), denominator, line)[every - 1 :: every] / 256)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize(
    ("signals", "bits", "codes", "clipped"),
    [
        ([0.5 / 4, 1.5 / 4, 2.5 / 4, -0.5 / 4, -1.5 / 4], 3, [0, 2, 2, 0, -2], 0),  # half to even
        ([1.0, 0.75, -1.0, -1.25], 3, [3, 3, -4, -4], 2),  # saturation; -1.0 is a code, +1.0 is not
        ([0.87, 0.88], 3, [3, 3], 1),  # 3.48 rounds to 3; 3.52 rounds to 4, beyond the range
        ([1.0 - 2.0**-11, 1.0, math.inf], 12, [2047, 2047, 2047], 2),
        ([], 12, [], 0),
    ],
)
def test_quantise_rounds_half_to_even_saturates_and_counts(signals, bits, codes, clipped):
    got, count = quantise(np.array(signals), bits)
    assert got.dtype == np.int32
    assert got.tolist() == codes
    assert count == clipped


@given(st.lists(st.floats(-2, 2), max_size=20), st.integers(3, 24))
def test_quantised_signals_are_within_half_a_code_or_clipped(signals, bits):
    codes, clipped = quantise(np.array(signals, float), bits)
    error = np.abs(codes / 2 ** (bits - 1) - np.array(signals, float))
    assert np.count_nonzero(error > 0.5 / 2 ** (bits - 1)) <= clipped


@pytest.mark.parametrize(
    ("encoding", "resolution", "samples", "start"),
    [
        ("lcs", 2, 417, 256),
        ("lcs", 6, 26, 16),
        ("cw-lcs", 6, 26, 16),
        ("lcs", 8, 7, 4),
        ("lcs", 10, 2, 1),
        ("nlcs", 4, 35, 0),
        ("nlcs", 8, 2, 0),
        ("nlcs", 10, 1, 0),
    ],
)
def test_paper_loop_time_and_start_are_those_of_the_specification(encoding, resolution, samples, start):
    """The reference starts at D, with a leak at 0."""
    config = PAPER.configure(ReadoutConfig(encoding=encoding, resolution=resolution))
    assert PAPER.loop_samples(config) == samples
    assert config.sample_rate_hz == pytest.approx(200_000 / samples)
    assert (config.decide_every, config.reference_reset) == ("sample", start)


def test_paper_loop_time_is_at_least_one_sample():
    assert PAPER.configure(ReadoutConfig(sample_bits=20, resolution=18)).sample_rate_hz == 200_000


def test_paper_leak_gives_the_wanted_tau_at_the_loop_time():
    config = PAPER.configure(ReadoutConfig(encoding="nlcs", resolution=8), tau_s=0.2)
    assert config.tau_s == pytest.approx(0.2, rel=1e-3)
    # Without tau_s the configuration's own time constant holds, also after a second time.
    assert PAPER.configure(config) == config
    assert PAPER.configure(ReadoutConfig(encoding="nlcs", resolution=8)).tau_s == pytest.approx(0.2, rel=1e-3)


def test_paper_kylberg_line_is_80080_samples_and_0_4004_seconds():
    config = PAPER.configure(ReadoutConfig(resolution=2))  # a loop of 417 samples
    assert PAPER.signals(config, np.zeros((576, 576), np.uint8)).shape == (80_080 // 417, 64)
    assert PAPER.duration_s(config, (576, 576)) == pytest.approx(0.4004)


@pytest.mark.parametrize(("rows", "columns", "height", "width"), [(1, 1, 90, 90), (3, 5, 101, 64), (12, 16, 90, 90)])
def test_paper_signals_are_those_of_the_full_rate_line(rows, columns, height, width):
    config = PAPER.configure(ReadoutConfig(rows=rows, columns=columns, resolution=6))
    image = noise(height, width)
    np.testing.assert_allclose(PAPER.signals(config, image), paper_reference(config, image), atol=1e-9)


def test_paper_turns_an_image_that_is_wider_than_high():
    config = PAPER.configure(ReadoutConfig())
    image = noise(64, 256)
    np.testing.assert_array_equal(PAPER.signals(config, image), PAPER.signals(config, image.T))
    assert PAPER.duration_s(config, (64, 256)) == PAPER.duration_s(config, (256, 64))
    assert len(PAPER.signals(config, image)) == 63 * 560 // 26


@pytest.mark.parametrize(("encoding", "resolution", "skip_s"), [("lcs", 2, 0.01), ("nlcs", 10, 0.1)])
def test_paper_counts_from_the_first_sample_at_the_skip_time(encoding, resolution, skip_s):
    config = PAPER.configure(ReadoutConfig(encoding=encoding, resolution=resolution))
    every = PAPER.loop_samples(config)
    times_s = (np.arange(1, 80_080 // every + 1) * every - 1) / 200_000
    assert PAPER.skipped_ticks(config) == np.count_nonzero(times_s < skip_s - 1e-9)


@pytest.mark.parametrize(("encoding", "resolution", "every"), [("lcs", 6, 26), ("nlcs", 10, 1)])
def test_paper_takes_the_smallest_image_and_every_sample_of_its_line(encoding, resolution, every):
    config = PAPER.configure(ReadoutConfig(rows=12, columns=16, encoding=encoding, resolution=resolution))
    assert PAPER.signals(config, noise(16, 16)).shape == (2 * 560 // every, 192)


def test_physical_scan_of_a_kylberg_image_takes_the_whole_width():
    config = ReadoutConfig()
    pitch = 200e-6 / (26e-3 / 576)
    way_m = (575 - 7 * pitch) * 26e-3 / 576
    signals = PHYSICAL.signals(config, noise(576, 576))
    assert signals.shape == (math.floor(way_m / 65e-3 * 20_000) + 1, 64)
    assert PHYSICAL.duration_s(config, (576, 576)) == pytest.approx(way_m / 65e-3, abs=1 / 20_000)


@pytest.mark.parametrize(("rows", "columns"), ARRAYS)
def test_physical_taxels_follow_a_plane_at_their_own_place(rows, columns):
    """Check the position of each taxel with a bilinear image."""
    config = ReadoutConfig(rows=rows, columns=columns)
    height, width = 64, 120
    plane = 40 + 0.5 * np.arange(width)[None, :] + 1.25 * np.arange(height)[:, None]
    signals = PHYSICAL.signals(config, plane, start_row=2.5)
    pitch = PHYSICAL.taxel_pitch_px
    time_s = np.arange(len(signals)) / config.sample_rate_hz
    for r, c in {(0, 0), (rows - 1, columns - 1), (rows // 2, columns // 3)}:
        line = 40 + 0.5 * (c * pitch + time_s * 65e-3 / (26e-3 / 576)) + 1.25 * (2.5 + r * pitch)
        expected = PHYSICAL.sensor(line[:, None], config.sample_rate_hz)[:, 0]
        np.testing.assert_allclose(signals[:, r * columns + c], expected, atol=1e-12)


def test_physical_start_rows_span_the_image():
    config = ReadoutConfig()
    rows = PHYSICAL.start_rows(config, (576, 576), 3)
    assert rows == pytest.approx([0.0, (575 - 7 * PHYSICAL.taxel_pitch_px) / 2, 575 - 7 * PHYSICAL.taxel_pitch_px])
    image = noise(576, 60)
    assert not np.array_equal(*(PHYSICAL.signals(config, image, row) for row in rows[:2]))
    PHYSICAL.signals(config, image, rows[2])


def test_physical_takes_a_single_row_of_pixels_for_one_row_of_taxels():
    assert PHYSICAL.signals(ReadoutConfig(rows=1), noise(1, 60)).shape[1] == 8


def test_physical_sets_only_the_leak():
    config = ReadoutConfig()
    assert PHYSICAL.configure(config, 0.1) is config
    leaky = PHYSICAL.configure(ReadoutConfig(encoding="nlcs"), 0.05)
    assert leaky.tau_s == pytest.approx(0.05, rel=0.01)
    assert leaky.sample_rate_hz == 20_000
    assert PHYSICAL.skipped_ticks(leaky) == 0


@pytest.mark.parametrize("frequency_hz", [0.5, 10.0, 150.0, 2_000.0])
def test_sensor_has_the_stated_frequency_response(frequency_hz):
    rate_hz = 40_000.0
    s = 2j * math.pi * frequency_hz
    expected = abs(1000 * s / (s**2 + 1007 * s + 7000)) * 100 / 256
    seconds = max(3.0, 2 / frequency_hz)
    time_s = np.arange(int(rate_hz * seconds)) / rate_hz
    response = PHYSICAL.sensor(100 * np.sin(2 * math.pi * frequency_hz * time_s)[:, None], rate_hz)
    tail = response[-int(rate_hz / frequency_hz) :]
    assert np.ptp(tail) / 2 == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", ["paper", "physical"])
def test_float_and_integer_images_give_the_same_samples(name):
    scan = preset(name)
    config = scan.configure(ReadoutConfig(rows=3, columns=5))
    image = noise(70, 80)
    codes, _ = scan.samples(config, image)
    np.testing.assert_array_equal(codes, scan.samples(config, image.astype(float))[0])
    np.testing.assert_array_equal(codes, scan.samples(config, np.asfortranarray(image).astype(np.int64))[0])


def test_presets_are_found_by_name():
    assert preset("paper") is PRESETS["paper"]
    assert [scan.name for scan in PRESETS.values()] == list(PRESETS)


LARGE = PAPER.configure(ReadoutConfig(rows=12, columns=16))

REFUSED = {
    "signals must be numbers, not NaN; check the image they come from": lambda: quantise(np.array([0.0, math.nan]), 12),
    "preset must be one of paper, physical, not 'chip'": lambda: preset("chip"),
    "sample_rate_hz must be 200000 divided by a whole number in the paper preset, not 30000; use the configuration "
    "from configure()": lambda: PAPER.signals(ReadoutConfig(sample_rate_hz=30_000), noise(90, 90)),
    "start row must be 0 in the paper preset, not 3; use the physical preset": lambda: PAPER.signals(
        PAPER.configure(ReadoutConfig()), noise(90, 90), 3
    ),
    "an image 15 pixels wide and 40 high is too small for 12 x 16 taxels in the paper preset; it needs 16 pixels along "
    "the scan and 16 across": lambda: PAPER.signals(LARGE, noise(40, 15)),
    "tau must be a positive number of seconds, not -1": lambda: PAPER.configure(ReadoutConfig(encoding="nlcs"), -1),
    "start row must be in 0..543.985 for 8 x 8 taxels on an image 576 pixels high, not 544": lambda: PHYSICAL.signals(
        ReadoutConfig(), noise(576, 60), 544
    ),
    "the number of start rows must be at least 1, not 0": lambda: PHYSICAL.start_rows(ReadoutConfig(), (576, 576), 0),
    "an image 32 pixels wide and 64 high is too small for 8 x 8 taxels in the physical preset, 4.43 pixels apart; use "
    "a smaller array or a larger image": lambda: PHYSICAL.signals(ReadoutConfig(), noise(64, 32)),
    "playback_hz must be a positive number, not 0.0": lambda: PaperScan(playback_hz=0.0),
    "speed_m_per_s must be a positive number, not inf": lambda: PhysicalScan(speed_m_per_s=math.inf),
    "pixel_step must be a whole number from 1, not 2.5": lambda: PaperScan(pixel_step=2.5),
    "upsampling must be a whole number from 2, not 1": lambda: PaperScan(upsampling=1),
    "sensor_numerator must be finite numbers, not (1.0, nan)": lambda: PhysicalScan(sensor_numerator=(1.0, math.nan)),
    "sensor_denominator must be of higher order than sensor_numerator, not (1.0, 2.0)": lambda: PhysicalScan(
        sensor_denominator=(1.0, 2.0)
    ),
} | {
    f"an image must {sentence}": lambda scan=scan, image=image: scan.signals(scan.configure(ReadoutConfig()), image)
    for scan, image, sentence in (
        (PAPER, np.zeros((64, 64, 3), np.uint8), "be a gray array of shape (height, width), not uint8 of shape "
         "(64, 64, 3); convert it to gray"),
        (PHYSICAL, np.zeros((64, 64), complex), "be a gray array of shape (height, width), not complex128 of shape "
         "(64, 64); convert it to gray"),
        (PHYSICAL, np.full((64, 64), np.nan), "not contain NaN or infinity; replace those pixels"),
    )
}  # fmt: skip


@pytest.mark.parametrize("sentence", REFUSED)
def test_unusable_scans_are_refused_in_one_sentence(sentence):
    with pytest.raises(InputError) as refused:
        REFUSED[sentence]()
    assert str(refused.value) == sentence


def test_scan_constants_are_used():
    config = PAPER.configure(ReadoutConfig())
    image = noise(90, 90)
    half = PaperScan(pixel_full_scale=512.0)
    np.testing.assert_allclose(half.signals(config, image) * 2, PAPER.signals(config, image))
    slow = PhysicalScan(speed_m_per_s=65e-4)
    assert slow.duration_s(config, (90, 90)) == pytest.approx(10 * PHYSICAL.duration_s(config, (90, 90)), rel=0.01)


@pytest.mark.parametrize("scan", [PAPER, PHYSICAL], ids=lambda scan: str(scan.name))
def test_a_readout_wired_to_some_taxels_gets_their_signals(scan: Scan) -> None:
    image = noise(64, 96)
    skin = scan.configure(ReadoutConfig(rows=3, columns=5, resolution=4))
    wired, config = scan.wired_to(skin, [13, 0, 7])
    assert (config.rows, config.columns) == (3, 1)
    np.testing.assert_allclose(
        wired.signals(config, image), scan.signals(skin, image)[:, [13, 0, 7]], rtol=0, atol=1e-12
    )
    assert wired.duration_s(config, image.shape) == scan.duration_s(skin, image.shape)
    with pytest.raises(InputError, match=r"^3 taxels are chosen, but the readout has 15 inputs$"):
        wired.signals(skin, image)
    with pytest.raises(InputError, match=r"^taxel 15 is not on the skin; its taxels are 0\.\.14$"):
        scan.wired_to(skin, [15])
    with pytest.raises(InputError, match="choose at least one taxel, and no taxel twice"):
        scan.wired_to(skin, [1, 1])
