"""Test data rates after compression, and the comparison of event counts."""

import lzma

import numpy as np
import pytest

from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.snn.data.coding import coded_bits, events_bps, frames_bps
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.experiments import sweep
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.sweep import coded_bps


def test_noise_stays_as_large_as_it_is_and_a_constant_costs_nothing() -> None:
    noise = np.random.default_rng(0).integers(0, 256, 50_000).astype(np.uint8)
    assert 8 * 50_000 <= coded_bits(noise) < 8 * 50_300
    assert coded_bits(np.zeros(50_000, np.uint16)) < 1000
    wide = noise.astype(np.uint32)
    assert coded_bits(wide) < 1.02 * coded_bits(noise), "the planes of high bytes are zeros"


def test_the_smallest_of_three_coders_counts() -> None:
    words = (np.arange(40_000) // 7 % 97).astype(np.uint8)
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9}]
    assert coded_bits(words) == 8 * len(lzma.compress(words.tobytes(), lzma.FORMAT_RAW, filters=filters))


def test_every_event_and_its_time_are_in_the_bits() -> None:
    config = ReadoutConfig(rows=2, columns=2, resolution=4)
    generator = np.random.default_rng(1)
    count, clocks = 20_000, config.clocks_per_sample
    ticks = np.cumsum(generator.integers(0, 4, count))

    def bits_of(x: np.ndarray, p: np.ndarray, t: np.ndarray) -> dict[str, float]:
        events = make_events(t * clocks, x, np.zeros(count, int), p)
        made = Recording(events, config, int(t[-1] + 1) * clocks)
        return {name: bps * made.duration_s for name, bps in events_bps([made]).items()}

    alike = bits_of(np.zeros(count, int), np.ones(count, int), np.arange(count))
    assert alike["events"] < 2000
    columns = bits_of(generator.integers(0, 2, count), np.ones(count, int), np.arange(count))
    assert columns["addresses"] > count, "a bit each"
    polarities = bits_of(np.zeros(count, int), generator.integers(0, 2, count), np.arange(count))
    assert polarities["addresses"] > count
    timed = bits_of(np.zeros(count, int), np.ones(count, int), ticks)
    assert timed["addresses"] == pytest.approx(alike["addresses"])
    assert timed["events"] - timed["addresses"] > 2 * count, "two bits each"


def test_the_time_of_every_scan_counts() -> None:
    config = ReadoutConfig(rows=1, columns=1, resolution=4)
    ticks = np.arange(1000)
    events = make_events(ticks * config.clocks_per_sample, 0 * ticks, 0 * ticks, 0 * ticks + 1)
    made = Recording(events, config, 1000 * config.clocks_per_sample)
    assert events_bps([made] * 10)["events"] < 0.5 * events_bps([made])["events"], "equal scans hardly cost bits"


@pytest.mark.parametrize("bits", [6, 10, 18])
def test_differences_cost_what_they_say_whatever_the_width_of_a_word(bits: int) -> None:
    steps = np.random.default_rng(2).integers(-1, 2, (10_000, 4))
    full_scale = 2 ** (bits - 1)
    walk = ((np.cumsum(steps, axis=0) + full_scale) % 2**bits - full_scale).astype(np.int32)  # over the edge too
    found = frames_bps([walk[:, :2], walk[:, 2:]], FrameSteps(rate_hz=1.0, bits=bits))
    assert 2 * np.log2(3) < found["differences"] < 1.25 * 2 * np.log2(3), "of two taxels"
    assert found["samples"] > found["differences"]


def test_twenty_four_scans_are_coded_as_one_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(sweep, "events_bps", lambda recordings, _: {"events": seen.append(recordings) or 1.0})
    coded_bps(Experiment(dataset="embedded", readout=ReadoutConfig(rows=1, columns=1, resolution=2)))
    assert [len(recordings) for recordings in seen] == [24]


def test_a_readout_has_coded_rates_below_its_own() -> None:
    readout = ReadoutConfig(rows=2, columns=2, resolution=4)
    events = coded_bps(Experiment(dataset="embedded", readout=readout))
    assert 0 < events["addresses"] < events["events"]
    frames = coded_bps(Experiment(dataset="embedded", readout=readout, frames=FrameSteps.parse("frame:250:8", 0.004)))
    assert 0 < frames["differences"] < 250 * 4 * 8
    assert 0 < frames["samples"] < 250 * 4 * 8
