"""Test event counts from event files: equal for RTL and model; invalid files are rejected."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.model.address_events import make_events, no_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.augment import AugmentConfig, at_speed, augment
from eskin.snn.data.bins import MAX_COUNTS, BinConfig, bin_recording
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import frame_dataset, values_of
from eskin.snn.data.record import record, record_dataset
from eskin.snn.data.scans import collect, load_recordings
from eskin.snn.experiments.experiment import Experiment
from tests.snn.helpers import few_textures

CONFIG = ReadoutConfig(rows=2, columns=3, resolution=4, sample_rate_hz=1000.0, clocks_per_sample=10)
"""A clock of 10 kHz: a bin of 1 ms is ten clocks."""


def recording(t: list[int], taxel: list[int], p: list[bool], clocks: int = 100, **metadata: object) -> Recording:
    rows, columns = np.divmod(np.array(taxel, int), CONFIG.columns)
    events = make_events(t, rows, columns, p) if t else no_events()
    return Recording(events, CONFIG, clocks, metadata={"class": "sand", "name": "a", **metadata})


def test_the_time_window_cuts_and_a_partial_last_bin_is_left_out() -> None:
    made = recording([5, 25, 44, 95], [0, 0, 0, 0], [True] * 4)
    counts = bin_recording(made, BinConfig(bin_s=1e-3, start_s=2e-3, stop_s=4.5e-3))
    assert counts[:, 0].tolist() == [1, 0]
    counts = bin_recording(made, BinConfig(bin_s=3e-3))
    assert counts[:, 0].tolist() == [2, 1, 0]


def test_tensors_of_rtl_event_files_and_of_the_model_are_equal(tmp_path: Path) -> None:
    data = embedded_dataset().limit(4)
    config = ReadoutConfig(rows=2, columns=2, resolution=4)
    for texture in data:
        path = tmp_path / f"{texture.name}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        record(texture, data.name, PhysicalScan(), config).save(path)
    loaded = load_recordings(tmp_path, BinConfig(), data.class_names)
    made = record_dataset(data, PhysicalScan(), config, BinConfig())
    assert loaded.names == made.names
    assert np.array_equal(loaded.values, made.values)
    assert np.array_equal(loaded.labels, made.labels)
    assert np.array_equal(loaded.batch([0, 3]).numpy(), made.batch([0, 3]).numpy())
    assert made.values.sum() > 1000
    assert loaded.rate_hz == made.rate_hz > 0


def test_start_rows_are_scans_of_one_image_and_only_the_first_is_tested() -> None:
    data = embedded_dataset().limit(3)
    config = ReadoutConfig(rows=2, columns=2, resolution=4)
    scans = record_dataset(data, PhysicalScan(), config, BinConfig(), [0.0, 20.0])
    assert scans.images.tolist() == [0, 0, 1, 1, 2, 2]
    assert scans.scans_of([2, 0]).tolist() == [0, 1, 4, 5]
    assert scans.first_scans([2, 0]).tolist() == [4, 0]
    assert not np.array_equal(scans.values[0], scans.values[1])
    assert scans.image_labels.tolist() == data.labels.tolist()


def test_variants_are_of_the_same_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    few_textures(monkeypatch)
    small = ReadoutConfig(rows=2, columns=2, resolution=4)
    fields: dict[str, Any] = {"dataset": "embedded"}
    whole, on = (Experiment(**fields, readout=small, variant=kind).data() for kind in ("", "on"))
    assert np.array_equal(on.values, whole.values[:, :, :4])
    assert 0.3 < on.rate_hz / whole.rate_hz < 0.7
    later = Experiment(**fields, readout=small, bins=BinConfig(start_s=0.02)).data()
    assert np.array_equal(later.values, whole.values[:, 5:])
    assert 0.6 < later.rate_hz / whole.rate_hz < 0.95
    leaky = small.replace(encoding="nlcs")
    one, both = (Experiment(**fields, readout=r).data() for r in (leaky, small.replace(encoding="nlcs-bipolar")))
    assert (one.channels, both.channels) == (4, 8)
    assert both.values[:, :, 4:].sum() > 0.5 * both.values[:, :, :4].sum() > 100
    with pytest.raises(InputError, match="nlcs has only ON events; leave the variant out"):
        Experiment(readout=leaky, variant="on")
    with pytest.raises(InputError, match="variants need events of the model without disturbances"):
        Experiment(readout=small, variant="on", disturbed=1)


def test_frames_come_from_the_same_scans() -> None:
    data = embedded_dataset().limit(2)
    config = ReadoutConfig(rows=2, columns=2)
    frames = frame_dataset(data, PhysicalScan(), config, FrameSteps(frames_per_step=5))
    assert frames.channels == 4 * 5
    assert frames.step_s == pytest.approx(1e-3)
    sampled = config.replace(sample_rate_hz=5000.0, sample_bits=10)
    codes, _ = PhysicalScan().samples(sampled, data[1].load())
    expected = codes[: frames.steps * 5].reshape(frames.steps, 20) / 512
    assert np.array_equal(frames.values[1], expected.astype(np.float32))
    differences = frame_dataset(data, PhysicalScan(), config, FrameSteps.parse("frame-diff:250:8", 0.004))
    assert not differences.frames, "what a shift in time brings in is 0, not the difference at the edge again"


def test_the_name_of_frames_says_rate_bits_and_what_the_receiver_makes_of_them() -> None:
    for name, together, step_s in (
        ("frame:5000:10", 20, 0.004),
        ("frame-diff:250:8", 1, 0.004),
        ("frame-diff:62.5:8", 1, 0.016),
        ("frame-onoff:1000:6:3", 4, 0.004),
    ):
        frames = FrameSteps.parse(name, 0.004)
        assert (frames.name, frames.frames_per_step, frames.step_s) == (name, together, step_s)
    for name in ("frame-onoff:250:8:4", "frame-onoff:250:8"):
        assert FrameSteps.parse(name, 0.004).name == "frame-onoff:250:8"
    for name in ("frame:250:8:4", "frame:250", "frames:250:8", "frame-onoff:250:8:4:2"):
        with pytest.raises(InputError, match=r"frames need KIND:RATE:BITS"):
            FrameSteps.parse(name, 0.004)
    assert FrameSteps(rate_hz=5000.0, bits=10, frames_per_step=20) == FrameSteps(), "as older files have it"
    for bad in (True, 2.0, "3", 0):
        with pytest.raises(InputError, match="frames_per_step must be at least 1, not"):
            FrameSteps(frames_per_step=bad)


def test_differences_and_crossings_by_hand() -> None:
    codes = np.array([[0, 8], [3, 8], [5, -9], [5, -8]], np.int32)
    differences = FrameSteps(rate_hz=250.0, bits=5, frames_per_step=2, kind="frame-diff")
    assert values_of(differences, codes).tolist() == [[0, 0, 3, 0], [2, -17, 0, 1]]
    crossings = FrameSteps(rate_hz=250.0, bits=5, frames_per_step=1, kind="frame-onoff", level_bits=2)  # 4 codes
    assert values_of(crossings, codes).tolist() == [[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 4], [0, 0, 0, 0]]
    together = dataclasses.replace(crossings, frames_per_step=4)
    assert values_of(together, codes).tolist() == [[1, 0, 0, 4]], "counts of a step are added up"
    samples = FrameSteps(rate_hz=250.0, bits=5, frames_per_step=3)
    assert values_of(samples, codes).tolist() == [[0, 0.5, 3 / 16, 0.5, 5 / 16, -9 / 16]], (
        "what fills no step is left out"
    )


def test_scans_at_other_speeds_keep_their_events() -> None:
    counts = torch.poisson(torch.full((40, 6, 4), 1.3), generator=torch.Generator().manual_seed(0))
    assert torch.equal(at_speed(counts, torch.ones(6)), counts)
    faster = at_speed(counts, torch.full((6,), 2.0))
    assert torch.equal(faster[:20], counts[0::2] + counts[1::2]), "twice as fast: two bins in one"
    assert not faster[20:].any(), "and over in half the time"
    slower = at_speed(counts, torch.full((6,), 0.5))
    assert torch.equal(slower[0::2] + slower[1::2], counts[:20]), "half as fast: a bin in two"
    lone = torch.zeros(40, 6, 4)
    lone[10] = 1.0
    moved = at_speed(lone, torch.tensor([0.98, 0.999, 1.0, 1.001, 1.02, 1.1])).argmax(0)[:, 0]
    assert moved.tolist() == [int(10.5 / v) for v in (0.98, 0.999, 1.0, 1.001, 1.02, 1.1)], "from the middle of its bin"
    mixed = at_speed(counts, torch.tensor([0.7, 0.9, 1.0, 1.1, 1.3, 1.9]))
    assert torch.equal(mixed, mixed.round().clamp_min(0)), "whole numbers"
    assert torch.equal(mixed[:, 3:].sum(0), counts[:, 3:].sum(0)), "no event of a faster scan is lost"


def test_frames_that_enter_repeat_the_edge() -> None:
    frames = torch.arange(40.0)[:, None, None].expand(40, 8, 4)
    shifted = augment(frames, 4, AugmentConfig(shift_steps=5), np.random.default_rng(0), frames=True)
    shifts = np.random.default_rng(0).integers(-5, 6, 8)
    for scan, shift in enumerate(shifts):
        assert shifted[:, scan, 0].tolist() == np.clip(np.arange(40) - shift, 0, 39).tolist()


def test_the_speed_of_every_scan_is_drawn_anew() -> None:
    counts = torch.poisson(torch.full((40, 6, 4), 1.3), generator=torch.Generator().manual_seed(0))
    config = AugmentConfig(speed_spread=0.2)
    once = augment(counts, 4, config, np.random.default_rng(0))
    assert torch.equal(once, augment(counts, 4, config, np.random.default_rng(0)))
    assert not torch.equal(once, augment(counts, 4, config, np.random.default_rng(1)))
    speeds = torch.from_numpy(np.random.default_rng(0).uniform(0.8, 1.2, 6)).float()
    assert torch.equal(once, at_speed(counts, speeds))
    with pytest.raises(InputError, match="speed_spread must be from 0"):
        AugmentConfig(speed_spread=1.0)


def test_augmentation_shifts_and_silences_whole_scans() -> None:
    batch = torch.arange(1.0, 6.0)[:, None, None].expand(5, 40, 8).contiguous()
    shifted = augment(batch, 4, AugmentConfig(shift_steps=2), np.random.default_rng(0))
    seen = {tuple(shifted[:, scan, 0].tolist()) for scan in range(40)}
    assert seen == {(1, 2, 3, 4, 5), (0, 1, 2, 3, 4), (0, 0, 1, 2, 3), (2, 3, 4, 5, 0), (3, 4, 5, 0, 0)}
    dropped = augment(batch, 4, AugmentConfig(drop_taxels=0.5), np.random.default_rng(0))
    silent = (dropped == 0).all(0)
    assert torch.equal(silent[:, :4], silent[:, 4:])  # ON and OFF of a taxel together
    assert 0.3 < silent.float().mean() < 0.7
    again = augment(batch, 4, AugmentConfig(drop_taxels=0.5), np.random.default_rng(0))
    assert torch.equal(again, dropped)
    assert torch.equal(augment(batch, 4, AugmentConfig(), np.random.default_rng(0)), batch)


def refused(recordings: list[Recording], bins: BinConfig, classes: list[str] | None = None) -> str:
    with pytest.raises(InputError) as error:
        collect(recordings, bins, classes)
    return str(error.value)


def test_bad_recordings_are_refused_in_one_sentence(tmp_path: Path) -> None:
    good, bins = recording([1], [0], [True]), BinConfig(bin_s=1e-3)
    silent = collect([recording([], [], [])], bins)  # no touch is an input too
    assert not silent.values.any()
    assert refused([good], bins, ["rice"]) == "a has the unknown class 'sand'; known classes are rice"
    other = Recording(no_events(), CONFIG.replace(rows=1), 100, metadata={"class": "sand", "name": "b"})
    assert refused([good, other], bins) == "b has 3 taxels, a has 6; train on recordings of one array"
    other = Recording(no_events(), CONFIG.replace(resolution=5), 100, metadata={"class": "sand", "name": "b"})
    assert refused([good, other], bins) == "b has another readout configuration than a; keep them apart"
    assert refused([good], BinConfig(bin_s=1.0)) == (
        "a lasts 0.01 s and contains no complete bin of 1 s in the time window; choose a shorter bin or another window"
    )
    assert len(bin_recording(good, BinConfig(bin_s=good.duration_s))) == 1
    long = recording([1], [0], [True], clocks=MAX_COUNTS // 12 + 1)
    assert f"more than {MAX_COUNTS} counts; choose a longer bin" in refused([long], BinConfig(bin_s=1e-4))
    with pytest.raises(InputError, match="holds no event files"):
        load_recordings(tmp_path, bins)
    with pytest.raises(InputError, match="does not exist"):
        load_recordings(tmp_path / "none", bins)
    Recording(good.events, CONFIG, 100).save(tmp_path / "a.npz")
    with pytest.raises(InputError, match="has no class"):
        load_recordings(tmp_path, bins)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"bin_s": 0.0}, "bin_s must be a positive number of seconds, not 0.0"),
        ({"start_s": -1.0}, "start_s must be a number of seconds from 0, not -1.0"),
        ({"start_s": 0.2, "stop_s": 0.1}, "stop_s must be later than start_s, not 0.1 after 0.2"),
    ],
)
def test_bad_bins_are_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        BinConfig(**fields)
    assert str(error.value) == message
