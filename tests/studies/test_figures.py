"""Test that Fig. 8, Fig. 9 and confusion matrices show the stored numbers, and that invalid files are rejected."""

import copy
import dataclasses
import itertools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.figures.readouts import LOOKS
from eskin.skin.figures.scan_to_class import ScanToClass, draw_scan
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import stratified_folds
from eskin.snn.data.record import record
from eskin.snn.data.scans import collect
from eskin.snn.exchange.weights import load_weights, save_weights
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.points import Sweep, load_sweep
from eskin.snn.experiments.sweep import PUBLISHED_BPS
from eskin.snn.figures.confusion import draw_confusion
from eskin.snn.network import build
from eskin.snn.network_config import NetworkConfig
from eskin.snn.train import predicted_classes
from studies import fig8
from studies import fig9 as figures
from studies.fig8 import evidence, play
from tests.snn.helpers import some_weights, two_textures


def kept(sweep: str, wanted: str, **fields: Any) -> dict[str, Any]:
    """Return a point of a sweep of the project, with other values of some fields."""
    points = json.loads((figures.KEPT / f"{sweep}.json").read_text())["points"]
    (found,) = (point for point in points if point["name"] == wanted)
    return found | fields


UNKNOWN = dict.fromkeys(("last", "selected", "rate_hz", "data_rate_bps", "normalised_rate", "class_names"))
SWEEP = {
    "command": "eskin sweep --preset paper",
    "points": [
        kept("paper-network", "lcs-4"),
        kept("paper-network", "lcs-6"),
        kept("paper-network", "nlcs-6", cells={"done": 9, "of": 18, "whole_seeds": 1}),
        kept("reference-frames", "cnn-20", name="gru-20"),
        kept("paper-network", "nlcs-8", cells={"done": 0, "of": 18, "whole_seeds": 0}, **UNKNOWN),
        kept("reference-frames", "rnn-20"),
    ],
}
PHYSICAL = {
    "command": "eskin sweep --preset physical",
    "points": [kept("tuned", "lcs-4"), kept("tuned", "lcs-2", readout="cw-lcs", name="cw")],
}
CLASSES = PHYSICAL["points"][0]["class_names"]


@pytest.fixture(scope="module")
def project() -> tuple[dict[str, Any], Figure]:
    """Return data and figure of the sweeps of the project."""
    data = figures.fig9_data([load_sweep(path) for path in figures.kept_sweeps()], "last")
    return data, figures.draw_fig9(data)


@pytest.fixture
def sweeps(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Sweep]:
    """Write two sweeps in place of those of the project and of the latest one, and return them."""
    (folder / "plain.json").write_text(json.dumps(SWEEP))
    (folder / "hand").mkdir()
    (folder / "hand" / "sweep.json").write_text(json.dumps(PHYSICAL))
    monkeypatch.setattr(figures, "KEPT", folder)
    monkeypatch.setattr(figures, "LATEST", folder / "hand" / "sweep.json")
    return [load_sweep(Path(name)) for name in ("plain.json", "hand")]


def marks(panel: Any) -> list[tuple[float, float, str, bool]]:
    """Return position, colour and hollowness of the marks of a panel."""
    found = []
    for line in panel.lines:
        if line.get_marker() in {look.marker for look in LOOKS.values()} and line.get_markersize() < 10:
            hollow = line.get_fillstyle() == "none"
            found += [(float(x), float(y), line.get_color(), hollow) for x, y in zip(*line.get_data(), strict=True)]
    return found


