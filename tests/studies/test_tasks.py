"""Test the generated tasks of the INTUITIVE chip: physics of the recordings, and data and figure of the study."""

from pathlib import Path

import numpy as np
import pytest

from eskin.skin.recordings.folder import sources_of
from studies import tasks
from studies.study import ROOT
from studies.tasks import KINDS, recording


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """Remove noise, unsteadiness and the spread within a class."""
    for name in ("NOISE", "UNSTEADY_MM", "TUNING", "UNEVEN"):
        monkeypatch.setattr(tasks, name, 0.0)


@pytest.mark.quick
@pytest.mark.usefixtures("steady")
def test_a_vibration_has_the_frequency_of_its_class() -> None:
    kind = KINDS["flutter"]
    for label, hz in enumerate(kind.classes):
        signal = recording(kind, 0, label, False).reshape(200, 12)[:, 0]
        spectrum = np.abs(np.fft.rfft(signal * np.hanning(200), 8000))
        assert np.fft.rfftfreq(8000, 1 / 500)[spectrum.argmax()] == pytest.approx(hz, abs=0.5)


@pytest.mark.quick
@pytest.mark.usefixtures("steady")
def test_presses_have_period_and_depth_of_their_recording() -> None:
    time_s = np.arange(4000) / 1000
    for period_ms in KINDS["indentation"].classes:
        depth = tasks.presses(np.random.default_rng(3), period_ms, time_s)
        assert depth.max() == pytest.approx(0.05 * 10 ** np.random.default_rng(3).uniform())  # 0.05 to 0.5 mm
        begins = np.flatnonzero((depth[:-1] < depth.max() / 2) & (depth[1:] >= depth.max() / 2))
        assert np.diff(begins) == pytest.approx(period_ms, abs=1.5)
        assert 0.35 < (depth > depth.max() / 2)[begins[0] : begins[-1]].mean() < 0.85


@pytest.mark.quick
def test_training_and_test_differ_and_users_can_read_them(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "LEARNED", 1)
    monkeypatch.setattr(tasks, "TESTED", 1)
    place = tasks.write_recordings(KINDS["flutter"], folder)
    assert len(sources_of(place)[0]) == 12
    learned, tested = (np.load(place / "0020Hz" / f"{part}_00.npy") for part in ("learn", "test"))
    assert learned.shape == tested.shape == (200, 3, 4)
    assert np.abs(learned).max() <= 1
    assert not np.allclose(learned, tested)


def test_the_figure_is_drawn_from_stored_data(folder: Path) -> None:
    (folder / "data").symlink_to(ROOT / "docs" / "data")
    (figure,) = tasks.RESULT.make("tasks", folder)
    assert figure.stat().st_size > 20_000
