"""Test that training, prediction, chip and board apply the scales of the training to recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.board.demo import show_of
from eskin.board.stimulus import codes_to_play
from eskin.cocotb_tests.runner.reproduce import own_options
from eskin.cocotb_tests.touch.plan import plan
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.statistics import signals_of
from eskin.skin.recordings.trained_on import OwnReadout
from tests.skins import write_uneven

SMALL = "--folds 2 --epochs 10 --set hidden=8 --set batch=4"


def rest_of(path: Path) -> np.ndarray[Any, Any]:
    """Return a table without time stamps and without the first value of each taxel."""
    values = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:]
    return values - values[0]


def test_every_command_applies_the_scale_of_each_taxel(folder: Path, call: Any) -> None:
    write_uneven(folder / "skin", each=6)
    write_uneven(folder / "new", each=1, amplitude=0.5, first=20)  # which scales of their own would hide
    code, out, error = call("train --data skin", SMALL)
    assert code == 0, error
    said = json.loads(Path("out/train/result.json").read_text())["recordings"]
    scale = np.array(said["scale"])
    assert 0.8e-3 < scale[0] * 1e3 < 1.2e-3 < 0.8 < scale[1] * 1e3 < 1.2
    assert f"\nreadout: {said['readout']['encoding']} {said['readout']['resolution']} b, scale per taxel, " in out

    def expected(path: Path) -> np.ndarray[Any, Any]:
        return np.clip(np.rint(rest_of(path) * scale * 2048), -2048, 2047)

    learned, _ = signals_of(next(Path("out/recordings").glob("skin-*")))
    assert len(learned) == 12
    assert all(np.array_equal(codes, expected(Path(f"skin/{name}.csv"))) for name, codes in learned.items())
    assert call("quantise")[0] == 0
    assert call("predict out/train/weights.npz --data new")[0] == 0
    events = next(Path("out/recordings").glob("new-*"))
    assert {tuple(Recording.load(path).metadata["scale"]) for path in events.glob("*/*.npz")} == {tuple(scale)}
    whole, wanted = (
        Path("out/train/whole.npz"),
        {name: expected(Path(f"new/{name}.csv")) for name in signals_of(events)[0]},
    )
    chip = plan(whole, Path("new"), "", None, None, Path("out/touch"))
    show = show_of(Path("new"), whole)
    assert sorted(chip.names) == sorted(show.names) == sorted(wanted) == ["fast/20", "slow/20"]
    for name, codes in wanted.items():
        assert 500 < np.abs(codes).max() < 1500
        network = IntegerWeights.load(whole)
        played = codes_to_play(network, chip.networks[name].chip.readout, recordings=Path("new"), only=name)
        for found in (signals_of(events)[0][name], chip.image(name), show.load(name)[0], played[1]):
            assert np.array_equal(found, codes)
    code, out, error = call("train --data skin --scale max", SMALL, "-o common")
    assert code == 0, error
    common = json.loads(Path("common/result.json").read_text())["recordings"]["scale"]
    assert common == pytest.approx(scale.min())
    assert f" b, scale {common:.4g}\n" in out


@pytest.mark.parametrize("scale", [0.5, [0.5, 2.0], [-0.25, 1e-9, 3.0]])
def test_a_stored_scale_is_that_of_the_training(scale: Any) -> None:
    said = {"readout": ReadoutConfig().to_dict(), "prepared": {"baseline": "first"}, "scale": scale}
    assert OwnReadout.from_dict(said).to_dict() == said


@pytest.mark.parametrize("scale", [[], ["x"], [[1.0]], [0.0, 1.0], [1.0, float("nan")], None, "max", "1,2"])
def test_a_damaged_scale_is_refused(scale: Any) -> None:
    said = {"readout": ReadoutConfig().to_dict(), "prepared": {}, "scale": scale}
    with pytest.raises(InputError, match="the stored preparation, scale and readout are damaged"):
        OwnReadout.from_dict(said)


def test_a_scale_per_taxel_can_be_given(folder: Path, call: Any) -> None:
    write_uneven(folder / "skin", each=1)
    code, out, error = call("encode skin -o events --scale per-taxel")
    assert code == 0, error
    assert "scale per taxel, " in out
    scale = Recording.load(Path("events/fast/0.npz")).metadata["scale"]
    (option,) = own_options(Preparation(), tuple(scale))
    assert option == f"--scale={scale[0]!r},{scale[1]!r}"
    assert call("encode skin -o again", option)[0] == 0
    for kind in ("fast", "slow"):
        events = [Recording.load(Path(place) / kind / "0.npz").events for place in ("events", "again")]
        assert len(events[0]) > 50
        assert np.array_equal(*events)
    code, out, error = call(f"encode skin/fast/0.csv -o one.npz --baseline first {option}")
    assert code == 0, error
    assert "scale per taxel, " in out
    assert Recording.load(Path("one.npz")).metadata["scale"] == scale


def test_factors_for_other_taxels_are_refused(folder: Path) -> None:
    write_uneven(folder / "skin", each=1)
    with pytest.raises(InputError, match=r"0\.csv has 2 taxels, but the scale has 3 factors; choose the same taxels"):
        read_set(Path("skin"), Preparation(scale="1,2,3"), ReadoutConfig())