@pytest.mark.quick
@pytest.mark.parametrize("reading", ["last", "selected"])
@pytest.mark.usefixtures("sweeps")
def test_the_figure_shows_the_values_of_the_sweeps(folder: Path, monkeypatch: pytest.MonkeyPatch, reading: str) -> None:
    monkeypatch.setattr(figures, "READING", reading)
    written = [result.make("fig9", folder / "out") for result in figures.RESULTS]
    contents = [json.loads(path.read_text()) for path, _ in written]
    assert all(figure.stat().st_size > 10_000 for _, figure in written)
    data, matrices = contents
    assert data["left_out"] == ["plain: nlcs-8"]
    check_confusion(matrices, reading)
    assert {
        "LCS 6 b, published",
        "LCS 6 b, plain",
        "frames, gated units, plain",
        "frames, ReLU units, plain",
        "CW-LCS 2 b, hand, physical scan",
    } <= {point["label"] for point in data["points"]}
    assert data["reference_bps"] == PUBLISHED_BPS
    own = {(p["sweep"], p["name"]): p for p in data["points"] if p["sweep"] != "published"}
    measured = {("plain", p["name"]): p for p in SWEEP["points"] if p["last"]}
    measured |= {("hand", p["name"]): p for p in PHYSICAL["points"]}
    assert set(own) == set(measured)
    for key, point in measured.items():
        for name in ("data_rate_bps", "normalised_rate", "readout", "preset", "cells"):
            assert own[key][name] == point[name]
        for name in ("accuracy", "wilson_95", "sd_over_cells", "sd_over_folds", "sd_over_seeds"):
            assert own[key][name] == point[reading][name]
        assert own[key]["interval"] == point[reading]["bootstrap_95"] != own[key]["wilson_95"]
    figure = figures.draw_fig9(data)
    for panel, preset in zip(figure.axes, ("paper", "physical"), strict=True):
        assert panel.get_title("left") == f"{preset} scan"
        points = [p for p in data["points"] if p["preset"] == preset]
        wanted = [(p["normalised_rate"], 100 * p["accuracy"], p["sweep"] == "published") for p in points]
        assert sorted((x, y, hollow) for x, y, _, hollow in marks(panel)) == sorted(wanted)
        bars = {(line.get_xdata()[0], *line.get_ydata()) for line in panel.lines if line.get_marker() == "_"}
        assert bars == {(p["normalised_rate"], *(100 * end for end in ends)) for p in points if (ends := ends_of(p))}
        across = [line for line in panel.lines if line.get_transform() == panel.get_yaxis_transform()]
        assert {line.get_ydata()[0] for line in across} == {100 / 6}, "chance"


def check_confusion(data: dict[str, Any], reading: str) -> None:
    """Check that the matrices are those of the best finished spiking point of each scan, and are drawn."""
    sweeps = {"plain": SWEEP["points"][:2], "hand": PHYSICAL["points"]}
    best = {name: max(points, key=lambda point: point[reading]["accuracy"]) for name, points in sweeps.items()}
    assert {point["sweep"]: point["name"] for point in data["points"]} == {n: p["name"] for n, p in best.items()}
    figure = draw_confusion(data)
    figure.draw_without_rendering()
    for panel, point in zip(figure.axes, data["points"], strict=True):
        title = next(text for text in panel.findobj(Text) if text.get_text() == panel.get_title("left") != "")
        assert title.get_window_extent().x1 <= figure.bbox.x1, "it stays in the picture"
        counts = np.array(point["confusion"])
        shares = 100 * counts / counts.sum(1, keepdims=True)  # rows are the true classes
        assert np.asarray(panel.images[0].get_array()) == pytest.approx(shares)
        assert [text.get_text() for text in panel.texts] == [f"{share:.1f}" for share in shares.ravel()]
        assert [label.get_text() for label in panel.get_yticklabels()] == CLASSES
        assert np.trace(counts) / counts.sum() == pytest.approx(point["accuracy"])


PUBLISHED = [
    *(("lcs", 2, 0.027, 56.25, 0), ("lcs", 4, 0.222, 77.08, 0), ("lcs", 6, 1.084, 87.92, 7.0)),
    *(("lcs", 8, 4.38, 68.75, 17.9), ("nlcs", 4, 0.028, 59.58, 0), ("nlcs", 6, 0.116, 68.33, 0)),
    *(("nlcs", 8, 0.465, 76.25, 0), ("nlcs", 10, 1.87, 71.67, 0), ("frame", 10, 5.0, 74.58, 0)),
]
"""Fig. 9 of the paper: readout, resolution, normalised data rate, accuracy and its deviation over folds in per cent."""


def test_the_published_points_are_those_of_the_paper() -> None:
    found = []
    for point in figures.fig9_data([], "last")["points"]:
        shares = (round(100 * point.get(name, 0), 2) for name in ("accuracy", "sd_over_folds"))
        readout = point["readout"].removesuffix(", published")
        found.append((readout, point["resolution"], point["normalised_rate"], *shares))
    assert found == PUBLISHED


def ends_of(point: dict[str, Any]) -> list[float]:
    """Return the ends of an error bar: the interval, of published points the deviation; empty without a bar."""
    if point["sweep"] != "published":
        return point["interval"]
    deviation = point.get("sd_over_folds", 0)
    return [point["accuracy"] - deviation, point["accuracy"] + deviation] if deviation else []


