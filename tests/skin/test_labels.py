"""Test labels in time: windows, runs, groups, and training at any rate."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.fitting import other_leak, with_seconds
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Preparation
from eskin.snn.data.folds import possible_folds, stratified_folds
from tests.conftest import Call

SLIP = Preparation(baseline="first", label_column="slip", window_s=0.5, hop_s=0.25)


def write(path: Path, labels: list[str], rate_hz: float = 100.0, more: str = "") -> None:
    """Write four taxels that vibrate while they slip."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draw = np.random.default_rng(len(path.name))
    lines = [f"time_s,a,b,c,d,slip{',' + more.split('=')[0] if more else ''}"]
    for k, label in enumerate(labels):
        cells = [f"{100 * np.sin(k / (3 + n)) * (label == 'yes') + draw.normal():.3f}" for n in range(4)]
        lines.append(f"{k / rate_hz:.4f},{','.join(cells)},{label}{',' + more.split('=')[1] if more else ''}")
    path.write_text("\n".join(lines) + "\n")


LABELS = ["no"] * 150 + ["yes"] * 150 + [""] * 20 + ["no"] * 180


def test_a_window_has_the_class_of_its_last_sample(tmp_path):
    write(tmp_path / "s/one.csv", LABELS)
    write(tmp_path / "s/two.csv", LABELS)
    found = read_set(tmp_path / "s", SLIP, ReadoutConfig())
    one = [source for source in found.sources if source.name.startswith("one@")]
    ends = [float(source.name.removeprefix("one@").removesuffix("s")) for source in one]
    wanted = [end for end in np.arange(0.5, 5.01, 0.25) if not 3.0 < end < 3.7 + 1e-9]
    assert ends == pytest.approx(wanted)
    assert [source.class_name for source in one] == [LABELS[round(100 * end) - 1] for end in wanted]
    assert {source.group for source in found.sources} == {"one", "two"}
    assert {len(codes) for codes in found.codes} == {50}
    assert found.columns == ("a", "b", "c", "d")
    assert "34 windows with a class; left out: 4 where a sample has no label" in found.notes
    assert "a test window and a training window never share a file" in found.notes


def test_a_window_has_the_class_of_most_samples_on_request(tmp_path):
    write(tmp_path / "s/one.csv", ["no"] * 60 + ["yes"] * 40 + ["no"] * 100)
    write(tmp_path / "s/two.csv", ["no"] * 200)
    most = read_set(tmp_path / "s", Preparation(label_column="slip", window_s=1.0, label_of="most"), ReadoutConfig())
    last = read_set(tmp_path / "s", Preparation(label_column="slip", window_s=1.0), ReadoutConfig())
    assert [s.class_name for s in most.sources if s.name == "one@1.000s"] == ["no"]
    assert [s.class_name for s in last.sources if s.name == "one@1.000s"] == ["yes"]


def test_windows_near_a_change_are_left_out(tmp_path):
    write(tmp_path / "s/one.csv", ["no"] * 150 + ["yes"] * 150)
    write(tmp_path / "s/two.csv", ["yes"] * 300)
    guarded = Preparation(label_column="slip", window_s=0.5, hop_s=0.25, guard_s=0.3)
    found = read_set(tmp_path / "s", guarded, ReadoutConfig())
    ends = [float(s.name[4:-1]) for s in found.sources if s.name.startswith("one@")]
    assert [end for end in np.arange(0.5, 3.01, 0.25) if end not in ends] == [1.25, 1.5, 1.75]
    assert any("3 where the label changes in the guard time (--guard)" in note for note in found.notes)


def test_parts_in_time_of_a_single_file_are_its_groups(tmp_path):
    write(tmp_path / "one.csv", LABELS)
    found = read_set(tmp_path / "one.csv", SLIP, ReadoutConfig())
    groups = [source.group for source in found.sources]
    assert len(set(groups)) == 5
    spans = {group: [] for group in groups}
    for source in found.sources:
        end = float(source.name.split("@")[1][:-1])
        spans[source.group].append((end - 0.5, end))
    bounds = sorted((min(a for a, _ in span), max(b for _, b in span)) for span in spans.values())
    assert all(before[1] <= after[0] + 1e-9 for before, after in itertools.pairwise(bounds))


def test_a_file_with_subject_class_and_trial_becomes_a_data_set(tmp_path):
    rows = []
    for subject in (1, 2):
        for trial in (1, 2):
            for kind in ("tap", "press"):
                for frame in range(1, 31 + trial):
                    cells = np.random.default_rng(frame + trial).integers(0, 100, 3)
                    rows.append(f"{subject},{trial},{kind},{frame}," + ",".join(map(str, cells)))
    (tmp_path / "all.csv").write_text("subject,trial,gesture,frame,c1,c2,c3\n" + "\n".join(rows))
    options = Preparation(baseline="first", label_column="gesture", group_column="subject")
    found = read_set(tmp_path / "all.csv", options, ReadoutConfig(sample_rate_hz=50.0), {"sample_rate_hz"})
    assert [(s.class_name, len(c)) for s, c in zip(found.sources, found.codes, strict=True)] == [
        (kind, 30 + trial) for _ in (1, 2) for trial in (1, 2) for kind in ("tap", "press")
    ]
    assert found.columns == ("c1", "c2", "c3")
    assert len({s.group for s in found.sources if s.group.startswith("1")} | {"x"}) == 2


