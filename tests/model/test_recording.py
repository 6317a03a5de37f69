"""Test recording files: round trip, and rejection of damaged and foreign files."""

import json
import random
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.model.address_events import EVENT_DTYPE, Events, make_events, no_events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.events.recording import MAX_CLOCKS, Recording
from tests.model.refused import refused

CONFIG = ReadoutConfig(rows=3, columns=5)


def sample_events() -> Events:
    return make_events([3, 9, 9, 12, 90], [0, 1, 2, 2, 0], [1, 4, 0, 4, 1], [True, False, True, True, False])


def sample_recording() -> Recording:
    return Recording(sample_events(), CONFIG, 100, metadata={"name": "grass", "label": 2})


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    config = ReadoutConfig(
        rows=draw(st.integers(1, 64)),
        columns=draw(st.integers(1, 64)),
        encoding=draw(st.sampled_from(registry.NAMES)),
        sample_rate_hz=draw(st.floats(1e-3, 1e9)),
    )
    duration = draw(st.integers(1, MAX_CLOCKS))
    t = sorted(draw(st.lists(st.integers(0, duration - 1), max_size=40)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n = len(t)
    on = rng.integers(0, 2, n).astype(bool) if config.has_polarity else np.ones(n, bool)
    events = make_events(t, rng.integers(0, config.rows, n), rng.integers(0, config.columns, n), on)
    leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    metadata = draw(st.dictionaries(st.text(), leaves | st.text() | st.lists(leaves, max_size=3), max_size=4))
    return Recording(events, config, duration, metadata=metadata)


# -- in memory ---------------------------------------------------------------------------------------


def test_make_events_puts_columns_into_x_and_rows_into_y() -> None:
    events = make_events([7], row=2, column=4, polarity=False)
    assert events.tolist() == [(7, 4, 2, False)]
    assert make_events([1, 2], 0, [3, 4]).tolist() == [(1, 3, 0, True), (2, 4, 0, True)]
    assert no_events().dtype == EVENT_DTYPE
    assert len(no_events()) == 0


def test_rates_follow_from_duration() -> None:
    config = ReadoutConfig(sample_rate_hz=1000, clocks_per_sample=10)
    recording = Recording(make_events([0, 1, 2], 0, 0), config, 5000)
    assert recording.clock_hz == 10_000
    assert recording.duration_s == 0.5
    assert recording.rate_hz == 6.0
    assert Recording(no_events(), config, 0).rate_hz == 0.0


def test_events_of_a_recording_are_a_read_only_copy() -> None:
    events = sample_events()
    recording = Recording(events, CONFIG, 100)
    events["t"] = 0
    assert recording.events["t"].tolist() == [3, 9, 9, 12, 90]
    with pytest.raises(ValueError, match="read-only"):
        recording.events["t"][0] = 1


NO_ARRAY = "events must be a one-dimensional array with the fields t, x, y, p, not"
BAD_EVENTS: list[tuple[Any, str, int, str]] = [
    ([(0, 0, 0, True)], "lcs", 9, f"{NO_ARRAY} list"),
    (np.zeros((2, 2), EVENT_DTYPE), "lcs", 9, f"{NO_ARRAY} shape (2, 2) of {EVENT_DTYPE}"),
    (make_events([9], 0, 0), "lcs", 9, "event 0 has t = 9, outside 0..8 (the duration in clocks)"),
    (make_events([-1], 0, 0), "lcs", 9, "event 0 has t = -1, outside 0..8 (the duration in clocks)"),
    (make_events([1, 2], 0, [0, 5]), "lcs", 9, "event 1 has x = 5, outside 0..4 (columns)"),
    (make_events([1, 2], [0, -1], 0), "lcs", 9, "event 1 has y = -1, outside 0..2 (rows)"),
    (make_events([4, 3], 0, 0), "lcs", 9, "event 1 is earlier than the event before it"),
    (make_events([1, 2], 0, 0, [True, False]), "nlcs", 9, "event 1 is OFF, which encoding nlcs never sends"),
    (no_events(), "lcs", -1, "duration_clocks must not be negative, not -1"),
]


@pytest.mark.parametrize(("events", "encoding", "duration", "sentence"), BAD_EVENTS, ids=lambda v: str(v)[:30])
def test_refuses_events_that_do_not_fit(events: Any, encoding: Any, duration: int, sentence: str) -> None:
    with refused(sentence):
        Recording(events, CONFIG.replace(encoding=encoding), duration)


def test_refuses_a_polarity_byte_that_is_no_boolean() -> None:
    events = sample_events()
    events["p"].view(np.uint8)[2] = 7
    with refused("event 2 has a polarity that is neither 0 nor 1"):
        Recording(events, CONFIG, 100)


# -- on disk -----------------------------------------------------------------------------------------


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(recording=recordings())
def test_a_saved_recording_is_loaded_unchanged(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "events.npz"
    recording.save(path)
    again = Recording.load(path)
    assert again == recording
    assert again.events.dtype == EVENT_DTYPE
    first = path.read_bytes()
    again.save(path)
    assert path.read_bytes() == first


def test_numpy_alone_can_read_it_and_no_date_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "events.npz"
    sample_recording().save(path)
    with np.load(path, allow_pickle=False) as file:
        assert np.array_equal(file["events"], sample_events())
        header = json.loads(str(file["metadata"]))
    assert header["format"] == "spiking-eskin-readout events"
    assert header["format_version"] == 1
    assert header["clock_hz"] == CONFIG.clock_hz
    assert header["duration_clocks"] == 100
    assert header["config"] == CONFIG.to_dict()
    assert header["metadata"] == {"name": "grass", "label": 2}
    with zipfile.ZipFile(path) as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_writes_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "events.npz"
    path.write_bytes(b"old")

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(zipfile.ZipFile, "writestr", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sample_recording().save(path)
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["events.npz"]
    sample_recording().save(path)
    assert Recording.load(path) == sample_recording()
    assert [file.name for file in tmp_path.iterdir()] == ["events.npz"]


def test_refuses_another_suffix(tmp_path: Path) -> None:
    with refused("event files end in .npz, events.csv does not; rename the output"):
        sample_recording().save(tmp_path / "events.csv")


@pytest.mark.parametrize("value", [float("nan"), {1, 2}, np.int64(3)])
def test_refuses_metadata_that_are_not_json(value: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^the metadata of a recording must be plain JSON values: "):
        Recording(no_events(), CONFIG, 1, metadata={"x": value}).save(tmp_path / "events.npz")
    assert not list(tmp_path.iterdir())


# -- damaged and foreign files -----------------------------------------------------------------------


def header_with(**changes: Any) -> dict[str, Any]:
    return sample_recording()._header() | changes


WIDE = np.dtype([("t", "<i8"), ("x", "<i8"), ("y", "<i8"), ("p", "?")])
FOREIGN: list[tuple[Any, Any, str]] = [
    (EVENT_DTYPE, header_with(format_version=2), "it has format version 2; this program reads version 1"),
    (EVENT_DTYPE, header_with(format="other"), "its format is not 'spiking-eskin-readout events'"),
    (EVENT_DTYPE, "[" * 100_000, "its metadata are not JSON"),
    (EVENT_DTYPE, header_with(duration_clocks=True), "its metadata lack a valid duration_clocks"),
    (EVENT_DTYPE, header_with(config=None), "its metadata lack a valid config"),
    (EVENT_DTYPE, header_with(clock_hz=5.0), "its clock_hz 5 differs from its configuration"),
    (EVENT_DTYPE, header_with(config=CONFIG.to_dict() | {"rows": 2}), "event 2 has y = 2, outside 0..1 (rows)"),
    (WIDE, header_with(), f"{NO_ARRAY} shape (5,) of {WIDE}"),
]


@pytest.mark.parametrize(("dtype", "header", "reason"), FOREIGN, ids=lambda v: str(v)[:40])
def test_refuses_what_is_not_its_own(dtype: Any, header: Any, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "events.npz"
    text = header if isinstance(header, str) else json.dumps(header)
    np.savez(path, events=sample_events().astype(dtype), metadata=np.array(text))
    with refused(f"{path} is not a valid event file: {reason}; record it again"):
        Recording.load(path)


def test_refuses_other_archives_and_other_files(tmp_path: Path) -> None:
    path = tmp_path / "events.npz"
    archive = f"{path} is an archive, but not an event file; make one with eskin encode"
    damaged = f"{path} is damaged or not an event file; record it again with eskin encode"
    np.savez(path, samples=np.zeros(3))
    with refused(archive):
        Recording.load(path)
    np.savez(path, events=sample_events(), metadata=np.zeros(3))
    with refused(archive):
        Recording.load(path)
    np.savez(path, events=np.array([{}, 3], dtype=object), metadata=np.array("{}"))  # pickled
    with refused(damaged):
        Recording.load(path)
    for content in (b"", b"PK", b"\x93NUMPY", b"t,x,y,p\n1,2,3,4\n", random.Random(0).randbytes(500)):
        path.write_bytes(content)
        with refused(damaged):
            Recording.load(path)
    other = path.rename(tmp_path / "events.AEDAT4")
    with refused(f"{other} is not an event file; convert events of another program with eskin convert"):
        Recording.load(other)
    with refused(f"cannot read {path}: No such file or directory"):
        Recording.load(path)
    path.mkdir()
    with refused(f"cannot read {path}: Is a directory"):
        Recording.load(path)


def test_any_truncation_and_any_flipped_bit_is_refused_or_harmless(tmp_path: Path) -> None:
    path = tmp_path / "events.npz"
    original = sample_recording()
    original.save(path)
    data = path.read_bytes()
    flips = random.Random(0).sample(range(8 * len(data)), 300)
    damaged = [data[:length] for length in range(0, len(data), 9)]
    short = len(damaged)
    for bit in flips:
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        damaged.append(bytes(changed))
    refused = []
    for content in damaged:
        path.write_bytes(content)
        try:
            assert Recording.load(path) == original
        except InputError as error:
            refused.append(str(error))
    assert all(str(path) in sentence for sentence in refused)
    assert len(refused) > short  # every truncation at least