def test_the_protocol_is_that_of_finished_points_and_others_are_ringed(sweeps: list[Sweep]) -> None:
    protocol = "240 images, 6 folds x 3 seeds, last epoch"
    data = figures.fig9_data(sweeps[:1], "last")
    assert data["protocol"] == [protocol]
    assert f"plain: {protocol}" in data["source"]
    assert data["commands"] == {"plain": "eskin sweep --preset paper"}
    assert data["left_out"] == ["plain: nlcs-8"]
    (partial,) = [point for point in data["points"] if point["label"].endswith(", 9 of 18 cells")]
    assert partial["name"] == "nlcs-6"
    figure = figures.draw_fig9(data)
    rings = [line for line in figure.axes[0].lines if line.get_markersize() == 15]
    place = partial["normalised_rate"], 100 * partial["accuracy"]
    assert [(ring.get_xdata()[0], ring.get_ydata()[0]) for ring in rings] == [place]
    legend = figure.legends[0]
    assert legend.get_title().get_text() == f"{protocol}\n{figures.BARS}"
    assert "not all cells finished" in [text.get_text() for text in legend.get_texts()]
    Path("plain.json").write_text(json.dumps(SWEEP | {"points": [SWEEP["points"][2]]}))
    data = figures.fig9_data([load_sweep(Path("plain.json"))], "selected")
    assert data["protocol"] == ["no point is finished, epoch selected by inner validation"]


