"""Test the choice of encoder, resolution and scale by the classes of the training recordings."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.commands.signals.recordings import events_of
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.folder import RecordingSet, read_set, sources_of
from eskin.skin.recordings.options import Preparation
from eskin.snn import encoder_choice
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import load_recordings
from eskin.snn.encoder_choice import BASELINES, EncoderChoice, _parts, _scans
from eskin.snn.experiments.single import Fold
from tests.skins import counts, write_csv, write_skin, write_uneven

FIRST = Preparation(baseline="first")


pytestmark = pytest.mark.usefixtures("shorter")


def chosen(fit: EncoderChoice, place: Path = Path("skin"), **given: Any) -> RecordingSet:
    return read_set(place, FIRST, ReadoutConfig(**{"resolution": 4} | given), {*given, "baseline"}, fit=fit)


def test_it_learns_from_the_training_recordings_of_the_fold_alone(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=5)
    data = load_recordings(events_of(Path("skin"), {}, ReadoutConfig(), ()), BinConfig())
    sources, _ = sources_of(Path("skin"))
    names = [source.name for source in sources]
    for test, fold in ((None, Fold.choose(data, 1, 5)), ("*/[02]", Fold.named(data, "*/[02]"))):
        fit = EncoderChoice(fold=1, folds=5, test=test)
        learned = fit.learned(names, [str(source.class_name) for source in sources], names)
        assert [names[number] for number in learned] == [data.names[image] for image in fold.images]
    before = chosen(fit)
    for image in fold.test:  # ten times as loud
        kind, number = data.names[image].split("/")
        write_csv(Path("skin") / f"{kind}/{number}.csv", counts(kind, taxels=4, seed=99) * 10)
    after = chosen(fit)
    assert (after.scores, after.scale) == (before.scores, before.scale)
    assert after.clipped > 0


def test_a_class_that_is_in_the_level_keeps_the_level(folder: Path) -> None:
    random = np.random.default_rng(0)
    for kind, level in (("light", 100), ("firm", 180)):
        for number in range(8):
            values = np.array([900, 300]) + level + random.normal(0, 4, (120, 2))
            write_csv(folder / f"skin/{kind}/{number}.csv", values)
    found = read_set(Path("skin"), FIRST, ReadoutConfig(resolution=4), (), fit=EncoderChoice(folds=4))
    assert found.options.baseline == "fixed", found.scores
    losses = {name: min(one["log_loss"] for one in found.scores if one["baseline"] == name) for name in BASELINES}
    assert losses["fixed"] < losses["median"] / 2, "without the level, a network guesses"
    last = [one for one in found.scores if one["updates"] == encoder_choice.UPDATES[-1]]
    assert max(one["right"] for one in last) == last[0]["of"]
    again = read_set(Path("skin"), FIRST, ReadoutConfig(resolution=4), (), fit=EncoderChoice(folds=4))
    assert again.scores == found.scores


def test_recordings_of_a_group_are_in_one_part() -> None:
    labels, groups = np.repeat([0, 1], 6), ["a", "a", "b", "b", "c", "c"] * 2
    for part in _parts(labels, groups):
        assert len({groups[n] for n in part}) == 1
        assert len(part) == 4
    assert len(_parts(labels, list("aaaaaabbbbbb"))) == 5, "a class with one group ignores groups"


def test_a_group_is_in_the_name(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=2)
    found = read_set(Path("skin"), Preparation(group_name="[0-9]$"), ReadoutConfig())
    assert [source.group for source in found.sources] == ["0", "1"] * 3
    with pytest.raises(InputError, match="--group-name 'xy' does not match press/0"):
        read_set(Path("skin"), Preparation(group_name="xy"), ReadoutConfig())
    with pytest.raises(InputError, match=r"--group-name needs a regular expression, not '\('"):
        Preparation(group_name="(")


def test_taxels_of_very_different_ranges_have_a_scale_each(folder: Path) -> None:
    write_uneven(folder / "skin", each=6)
    fit = EncoderChoice(folds=3)
    found = chosen(fit)
    assert found.options.scale == "per-taxel"
    assert any(", baseline first, a scale per taxel, " in note for note in found.notes)
    names = [source.name for source in found.sources]
    learned = fit.learned(names, [str(one.class_name) for one in found.sources], names)
    rest = [np.loadtxt(source.path, delimiter=",", skiprows=1)[:, 1:] for source in found.sources]
    rest = [signal - signal[0] for signal in rest]
    tops = np.abs(np.concatenate([rest[number] for number in learned])).max(0)
    assert found.scale == pytest.approx(2047 / 2048 / tops)
    for codes, signal in zip(found.codes, rest, strict=True):
        assert np.array_equal(codes, np.clip(np.rint(signal * found.scale * 2048), -2048, 2047))
    common = read_set(Path("skin"), FIRST, ReadoutConfig(), {"scale", "baseline"}, fit=fit)  # as with --scale max
    assert common.scale == pytest.approx(2047 / 2048 / tops.max())
    assert any("; --encoding, --resolution, --baseline and --scale choose others" in note for note in common.notes)
    both = chosen(fit, encoding="lcs", resolution=4)
    assert isinstance(both.scale, float), "nothing is compared"


def test_a_taxel_that_never_moves_in_training_has_the_smallest_of_the_scales(folder: Path) -> None:
    for number in range(2):
        values = np.stack([np.arange(100) * 5, np.arange(100) % 7, np.full(100, 3)], axis=1)
        write_csv(folder / f"skin/a/{number}.csv", values)
    found = read_set(Path("skin/a/0.csv"), Preparation(baseline="first", scale="per-taxel"), ReadoutConfig())
    assert found.scale == pytest.approx(2047 / 2048 / np.array([495, 6, 495]))


def test_short_trainings_see_the_bins_of_the_real_ones(folder: Path) -> None:
    time_s = np.arange(600) / 1000
    for kind, hz in (("slow", 40), ("fast", 230)):  # several samples a bin, in which the fast signal goes up and down
        for number in range(2):
            values = 1000 * np.sin(2 * np.pi * hz * time_s + number)[:, None] + np.array([0, 10])
            write_csv(folder / f"skin/{kind}/{number}.csv", values, rate_hz=1000)
    config, given = ReadoutConfig(resolution=5, clocks_per_sample=4096), ("encoding", "resolution", "clocks_per_sample")
    found = read_set(Path("skin"), FIRST, config, given)
    events = load_recordings(events_of(Path("skin"), {}, config, given), BinConfig())
    scans, bps = _scans(found.config, found.codes, events.labels, BinConfig().bin_s)
    assert np.array_equal(scans.values, events.values)
    assert bps == pytest.approx(events.rate_hz * found.config.event_bits)


def test_given_fields_stay(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=4)
    fit = EncoderChoice(folds=2)
    assert chosen(fit, encoding="cw-lcs").config.encoding == "cw-lcs"
    assert chosen(fit, resolution=7).config.resolution == 7
    assert chosen(fit, leak_shift=5).config.encoding == "lcs"
    both = chosen(fit, encoding="lcs", resolution=4)
    assert (both.config.encoding, both.config.resolution) == ("lcs", 4)
    assert not both.scores


def test_a_class_with_fewer_recordings_than_folds_has_fewer_folds(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=3)
    assert chosen(EncoderChoice(folds=6)).config == chosen(EncoderChoice(folds=3)).config
    with pytest.raises(InputError, match=r"fold must be in 0\.\.2, not 4"):
        chosen(EncoderChoice(fold=4, folds=6))


def test_too_few_recordings_leave_the_encoder(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=2)
    assert any(note.startswith("resolution ") for note in chosen(EncoderChoice(folds=2)).notes)
