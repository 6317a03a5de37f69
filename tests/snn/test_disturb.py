"""Test the disturbances."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import Texture, open_dataset
from eskin.skin.textures.presets import preset
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.disturb import (
    DISTURBANCES,
    TRAINING,
    Draft,
    _scene_signals,
    compare,
    disturbed_dataset,
    draw_strengths,
    noisy,
    record_disturbed,
)
from eskin.snn.data.record import record

CONFIG = ReadoutConfig(rows=3, columns=4, resolution=4)
SCAN = preset("physical")


@pytest.fixture(scope="module")
def texture() -> Texture:
    return open_dataset("embedded")[0]


def disturbed(texture: Texture, config: ReadoutConfig = CONFIG, **strengths: float) -> Recording:
    named = {name.replace("_", "-"): strength for name, strength in strengths.items()}
    return record_disturbed(texture, "embedded", SCAN, config, named, np.random.default_rng(0))


@pytest.fixture(scope="module")
def clean(texture: Texture) -> Recording:
    return record(texture, "embedded", SCAN, CONFIG)


def test_without_a_disturbance_the_events_are_those_of_a_recording(texture: Texture, clean: Recording) -> None:
    found = disturbed(texture)
    np.testing.assert_array_equal(found.events, clean.events)
    assert found.duration_clocks == clean.duration_clocks
    for name in ("noise", "dead", "hot", "lost", "jitter", "late", "mismatch", "offset", "height"):
        np.testing.assert_array_equal(disturbed(texture, **{name: 0.0}).events, clean.events, name)
    np.testing.assert_array_equal(disturbed(texture, gain=1.0, speed=1.0, rotation=0.0).events, clean.events)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_every_disturbance_changes_the_events_and_repeats_itself(texture: Texture, clean: Recording, name: str) -> None:
    disturbance = DISTURBANCES[name]
    assert list(disturbance.strengths) == sorted(set(disturbance.strengths))
    strength = disturbance.strengths[0 if name == "short" else -1]  # the embedded scans last 0.17 s
    first, again = (disturbed(texture, **{name: strength}) for _ in range(2))
    np.testing.assert_array_equal(first.events, again.events)
    assert not np.array_equal(first.events, clean.events)
    assert (np.diff(first.events["t"]) >= 0).all()
    assert len(first.events) > 100


def test_each_does_what_it_says(texture: Texture, clean: Recording) -> None:
    n, clock_hz = len(clean.events), CONFIG.clock_hz
    assert len(set(taxel_of(disturbed(texture, dead=0.25).events, CONFIG))) == 9
    assert abs(len(disturbed(texture, lost=0.3).events) / n - 0.7) < 0.05
    more = len(disturbed(texture, hot=0.25).events) - n
    assert abs(more / (3 * 1000.0 * clean.duration_s) - 1) < 0.15
    assert disturbed(texture, CONFIG.replace(encoding="nlcs"), hot=0.25).events["p"].all(), "N-LCS has no OFF events"
    assert disturbed(texture, short=0.1).events["t"].max() < 0.1 * clock_hz
    late = disturbed(texture, late=0.05).events
    assert len(late) == (clean.events["t"] >= 0.05 * clock_hz).sum()
    assert late["t"].min() < 0.01 * clock_hz
    moved = disturbed(texture, jitter=0.001)
    assert len(moved.events) == n
    assert disturbed(texture, speed=0.5).duration_s == pytest.approx(2 * clean.duration_s, rel=1e-3)
    assert len(disturbed(texture, noise=0.05).events) > 1.5 * n


def scene(image: NDArray[Any], **fields: Any) -> NDArray[np.float64]:
    config = CONFIG.replace(resolution=4)
    return _scene_signals(Draft(config, SCAN, image, **fields)).reshape(-1, config.rows, config.columns)


def test_directions_move_the_array_as_it_is(texture: Texture) -> None:
    image = texture.load()[:300, :320]
    mirrored = scene(np.ascontiguousarray(image[:, ::-1]))
    np.testing.assert_allclose(scene(image, quarter_turns=2), mirrored[:, :, ::-1])
    turned = CONFIG.replace(rows=CONFIG.columns, columns=CONFIG.rows)
    downwards = SCAN.signals(turned, np.ascontiguousarray(image.T)).reshape(-1, CONFIG.columns, CONFIG.rows)
    np.testing.assert_allclose(scene(image, quarter_turns=3, height=0.0), downwards.transpose(0, 2, 1))


def test_ideal_comparators_give_the_counts_of_the_encoder(texture: Texture, clean: Recording) -> None:
    signals = SCAN.signals(CONFIG, texture.load())
    found = compare(CONFIG, signals, 0.0, 0.0, np.random.default_rng(0))
    for polarity in (True, False):
        counts = [
            np.bincount(taxel_of(events[events["p"] == polarity], CONFIG), minlength=12)
            for events in (found, clean.events)
        ]
        np.testing.assert_array_equal(*counts)
    # An offset shifts the thresholds, so the number of crossings hardly changes; noise makes crossings of its own.
    offset, noise = (
        compare(CONFIG, signals, *levels, np.random.default_rng(0)) for levels in ((0.0, 0.005), (0.03, 0.0))
    )
    assert 0.8 < len(offset) / len(found) < 1.2
    assert len(noise) > 1.2 * len(found)
    with pytest.raises(InputError, match="are only modelled for lcs, not for nlcs"):
        compare(CONFIG.replace(encoding="nlcs"), signals, 0.0, 0.0, np.random.default_rng(0))


@pytest.mark.parametrize(("pole", "alike"), [(None, 0.0), (0.01, np.exp(-2 * np.pi * 0.01))])
def test_noise_behind_a_pole_has_the_rms_that_was_asked_for_and_forgets_at_its_pace(pole, alike) -> None:
    noise = noisy(np.zeros((50_000, 6)), 0.02, np.random.default_rng(0), pole)
    assert noise.std() == pytest.approx(0.02, rel=0.02)
    assert noise[:50].std() == pytest.approx(0.02, rel=0.4)  # from the start
    assert np.mean(noise[1:] * noise[:-1]) / 0.02**2 == pytest.approx(alike, abs=0.02)
    assert np.mean(noise[:, 1:] * noise[:, :-1]) / 0.02**2 == pytest.approx(0, abs=0.05)  # taxels apart


def test_training_scans_are_disturbed_within_their_ranges_and_the_first_is_clean(clean: Recording) -> None:
    generator = np.random.default_rng(1)
    drawn = [draw_strengths(generator) for _ in range(300)]
    for name, (probability, low, high) in TRAINING.items():
        values = [strengths[name] for strengths in drawn if name in strengths]
        assert abs(len(values) / 300 - probability) < 0.1
        assert low <= min(values) <= max(values) <= high
    assert {strengths.get("direction") for strengths in drawn} == {None, 0.0, 90.0, 180.0, 270.0}
    dataset = open_dataset("embedded")
    few = type(dataset)(dataset.name, dataset.class_names, tuple(dataset)[:2])
    data = disturbed_dataset(few, SCAN, CONFIG, BinConfig(), 2)
    assert data.images.tolist() == [0, 0, 0, 1, 1, 1]
    assert int(data.values[0].sum()) >= 0.95 * len(clean.events)
    assert len({scan.tobytes() for scan in data.values}) == 6


def test_training_scans_are_disturbed_only_where_they_can_be(refuses: Any) -> None:
    for line, message in (
        ("train --disturbed 2 --preset paper", "disturbed scans need events and the physical preset"),
        ("train --disturbed 2 --start-rows 3", "disturbed must be at least 1 with start-rows 1"),
    ):
        refuses(f"error: {message}", line)


@pytest.mark.parametrize(
    ("name", "strength", "message"),
    [("colour", 0.1, "disturbances are speed, height,"), ("noise", -1.0, "must be a number from 0, not -1.0")],
)
def test_unknown_disturbances_and_strengths_are_refused(
    texture: Texture, name: str, strength: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        disturbed(texture, **{name: strength})