def test_the_sweeps_are_those_of_the_project_and_the_latest(
    sweeps: list[Sweep], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert figures.load_sweeps() == sweeps
    monkeypatch.setattr(figures, "LATEST", folder / "nowhere" / "sweep.json")
    assert figures.load_sweeps() == sweeps[:1]


@pytest.mark.parametrize("crowded", [False, True])
def test_no_mark_of_fig9_hides_another_and_labels_lie_on_nothing(
    sweeps: list[Sweep], project: tuple[dict[str, Any], Figure], crowded: bool
) -> None:
    _, figure = project
    if crowded:
        twice = [sweeps[0], dataclasses.replace(sweeps[0], name="again")]
        figure = figures.draw_fig9(figures.fig9_data(twice, "last"))
    figure.draw_without_rendering()
    for panel in figure.axes:
        boxes = []
        for line in panel.lines:
            if line.get_marker() in {look.marker for look in LOOKS.values()} and line.get_markersize() < 10:
                half = 0.5 * line.get_markersize() * figure.dpi / 72
                places = line.get_transform().transform(np.column_stack(line.get_data()))
                boxes += [Bbox([place - half, place + half]) for place in places]
        count, frame = len(boxes), panel.get_window_extent()
        for label in panel.texts:
            if isinstance(label, Annotation):
                assert label.get_visible()
                boxes.append(label.get_window_extent())
                assert frame.contains(*boxes[-1].min)
                assert frame.contains(*boxes[-1].max)
        assert count > 5 or panel is not figure.axes[0]
        assert len(boxes) - count >= 4
        for one, other in itertools.combinations(boxes, 2):
            common = Bbox.intersection(one, other)
            assert common is None or min(common.width, common.height) < 0.01


def test_fig9_names_sweeps_and_networks_in_words_and_the_rate_of_frames_in_every_panel(
    project: tuple[dict[str, Any], Figure],
) -> None:
    data, figure = project
    words = " ".join([data["source"], *(point["label"] for point in data["points"])])
    words += " ".join(text.get_text() for text in figure.findobj(Text))
    for file in figures.kept_sweeps():
        assert file.stem not in words
        assert figures.TITLES[file.stem] in words
    assert "cnn" not in words
    for axes in figure.axes:
        frames = [mark for mark in marks(axes) if mark[2] == LOOKS["frame"].colour]
        said = any("rate of frames; no network" in text.get_text() for text in axes.texts)
        assert bool(frames) != said
        known = [f"{point['preset']} scan" for point in data["points"] if point["readout"].startswith("frame")]
        assert said is not (axes.get_title("left") in known)


NOT_ABOVE_0 = "normalised_rate, data_rate_bps, cells.of and cells.whole_seeds of a result must be above 0"
EMPTY = "a result needs class_names and images"
NO_SHARE = "accuracy and both ends of its intervals must be in 0..1"
NO_WORD = "labels and predictions must have a digit for each image (240)"


@pytest.mark.parametrize(
    ("keys", "value", "sentence"),
    [
        ([], 3, "it is no object"),
        (["name"], None, "name is null"),
        (["readout"], "x", f"readout is 'x', not one of {', '.join(LOOKS)}"),
        (["preset"], "flat", "preset is 'flat', not one of paper, physical, None"),
        (["normalised_rate"], 0, NOT_ABOVE_0),
        (["data_rate_bps"], float("nan"), "data_rate_bps is nan"),
        (["cells"], 6, "cells is no object"),
        (["cells", "of"], 0, NOT_ABOVE_0),
        (["cells", "whole_seeds"], 0, NOT_ABOVE_0),
        (["class_names"], [], EMPTY),
        (["last", "images"], 0, EMPTY),
        (["class_names"], ["a", "b"], "confusion must have a row and a column for each of 2 class_names"),
        (["last"], None, "last is no object"),
        (["selected", "accuracy"], 1.2, NO_SHARE),
        (["last", "wilson_95"], [0.1], NO_SHARE),
        (["last", "bootstrap_95"], [0.1, 0.2, 0.3], NO_SHARE),
        (["last", "confusion"], [[1, 2]], "confusion must have a row and a column for each of 6 class_names"),
        (["labels"], 5, "labels is 5"),
        (["labels"], "001", NO_WORD),
        (["last", "predictions"], ["00"], NO_WORD),
        (["last", "predictions"], "00112", "predictions is no list"),
    ],
)
def test_bad_points_get_one_sentence(folder: Path, keys: list[str], value: Any, sentence: str) -> None:
    content: Any = copy.deepcopy(SWEEP)
    place, key = content["points"], 0
    for name in keys:
        place, key = place[key], name
    place[key] = value
    (folder / "bad.json").write_text(json.dumps(content))
    with pytest.raises(InputError) as error:
        load_sweep(Path("bad.json"))
    assert str(error.value) == f"bad.json is damaged: point 0: {sentence}; run the sweep again"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "cannot read the sweep bad.json: No such file"),
        ("", "the sweep bad.json is not JSON"),
        ("[]", "bad.json contains no points of a sweep; make it with eskin sweep"),
        ('{"points": []}', "bad.json contains no points of a sweep"),
    ],
)
def test_files_that_are_no_sweep_get_one_sentence(folder: Path, text: str | None, sentence: str) -> None:
    if text is not None:
        (folder / "bad.json").write_text(text)
    with pytest.raises(InputError, match=f"^{re.escape(sentence)}"):
        load_sweep(Path("bad.json"))


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"output_scale": 0.1, "reset": "subtract"},
        {"readout": "membrane", "decay": 0.8, "output_decay": 0.95, "input_scale": 0.4, "dropout": 0.3},
        {"readout": "membrane", "decay": 0.8, "output_decay": 0.9, "learn_decay": True, "output_scale": 3.0},
    ],
)
def test_the_evidence_ends_in_the_logits(fields: dict[str, Any]) -> None:
    network = build(NetworkConfig.from_dict(dict(inputs=8, classes=3, hidden=64, **fields)), seed=1).eval()
    x = torch.from_numpy(np.random.default_rng(0).poisson(0.8, (40, 2, 8)).astype(np.float32))
    spikes, grown = evidence(network, x)
    assert spikes.sum() > 0
    assert torch.equal(spikes, network.spikes(x))
    assert grown.shape == (40, 2, 3)
    logits = network(x).logits.detach()
    assert logits.abs().max() > 0
    torch.testing.assert_close(grown[-1], logits, rtol=1e-4, atol=1e-5)
    early = network(x[:13]).logits.detach()  # the same network on the begin of the scan
    scale = 13 / 40 if fields.get("readout") == "membrane" else 1.0
    torch.testing.assert_close(grown[12], early * scale, rtol=1e-4, atol=1e-5)


EXPERIMENT = Experiment(
    dataset="embedded", readout=ReadoutConfig(rows=2, columns=3, resolution=4), bins=BinConfig(bin_s=0.004)
)
TEXTURES = open_dataset("embedded")
TEST = stratified_folds(TEXTURES.labels, 6)[1]
FIRST = TEXTURES[int(TEST[0])]


def trained(folder: Path, experiment: Experiment = EXPERIMENT, **fields: Any) -> None:
    """Write weights and result of a training without epochs."""
    taxels = experiment.readout.rows * experiment.readout.columns
    channels = 2 * taxels if experiment.readout.has_polarity else taxels
    fields = {"inputs": channels, "hidden": 32, "decay": 0.9, "output_decay": 0.9} | fields
    folder.mkdir(parents=True, exist_ok=True)
    save_weights(folder / "weights.npz", some_weights(TEXTURES.class_names, experiment.bins.bin_s, **fields))
    result = {"experiment": experiment.to_dict(), "fold": 1, "folds": 6, "seed": 0}
    result |= {"class_names": list(TEXTURES.class_names), "labels": TEXTURES.labels[TEST].tolist()}
    (folder / "result.json").write_text(json.dumps(result))