def test_groups_are_never_in_two_folds():
    labels = np.arange(60) % 3
    groups = [f"g{n // 6}" for n in range(60)]
    folds = stratified_folds(labels, 5, groups=groups)
    assert sorted(np.concatenate(folds).tolist()) == list(range(60))
    inside = [{groups[n] for n in fold} for fold in folds]
    assert sum(map(len, inside)) == len(set().union(*inside)) == 10
    assert all(np.bincount(labels[fold], minlength=3).min() >= 2 for fold in folds)
    assert possible_folds(labels, 12, groups) == 10
    assert possible_folds(np.array([0, 0, 0, 1, 1]), 6) == 2
    with pytest.raises(InputError, match="12 folds need 12 groups of recordings, but there are 10"):
        stratified_folds(labels, 12, groups=groups)


@pytest.mark.parametrize("rate_hz", range(1, 101))
def test_default_leaks_exist_at_every_rate(rate_hz):
    config = with_seconds(ReadoutConfig(encoding="nlcs", sample_rate_hz=rate_hz), ())
    near = abs(config.tau_s / 0.2 - 1) <= 0.05
    assert near or config.tau_s < 1.5 / rate_hz or abs(config.tau_s / 0.2 - 1) < 0.5
    assert bool(other_leak(config, ())) == (not near)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--window 1", "name the column of the class with --label-column"),
        ("--label-column slip --hop 1", "--hop needs windows; add --window SECONDS"),
        ("--label-column slip --window -1", "--window must be in 0..1e+06 seconds, not -1"),
        ("--label-column sip --window 1", "has no column 'sip'; it has 6: time_s, a, b, c, d, slip"),
        ("--label-column slip --window 9", "no window of 9 s has a class; give a shorter --window or --guard"),
        ("--label-column slip --window 0.3 --encoding nlcs --tau 0.001", "tau 0.001 s is not reachable"),
    ],
)
def test_mistakes_are_one_sentence(folder: Path, call: Call, options: str, sentence: str) -> None:
    write(folder / "one.csv", ["no"] * 150 + ["yes"] * 150)
    code, _, error = call(f"train --data one.csv --epochs 1 {options}")
    assert (code, error.count("\n")) == (2, 1), error
    assert sentence in error


@pytest.mark.usefixtures("shorter")
def test_slip_is_trained_with_files_as_groups(folder: Path, call: Call) -> None:
    for name in ("a", "b", "c", "d"):
        write(folder / f"s/{name}.csv", ["no"] * 200 + ["yes"] * 200)
    line = "train --data s --label-column slip --window 0.5 --hop 0.25 --encoding lcs --resolution 4 --epochs 30"
    code, output, error = call(f"{line} --folds 2")
    assert code == 0, error
    assert "a test window and a training window never share a file" in output + error
    accuracy = float(output.split("test accuracy ")[1].split("%")[0])
    assert accuracy > 80
    write(folder / "new.csv", ["no"] * 200 + ["yes"] * 200)
    lines = [line.rpartition(",")[0] for line in Path("new.csv").read_text().splitlines()]  # without its labels
    Path("new.csv").write_text("\n".join(lines) + "\n")
    code, output, error = call("predict out/train/weights.npz --data new.csv --out p.json")
    assert code == 0, error
    assert "classes over time: p.csv, p.png" in output
    rows = [row.split(",") for row in Path("p.csv").read_text().splitlines()]
    assert rows[0] == ["file", "end_s", "predicted", "class"]
    assert [float(row[1]) for row in rows[1:]] == pytest.approx(np.arange(0.5, 4.01, 0.25))
    wanted = ["no" if float(row[1]) <= 2 else "yes" for row in rows[1:]]
    assert sum(row[2] == kind for row, kind in zip(rows[1:], wanted, strict=True)) >= 13
    assert Path("p.png").stat().st_size > 3000
    assert call(f"quantise --margin {2**21}")[0] == 0
    code, output, error = call("predict out/train/whole.npz --data new.csv --out early.json")
    assert code == 0, error
    rows = [row.split(",") for row in Path("early.csv").read_text().splitlines()]
    assert rows[0] == ["file", "end_s", "predicted", "class", "early", "early_s"]
    images = json.loads(Path("early.json").read_text())["images"]
    assert [row[4:] for row in rows[1:]] == [
        ["", ""] if image["early"] is None else [image["early"], f"{image['early_s']:.3f}"] for image in images
    ]
    said = [line.partition(", ")[2] for line in output.splitlines() if "class: not known" in line]
    assert {text.split()[0] for text in said} == {"no", "early"}, "some windows decide, others do not"
