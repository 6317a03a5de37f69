"""Test import eskin: examples of the guide, names, and error messages."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eskin
from eskin.base.errors import InputError
from eskin.skin.figures.raster import plot_signals
from eskin.snn.network_config import NetworkConfig

ROOT = Path(__file__).parents[1]
GUIDE = ROOT / "docs" / "guide" / "python.md"
ONE = eskin.ReadoutConfig(rows=1, columns=1, resolution=4)
SIX = eskin.ReadoutConfig(rows=2, columns=3, resolution=4)


def test_the_guide_does_what_it_shows(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the guide from a sine to its class through the RTL, in Icarus."""
    blocks = re.findall(r"```(python|text)\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    program = "".join(text for language, text in blocks if language == "python")
    (shown,) = (text for language, text in blocks if language == "text")
    values: dict[str, Any] = {}
    exec(program.replace("run_rtl(config, sines[100])", 'run_rtl(config, sines[100], "icarus")'), values)
    assert capsys.readouterr().out == shown
    assert values["picture"]._repr_png_().startswith(b"\x89PNG")
    assert eskin.Recording.load("sine.npz").events.tolist() == values["events"].tolist()
    files = {"sine.png", "sine.npz", "sine.csv", "weights.npz", "integer.npz"}
    assert {path.name for path in folder.iterdir()} == files
    assert values["batch"][0].tolist() == values["events"].tolist()
    assert values["found"] == [values["integers"].class_names[number] for number in values["scores"].argmax(1)]
    assert values["counts"].shape == (8, *values["data"].values.shape[1:])
    assert values["signal"].rate_hz == pytest.approx(values["config"].sample_rate_hz)
    assert len(values["again"]) == len(values["events"])
    assert "output [15:0] count;" in values["text"]
    with pytest.raises(InputError, match=r"^the network takes time bins of 0.001 s, not 0.002 s; set bin_s$"):
        eskin.predict(values["weights"], eskin.dataset(ONE, [values["sines"][100]], bin_s=0.002))
    with pytest.raises(InputError, match=r"^there is no recording 40; the recordings have the numbers 0..39$"):
        eskin.train(values["data"], [1, 40])
    with pytest.raises(InputError, match=r"^unknown network field 'hiden'; known fields are "):
        eskin.train(values["data"], hiden=3)


def test_the_import_is_free_and_every_name_is_there() -> None:
    program = "import sys; before = set(sys.modules); import eskin; print(sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-S", "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == "['eskin']\n", done.stderr
    for name in eskin.__all__:
        assert getattr(eskin, name).__doc__
        assert name in dir(eskin)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        eskin.nothing  # noqa: B018


def test_codes_floats_and_both_shapes_give_the_same_events() -> None:
    codes = np.random.default_rng(0).integers(-2047, 2048, (30, 6))
    events = eskin.encode(SIX, codes)
    assert len(events) > 100
    for same in (codes / 2048, codes.reshape(30, 2, 3), (codes / 2048).tolist()):
        assert np.array_equal(eskin.encode(SIX, same), events)
    rebuilt = eskin.decode(SIX, events, 30)
    assert rebuilt.shape == (30, 6)
    assert abs(rebuilt - codes / 2048)[-1].max() < 2.0  # contended, and still of this scale
    assert not eskin.decode(SIX, events[:0], 30).any()


@pytest.mark.parametrize(
    ("signal", "sentence"),
    [
        (
            np.zeros((5, 4)),
            "signal must have the shape (ticks, 6) or (ticks, 2, 3), not (5, 4); reshape it, or set rows",
        ),
        (np.zeros(5), "signal must have the shape (ticks, 6) or (ticks, 2, 3), not (5,); reshape it, or set rows"),
        (
            np.full((5, 6), 1.5),
            "signal is 1.5 at tick 0 of taxel 0, but floats must be in full scales from -1 to 1; divide it",
        ),
        (np.full((5, 6), np.nan), "signal is nan at tick 0 of taxel 0, but floats must be in full scales"),
        (
            np.full((5, 6), 2048),
            "signal has the code 2048, outside -2048..2047 of 12 bits; divide it by its full scale",
        ),
        ([["a"] * 6], "signal must be integer codes or floats in full scales, not <U1"),
    ],
)
def test_a_wrong_signal_is_one_sentence(signal: Any, sentence: str) -> None:
    for use in (eskin.encode, eskin.run_rtl, lambda config, signal: eskin.dataset(config, [signal])):
        with pytest.raises(InputError) as error:
            use(SIX, signal)
        assert str(error.value).startswith(sentence)


def test_wrong_events_classes_and_settings_are_one_sentence() -> None:
    events = eskin.encode(SIX, np.eye(20, 6) * 0.9)
    with pytest.raises(InputError, match=r"outside 0..63 \(the duration in clocks\)$"):
        eskin.decode(SIX, events, 1)
    with pytest.raises(InputError, match=r"^ticks must not be negative, not -1$"):
        eskin.decode(SIX, events, -1)
    with pytest.raises(InputError, match=r"^every signal needs its class, but there are 1 signals and 2 classes$"):
        eskin.dataset(ONE, [np.zeros(5)], ["a", "b"])


def test_a_missing_group_is_one_sentence() -> None:
    program = (
        "import sys; sys.modules['cocotb'] = sys.modules['torch'] = None; import eskin\n"
        "for use in (lambda: eskin.run_rtl(eskin.ReadoutConfig(rows=1, columns=1), [0]), lambda: eskin.train(None)):\n"
        "    try: use()\n"
        "    except eskin.InputError as error: print(error)\n"
        "try: eskin.load_weights\n"
        "except ImportError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        f"this needs {package}, which is not installed; in the checkout: make setup FOR={group} (into .venv), or pip "
        f"install -c constraints.txt '.[{group}]'"
        for package, group in (("cocotb", "sim"), ("torch", "snn"), ("torch", "snn"))
    ]


def test_fields_of_the_units_and_paths_as_text_are_taken(folder: Path) -> None:
    flat = NetworkConfig(inputs=4, classes=2, decay=0.9, reset="subtract")
    assert flat == NetworkConfig.from_dict({"inputs": 4, "classes": 2, "decay": 0.9, "reset": "subtract"})
    assert flat != NetworkConfig(inputs=4, classes=2)
    with pytest.raises(InputError, match="unknown network field 'decai'"):
        NetworkConfig.from_dict({"inputs": 4, "classes": 2, "decai": 0.9})
    with pytest.raises(InputError, match="the fields of a network need inputs"):
        NetworkConfig.from_dict({"decay": 0.9})
    plot_signals(eskin.encode(ONE, np.zeros(4)), np.zeros((4, 1)), ONE, "plain.png")
    assert (folder / "plain.png").is_file()


def test_a_file_is_read_with_its_rate_and_names(folder: Path) -> None:
    wave = np.round(np.sin(np.arange(50) / 5), 3)
    lines = [f"{k / 100:.2f},{x},{-x},ok" for k, x in enumerate(wave)]
    Path("x.csv").write_text("\n".join(["time_s,left,right,note", *lines]))
    found = eskin.read("x.csv")
    assert repr(found) == "Signal(50 samples of 2 taxels, 100 Hz)"
    assert (found.rate_hz, found.names) == (100.0, ("left", "right"))
    assert np.array_equal(found.values, np.stack([wave, -wave], 1))
    assert any("column 'note' is left out: it holds text" in note for note in found.notes)
    assert eskin.read("x.csv", taxel_columns="right").names == ("right",)
    with pytest.raises(InputError, match="unknown option 'columns'; known options are sample_rate_hz, taxel_columns"):
        eskin.read("x.csv", columns=2)


def test_a_batch_gives_a_list_and_is_not_read_as_time() -> None:
    codes = np.random.default_rng(0).integers(-2047, 2048, (4, 30, 6))
    found = eskin.encode(SIX, codes)
    assert [len(events) for events in found] == [len(eskin.encode(SIX, one)) for one in codes]
    assert all(np.array_equal(a, b) for a, b in zip(found, eskin.encode(SIX, list(codes)), strict=True))
    assert np.array_equal(eskin.encode(SIX, codes[0].reshape(30, 2, 3)), found[0])


def test_a_dataset_is_one_of_torch_and_scores_come_on_request() -> None:
    torch = pytest.importorskip("torch")
    signals = [np.sin(np.arange(200) / (2 + n % 2))[:, None] * 0.9 for n in range(8)]
    data = eskin.dataset(ONE, signals, ["slow" if n % 2 else "fast" for n in range(8)], bin_s=0.001)
    assert isinstance(data, torch.utils.data.Dataset)
    counts, label = data[0]
    assert (tuple(counts.shape), data.class_names[label]) == ((data.steps, 2), "fast")
    batches = list(torch.utils.data.DataLoader(data, batch_size=4))
    assert [tuple(batch.shape) for batch, _ in batches] == [(4, data.steps, 2)] * 2
    assert repr(data).startswith("ScanSet(8 scans, ")
    weights = eskin.train(data, recipe="tuned", epochs=2, hidden=8)
    classes, scores = eskin.predict(weights, data, scores=True)
    assert scores.shape == (8, 2)
    assert classes == eskin.predict(weights, data) == [weights.class_names[n] for n in scores.argmax(1)]
    assert repr(weights).startswith("Weights(")
    assert "network" not in repr(eskin.quantise(weights, decay_bits=8))[:10]