def played(folder: Path, image: str | None = None) -> ScanToClass:
    """Return the response of the network in a folder of ``trained``."""
    return play(folder / "weights.npz", folder / "result.json", image=image)


def fig8_data(folder: Path) -> dict[str, Any]:
    """Return the data of Fig. 8 of the network in ``out/train``, after drawing the figure."""
    path, figure = fig8.result().make("fig8", folder)
    assert figure.stat().st_size > 30_000
    data: dict[str, Any] = json.loads(path.read_text())
    return data


def test_fig8_shows_the_first_test_image_and_its_logits(folder: Path) -> None:
    train = folder / "out" / "train"
    trained(train, readout="membrane")
    data = fig8_data(folder)
    assert data["image"] == FIRST.name
    assert data["of_the_test_fold"]
    found = played(train)
    recording = record(FIRST, "embedded", found.scan, EXPERIMENT.readout)
    assert np.array_equal(found.recording.events, recording.events)
    scan = collect([recording], EXPERIMENT.bins, TEXTURES.class_names)
    network = load_weights(train / "weights.npz").network.eval()
    logits = network(scan.batch([0])).logits[0].detach().numpy()
    assert data["evidence"][-1] == pytest.approx(logits, rel=1e-4, abs=1e-5)
    assert len(data["hidden_spikes"]) == int(network.spikes(scan.batch([0])).sum()) > 0
    assert data["predicted"] == TEXTURES.class_names[int(logits.argmax())]

    figure = draw_scan(found)
    verdict = "right" if data["predicted"] == data["true"] else "wrong"
    title = figure.get_suptitle()
    assert title == (f"{data['image']} (test image): true {data['true']}, predicted {data['predicted']}, {verdict}")
    panels = {panel.get_title("left"): panel for panel in figure.axes}
    lines = {str(line.get_label()): line for line in panels["evidence for each class"].lines}
    for name, value in zip(TEXTURES.class_names, logits, strict=True):
        assert lines[name].get_ydata()[-1] == pytest.approx(value, rel=1e-4, abs=1e-5)
    widths = {name: line.get_linewidth() for name, line in lines.items()}
    assert max(widths, key=lambda name: widths[name]) == data["predicted"]
    beside = {text.get_text(): text.xy for text in panels["evidence for each class"].texts}
    assert set(beside) == {data["predicted"], data["true"]}
    assert {x for x, _ in beside.values()} == {1}  # of the panel's width: on no line
    drawn = sum(len(line.get_xdata()) for line in panels["address events"].lines)
    assert drawn == len(recording.events)
    assert len(panels["hidden neurons"].lines[0].get_xdata()) == len(data["hidden_spikes"])


def test_the_way_of_the_scan_is_seen_on_the_texture(folder: Path) -> None:
    for preset, rows in (("physical", 2), ("paper", 1)):
        config = ReadoutConfig(rows=rows, columns=12 // rows // 2, resolution=4)
        experiment = Experiment(dataset="embedded", preset=preset, readout=config, bins=EXPERIMENT.bins)
        trained(folder / preset, experiment)
        figure = draw_scan(played(folder / preset))
        panel = next(panel for panel in figure.axes if panel.get_title("left") == "texture and scan")
        figure.draw_without_rendering()
        panel.draw(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        drawn = np.asarray(figure.canvas.buffer_rgba()).astype(int)  # type: ignore[attr-defined]
        box = panel.get_window_extent()
        inside = drawn[-int(box.y1) : -int(box.y0), int(box.x0) : int(box.x1), :3]
        coloured = (np.ptp(inside, axis=2) > 100).mean()
        assert coloured > 0.02, preset


def test_the_default_of_fig8_is_right(folder: Path) -> None:
    train = folder / "out" / "train"
    trained(train)
    file = train / "result.json"
    result = json.loads(file.read_text())
    network = load_weights(train / "weights.npz").network
    predicted = predicted_classes(network, EXPERIMENT.data(), TEST).tolist()
    right = [a == b for a, b in zip(predicted, result["labels"], strict=True)]
    assert not right[0]
    assert any(right)
    file.write_text(json.dumps(result | {"predicted": predicted}))
    data = fig8_data(folder)
    assert data["image"] == TEXTURES[int(TEST[right.index(True)])].name
    assert data["predicted"] == data["true"]
    assert ", wrong; " in draw_scan(played(train, FIRST.name)).get_suptitle()
    for bad in ([0], ["a"] * len(TEST), 3):
        file.write_text(json.dumps(result | {"predicted": bad}))
        with pytest.raises(InputError, match=r"result.json is damaged or not the result of a training"):
            played(train)


def test_fig8_of_the_paper_scan_counts_from_where_events_count(folder: Path) -> None:
    config = ReadoutConfig(rows=2, columns=3, resolution=5, encoding="nlcs")
    trained(folder / "train", Experiment(dataset="embedded", preset="paper", readout=config, bins=EXPERIMENT.bins))
    found = played(folder / "train", "grass/grass-03")
    assert found.start_s == pytest.approx(0.1, abs=1e-3)
    assert found.ends_ms[-1] <= 1e3 * found.recording.duration_s
    assert not found.tested
    assert "grass/grass-03 (training image): true grass" in draw_scan(found).get_suptitle()
    for start_s, notes in ((found.start_s, ["events do not\ncount yet"]), (0.1 * found.recording.duration_s, [])):
        panels = draw_scan(dataclasses.replace(found, start_s=start_s)).axes
        (hidden,) = (panel for panel in panels if panel.get_title("left") == "hidden neurons")
        assert [text.get_text() for text in hidden.texts] == notes, "written only where there is room"


def test_labels_of_fig8_do_not_lie_on_each_other(folder: Path) -> None:
    trained(folder / "train")
    found = played(folder / "train")
    grown = np.zeros_like(found.evidence)
    grown[-1, 1 - found.label] = 0.001  # another class wins by a hair
    panel = draw_scan(dataclasses.replace(found, evidence=grown)).axes[-1]
    heights = sorted(text.xy[1] for text in panel.texts)
    assert len(heights) == 2
    assert heights[1] - heights[0] > 0.1 * (panel.get_ylim()[1] - panel.get_ylim()[0])


def test_fig8_refuses_what_does_not_belong_together(folder: Path) -> None:
    def refuses(sentence: str, train: Path = folder / "train", image: str | None = None) -> None:
        with pytest.raises(InputError, match=re.escape(sentence)):
            played(train, image)

    refuses("weights.npz does not exist; make one with eskin train")
    trained(folder / "train")
    refuses("there is no image 'x'; there are 48 images, from brick/brick-00 to", image="x")
    file = folder / "train" / "result.json"
    result = json.loads(file.read_text())
    file.unlink()
    refuses("result.json does not exist, but fig8 needs the result of the training")
    file.write_text('{"experiment": {}}')
    refuses("result.json is damaged or not the result of a training")

    two_textures(folder / "cloth")
    others = "the images differ from the training images; give the training's textures with --dataset"
    for change, sentence in (
        ({"bins": {"bin_s": 0.002}}, "result.json has other classes or time bins than"),
        ({"events": "replay"}, "is of a training on event files or frames; fig8 needs a training on textures"),
        ({"dataset": str(folder / "cloth")}, "the textures are rough, smooth; give the textures of the training"),
        ({"readout": {"rows": 2, "columns": 2}}, "the network has 12 input channels, but the scans have 8"),
        ({"preset": "flat"}, "preset must be one of paper, physical, not 'flat'"),
        ({"class_names": ["a", "b", "c"]}, "result.json has other classes or time bins than"),
        ({"labels": [0, 1, 2]}, others),
    ):
        nested = {"experiment": result["experiment"] | change} if set(change) <= set(result["experiment"]) else change
        file.write_text(json.dumps(result | nested))
        refuses(sentence)
    trained(folder / "gru", kind="gru")
    refuses("holds a baseline for frames; fig8 needs a spiking network", folder / "gru")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("frame-250-8", "250 Hz 8 b"),
        ("frame-diff-62.5-8", "differences 62.5 Hz 8 b"),
        ("frame-onoff-250-8-3", "ON/OFF 250 Hz 8 b, levels of 3 b"),
        ("cnn-20", "convolutions"),
        ("", "10 b"),
    ],
)
def test_the_names_of_frames_are_words(name: str, words: str) -> None:
    assert figures.detail({"readout": "frame", "name": name, "resolution": 10}) == words
