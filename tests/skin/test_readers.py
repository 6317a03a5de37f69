"""Test the readers: every kind of file gives the samples that a plain table gives, or one sentence."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.encode import encode_samples, read_image
from eskin.skin.readers.bags import read_bag
from eskin.skin.readers.registry import BAGS, READERS, read_frame
from eskin.skin.recordings.columns import read_one
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.table import read_table

TABLES = Path("../shared/data/tables")
RATE_HZ = 100.0
SIGNAL = np.rint(1000 * np.sin(np.arange(200)[:, None] / np.array([7.0, 11.0, 13.0]))).astype(int)
"""Signals that never count, rise or rest, shape (ticks, taxels)."""
NAMES = ("a1", "a2", "a3")


def rows(cells: np.ndarray = SIGNAL, mark: str = ",") -> list[str]:
    return [mark.join(map(str, row)) for row in cells.tolist()]


def stamped(stamps: list[str], names: str = "time_s,a1,a2,a3", mark: str = ",") -> str:
    return "\n".join([names, *(f"{t}{mark}{row}" for t, row in zip(stamps, rows(mark=mark), strict=False))]) + "\n"


SECONDS = [f"{k / RATE_HZ:.3f}" for k in range(len(SIGNAL))]


def read(folder: Path, text: str | bytes, name: str = "x.csv", rate_hz: float | None = None, **options: object):
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_one(path, Preparation(**options), rate_hz)


def is_signal(values: np.ndarray) -> bool:
    return np.array_equal(values, SIGNAL)


# -- formats -----------------------------------------------------------------------------------------


def _bag(path: Path, stamps: np.ndarray) -> Path:
    """Write the signal as messages of a ROS 1 bag, or of a ROS 2 bag in its folder."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    array, layout = (store.types[f"std_msgs/msg/{kind}"] for kind in ("Float32MultiArray", "MultiArrayLayout"))
    text = store.types["std_msgs/msg/String"]
    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    place = path if ros1 else path.with_suffix("")
    with Writer1(place) if ros1 else Writer(place, version=9, storage_plugin=plugin) as bag:
        pack = store.serialize_ros1 if ros1 else store.serialize_cdr
        said = bag.add_connection("/log", text.__msgtype__, typestore=store)
        bag.write(said, int(stamps[0]), pack(text(data="started"), text.__msgtype__))
        skin = bag.add_connection("/skin", array.__msgtype__, typestore=store)
        for stamp, row in zip(stamps.tolist(), SIGNAL, strict=True):
            message = array(layout=layout(dim=[], data_offset=0), data=row.astype(np.float32))
            bag.write(skin, stamp, pack(message, array.__msgtype__))
    return path if ros1 else next(place.glob(f"*{path.suffix}"))


def _hdf5(path: Path, transposed: bool = False) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["run/samples"] = SIGNAL.T if transposed else SIGNAL
        file["run/samples"].attrs["unit"] = "counts"
        file.attrs["sample_rate_hz"] = RATE_HZ


def _wav(path: Path) -> None:
    from scipy.io import wavfile

    wavfile.write(path, int(RATE_HZ), SIGNAL.astype(np.int16))


def _frame(path: Path) -> None:
    import pandas

    table = pandas.DataFrame(SIGNAL, columns=NAMES)
    table.insert(0, "time_s", np.arange(len(SIGNAL)) / RATE_HZ)
    table["slip"] = "no"
    if path.suffix == ".json":
        table.to_json(path, orient="records")
    elif path.suffix == ".jsonl":
        table.to_json(path, orient="records", lines=True)
    elif path.suffix == ".xlsx":
        table.to_excel(path, index=False)
    else:
        getattr(table, f"to_{path.suffix[1:]}")(path)


def _matlab(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"samples": SIGNAL, "sample_rate_hz": RATE_HZ, "note": "left hand"})


WRITERS: dict[str, Callable[[Path], object]] = {
    ".csv": lambda path: path.write_text(stamped(SECONDS)),
    ".tsv": lambda path: path.write_text(stamped(SECONDS, "time_s\ta1\ta2\ta3", "\t")),
    ".txt": lambda path: path.write_text(stamped(SECONDS, "time_s a1 a2 a3", " ")),
    ".dat": lambda path: path.write_text("% device 7\n" + stamped(SECONDS)),
    ".npy": lambda path: np.save(path, SIGNAL),
    ".npz": lambda path: np.savez(path, samples=SIGNAL, sample_rate_hz=RATE_HZ),
    ".mat": _matlab,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".parquet": _frame,
    ".feather": _frame,
    ".xlsx": _frame,
    ".json": _frame,
    ".jsonl": _frame,
    ".wav": _wav,
} | {suffix: lambda path: _bag(path, 10**18 + 10**7 * np.arange(len(SIGNAL))) for suffix in BAGS}


@pytest.mark.parametrize("suffix", WRITERS)
def test_every_format_gives_the_same_events(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    path = made if isinstance(made := WRITERS[suffix](path), Path) else path
    config = ReadoutConfig(rows=1, columns=3, sample_rate_hz=RATE_HZ)
    given = frozenset({"rows", "columns", "sample_rate_hz"})
    found = encode_samples(path, config, given, {"baseline": "none", "scale": "max"})
    (tmp_path / "plain.csv").write_text(stamped(SECONDS))
    plain = encode_samples(tmp_path / "plain.csv", config, given, {"baseline": "none", "scale": "max"})
    assert len(plain.recording.events) > 100
    assert np.array_equal(found.recording.events, plain.recording.events)


def test_every_reader_has_a_written_file():
    assert set(WRITERS) == {*READERS, *BAGS}


def test_matlab_7_3_stores_columns_first(tmp_path):
    _hdf5(tmp_path / "x.mat", transposed=True)
    assert is_signal(read_one(tmp_path / "x.mat", Preparation())[0].values)


def test_a_topic_a_field_and_a_sheet_are_chosen_by_option(tmp_path):
    path = _bag(tmp_path / "x.mcap", 10**18 + 10**7 * np.arange(len(SIGNAL)))
    assert is_signal(read_one(path, Preparation(topic="/skin", field="data"))[0].values)
    with pytest.raises(
        InputError, match=r"has no topic '/hand'; it has /log \(std_msgs/msg/String, 1 messages\), /skin"
    ):
        read_one(path, Preparation(topic="/hand"))
    np.savez(tmp_path / "x.npz", left=SIGNAL, right=-SIGNAL)
    with pytest.raises(InputError, match=r"contains left \(200, 3\), right \(200, 3\); choose one with --field NAME"):
        read_one(tmp_path / "x.npz", Preparation())
    assert is_signal(-read_one(tmp_path / "x.npz", Preparation(field="right"))[0].values)
    (tmp_path / "x.json").write_text(json.dumps({"left": SIGNAL.tolist(), "right": (-SIGNAL).tolist()}))
    assert is_signal(read_one(tmp_path / "x.json", Preparation(field="left"))[0].values)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        (
            "x.pkl",
            b"\x80\x04",
            r"is a pickle, .*: import pandas; pandas.read_pickle\('x.pkl'\)",
        ),
        ("x.csv", b"version https://git-lfs.github.com/spec/v1\n", "is a Git LFS pointer, .* with git lfs pull"),
        ("x.npy", b"", "is empty; fetch or record it again"),
        ("x.csv", b"1,2\0\n", "is not text; save it as comma-separated values in UTF-8"),
        ("x.h5", b"\x89HDF\r\n\x1a\n", "is damaged or not an HDF5 file"),
        ("x.mat", b"MATLAB 5.0", "is damaged or not a .mat file"),
        ("x.parquet", b"PAR1", "is damaged or not a .parquet file"),
        ("x.xlsx", b"PK", "is damaged or not an .xlsx workbook"),
        ("x.wav", b"RIFF", "is damaged or not a .wav file"),
        ("x.json", b"{", "is not JSON"),
        ("x.bag", b"#ROSBAG V2.0\n", "is damaged or not a bag that can be read"),
        ("x.csv", b"a,b\n1_0,2\n1_1,3\n", "has no column of samples|holds text"),
    ],
)
def test_files_that_cannot_be_read_are_named(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    if name == "x.csv" and b"_" in content:  # an underscore is no digit: the column is text
        table, notes = read_one(tmp_path / name, Preparation())
        assert table.names == ("b",)
        assert notes[0] == "column 'a' is left out: it holds text, '1_0'"
        return
    with pytest.raises(InputError, match=sentence):
        read_one(tmp_path / name, Preparation())


# -- layouts of text ---------------------------------------------------------------------------------


LAYOUTS = {
    "plain": "\n".join(["a1,a2,a3", *rows()]),
    "delimiter at the end of each line": "\n".join(["a1,a2,a3", *(f"{row}," for row in rows())]),
    "delimiter at the end of the header too": "\n".join(["a1,a2,a3,", *(f"{row}," for row in rows())]),
    "column without a value": "\n".join(["a1,none,a2,a3", *(row.replace(",", ",,", 1) for row in rows())]),
    "units under the names": "\n".join(["a1,a2,a3", "[V],[V],[V]", *rows()]),
    "units above the names": "\n".join(["mV,mV,mV", "a1,a2,a3", *rows()]),
    "vendor header": "\n".join(["Device: skin 7", "Rate, 100", "", "a1,a2,a3", *rows()]),
    "comments": "\n".join(["# made", "a1,a2,a3", "% more", *rows()]),
    "numbers of the rows": "\n".join([",a1,a2,a3", *(f"{k},{row}" for k, row in enumerate(rows()))]),
    "names one short": "\n".join(["a1,a2,a3", *(f"{k},{row}" for k, row in enumerate(rows()))]),
    "windows": "\r\n".join(["\ufeffa1;a2;a3", *rows(mark=";")]),
    "text column": "\n".join(["a1,note,a2,a3", *(row.replace(",", ",ok,", 1) for row in rows())]),
    "counter of 8 bits": "\n".join(["a1,a2,a3,seq", *(f"{row},{k % 256}" for k, row in enumerate(rows()))]),
    "last line cut off": "\n".join(["a1,a2,a3", *rows(), "12,3"]),
    "subject": "\n".join(["subject,a1,a2,a3", *(f"S{k // 50},{row}" for k, row in enumerate(rows()))]),
    "truth values": "\n".join(["a1,a2,a3,touched", *(f"{row},{k > 100}" for k, row in enumerate(rows()))]),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_of_a_table_gives_the_signal(tmp_path, layout):
    table, notes = read(tmp_path, LAYOUTS[layout])
    assert is_signal(table.values), notes
    assert table.names == NAMES
    assert table.codes
    assert all("--" in note or "units" in note or "left out" in note for note in notes), notes


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_other_texts_are_read_and_said(tmp_path, encoding):
    table, notes = read(tmp_path, "\n".join(["µ1,µ2,µ3", *rows()]).encode(encoding))
    assert table.names == ("µ1", "µ2", "µ3")
    assert "UTF" in notes[0]


def test_lines_before_the_table_are_skipped(tmp_path):
    text = "\n".join(["1,2,3", *rows()])
    assert is_signal(read(tmp_path, text, skip_lines=1)[0].values)


def test_a_size_line_and_frames_of_several_lines_give_the_array(tmp_path):
    table, notes = read(tmp_path, "\n".join(["1,3", *rows()]))
    assert (table.shape, is_signal(table.values)) == ((1, 3), True)
    assert notes == ("line 1 gives the array: 1 x 3 taxels",)
    frames = "\n\n".join("\n".join(row.replace(",", " ").split()) + " " for row in rows())
    assert read(tmp_path, frames)[0].shape == (3, 1)
    square = SIGNAL.repeat(2, axis=1).reshape(-1, 2, 3)
    blocks = "\n\n".join("\n".join(rows(frame)) for frame in square)
    table, notes = read(tmp_path, blocks)
    assert table.shape == (2, 3)
    assert np.array_equal(table.values.reshape(-1, 2, 3), square)
    assert "--frame-lines 1 reads each line" in notes[0]
    assert len(read(tmp_path, blocks, frame_lines=1)[0].values) == 2 * len(SIGNAL)


def test_a_constant_taxel_of_an_array_stays_in_its_place(tmp_path):
    cube = np.concatenate([SIGNAL, 0 * SIGNAL[:, :1]], axis=1).reshape(-1, 2, 2)
    np.save(tmp_path / "x.npy", cube)
    assert read_one(tmp_path / "x.npy", Preparation())[0].shape == (2, 2)
    np.save(tmp_path / "x.npy", cube.reshape(-1, 4))
    table, notes = read_one(tmp_path / "x.npy", Preparation())
    assert table.names == ("1", "2", "3")
    assert notes[0] == "column '4' is left out: it is 0 in every sample"
    assert read_one(tmp_path / "x.npy", Preparation(), taxels=4)[0].names == ("1", "2", "3", "4")


def test_more_taxels_than_samples_are_a_question(tmp_path):
    np.save(tmp_path / "x.npy", SIGNAL.T)
    with pytest.raises(InputError, match=r"shape \(3, 200\).*if its first axis is not time, save array.T; otherwise"):
        read_one(tmp_path / "x.npy", Preparation())
    assert read_one(tmp_path / "x.npy", Preparation(), taxels=200)[0].values.shape == (3, 200)
    np.save(tmp_path / "x.npy", np.stack([SIGNAL, SIGNAL]))
    with pytest.raises(InputError, match=r"if it holds 2 recordings, save each one as an array \(ticks, taxels\)"):
        read_one(tmp_path / "x.npy", Preparation())


# -- time --------------------------------------------------------------------------------------------


STAMPS = {
    "seconds": ("time_s", SECONDS),
    "epoch seconds": ("timestamp", [f"{1.7e9 + k / RATE_HZ:.6f}" for k in range(200)]),
    "epoch ms": ("timestamp", [f"{1_700_000_000_000 + 10 * k}" for k in range(200)]),
    "epoch us": ("t", [f"{1_700_000_000_000_000 + 10_000 * k}" for k in range(200)]),
    "epoch ns": ("t", [f"{1_700_000_000_000_000_000 + 10_000_000 * k}" for k in range(200)]),
    "bare ms": ("time", [f"{5000 + 10 * k}" for k in range(200)]),
    "bare us": ("time", [f"{5000 + 10_000 * k}" for k in range(200)]),
    "dates": ("when", [f"2024-03-05 14:07:{9 + k / RATE_HZ:09.6f}" for k in range(200)]),
    "ISO dates with a zone": ("when", [f"2024-03-05T14:07:{9 + k / RATE_HZ:09.6f}+01:00" for k in range(200)]),
    "clock over midnight": ("clock", [f"{h:02}:{m:02}:{s:06.3f}" for h, m, s in (
        (int(x // 3600) % 24, int(x // 60) % 60, x % 60) for x in (86_399 + k / RATE_HZ for k in range(200)))]),
    "32 bits of microseconds": ("micros", [str((2**32 - 500_000 + 10_000 * k) % 2**32) for k in range(200)]),
    "16 bits of milliseconds": ("time_ms", [str((2**16 - 500 + 10 * k) % 2**16) for k in range(200)]),
}  # fmt: skip


@pytest.mark.parametrize("kind", STAMPS)
def test_time_stamps_of_every_kind_give_the_rate(tmp_path, kind):
    name, cells = STAMPS[kind]
    table, notes = read(tmp_path, stamped(cells, f"{name},a1,a2,a3"))
    assert is_signal(table.values), notes
    assert table.time_s == pytest.approx(np.arange(200) / RATE_HZ, abs=2e-6)
    assert "--time-column" in notes[0]


def test_a_coarse_clock_is_evened_out(tmp_path):
    table, notes = read(tmp_path, stamped([str(20 * (k // 2)) for k in range(200)], "time_ms,a1,a2,a3"))
    assert is_signal(table.values)
    assert np.ptp(np.diff(table.time_s)) < 1e-9
    assert 1 / table.time_s[1] == pytest.approx(RATE_HZ, rel=0.01)
    assert "repeats its stamps" in notes[2]


def test_bare_stamps_need_a_unit_or_a_rate(tmp_path):
    text = stamped([str(500 * k) for k in range(200)], "time,a1,a2,a3")
    rate = read(tmp_path, text, rate_hz=2000.0)[0].time_s
    assert rate[1] == pytest.approx(1 / 2000)
    assert read(tmp_path, text, time_unit="us")[0].time_s[1] == pytest.approx(1 / 2000)
    doubtful = stamped([str(80_000 * k) for k in range(200)], "time,a1,a2,a3")
    with pytest.raises(InputError, match=r"rise by 80000 without a unit: .* give --time-unit, or --sample-rate HZ"):
        read(tmp_path, doubtful)
    assert read(tmp_path, doubtful, time_unit="us")[0].time_s[1] == pytest.approx(0.08)


def test_time_is_never_a_taxel(tmp_path):
    table, notes = read(tmp_path, stamped(SECONDS), time_column="none")
    assert (is_signal(table.values), table.time_s) == (True, None)
    assert notes[0] == "column 'time_s' is left out: it is a time; --taxel-columns chooses the taxels"
    ramp = SIGNAL.copy()
    ramp[:, 0] = np.rint(np.arange(200) ** 1.01)
    table, _ = read(tmp_path, "\n".join(["T1,T2,T3", *rows(ramp)]))
    assert table.names == ("T1", "T2", "T3")


def test_a_printed_remedy_works(tmp_path):
    """Follow the sentence for a damaged cell: the columns that it leaves out are not even looked at."""
    text = "\n".join(
        ["a1,broken,a2,a3", *(row.replace(",", f",{k if k != 50 else 'x'},", 1) for k, row in enumerate(rows()))]
    )
    with pytest.raises(
        InputError, match=r"has 'x' in sample 51, column 'broken', .* leave the column out with --taxel-col"
    ):
        read(tmp_path, text)
    assert is_signal(read(tmp_path, text, taxel_columns="a1,a2,a3")[0].values)
    assert is_signal(read(tmp_path, text, taxel_columns="1,3-4")[0].values)


def test_labels_never_set_the_scale(tmp_path):
    for name in ("a/0", "a/1", "b/0"):
        path = tmp_path / f"s/{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        cells = [
            f"{t},{x / 7e4},{y / 7e4},{z / 7e4},{k // 100}"
            for k, (t, (x, y, z)) in enumerate(zip(SECONDS, SIGNAL, strict=True))
        ]
        path.write_text("\n".join(["time_s,a1,a2,a3,grasped", *cells]) + "\n")
    found = read_set(tmp_path / "s", Preparation(baseline="first"), ReadoutConfig())
    assert found.columns == NAMES
    assert max(int(np.abs(codes).max()) for codes in found.codes) == 2047
    assert "column 'grasped' is left out: it is 0 or 1, as a label is" in found.notes


# -- the files of the shared folder, with their right values -----------------------------------------


SHARED = {
    "trailing_comma.csv": (19, 199, 99.99, {}),
    "dead_taxel.csv": (19, 199, 99.99, {}),
    "label_text.csv": (15, 600, 200, {}),
    "date_stamps.csv": (25, 500, 100, {}),
    "epoch_us.csv": (4, 4000, 2000, {}),
    "micros.csv": (4, 4000, 2000, {"sample_rate_hz": 2000.0}),
    "coarse_clock.csv": (9, 1200, 300.3, {}),
    "units_row.csv": (6, 300, 100, {}),
    "size_line.csv": (64, 200, 50, {"sample_rate_hz": 50.0}),
    "taxel_T1.csv": (4, 500, 100, {"sample_rate_hz": 100.0}),
    "matrix_lines.csv": (16, 120, 50, {"sample_rate_hz": 50.0}),
    "one_file.csv": (64, 844, 100, {"sample_rate_hz": 100.0}),
    "label_int.csv": (6, 600, 200, {}),
    "label_leak/a/0.csv": (4, 200, 100, {}),
}


@pytest.mark.skipif(not TABLES.is_dir(), reason="needs the tables of ../shared")
@pytest.mark.parametrize("name", SHARED)
def test_files_as_people_have_them(name):
    taxels, ticks, rate_hz, config = SHARED[name]
    readout = ReadoutConfig(resolution=2, **config)
    made = encode_samples(TABLES / name, readout, frozenset({"resolution", *config}), {"baseline": "first"})
    assert made.codes.shape == (ticks, taxels)
    assert made.recording.config.sample_rate_hz == pytest.approx(rate_hz, rel=1e-3)
    assert len(made.recording.events) > 0


@pytest.mark.skipif(not TABLES.is_dir(), reason="needs the tables of ../shared")
def test_a_delimiter_at_the_end_changes_no_event():
    first, second = (
        encode_samples(TABLES / f"trailing_{kind}.csv", ReadoutConfig(), frozenset(), {"baseline": "first"})
        for kind in ("comma", "plain")
    )
    assert np.array_equal(first.recording.events, second.recording.events)


@pytest.mark.skipif(not TABLES.is_dir(), reason="needs the tables of ../shared")
def test_a_coarse_clock_is_ignored_on_request():
    options = {"baseline": "first", "time_column": "none", "taxel_columns": "2-10"}
    made = encode_samples(
        TABLES / "coarse_clock.csv", ReadoutConfig(sample_rate_hz=300.0), frozenset({"sample_rate_hz"}), options
    )
    assert len(made.recording.events) == 96_519


def test_cells_are_read_exactly(tmp_path):
    """Hold the numbers of pandas to those of Python."""
    cells = [repr(float(x)) for x in np.random.default_rng(0).normal(size=400) * 10.0 ** np.arange(-200, 200)]
    (tmp_path / "x.csv").write_text("\n".join(["a", *cells]))
    assert read_frame(tmp_path / "x.csv").cells[0].tolist() == [float(cell) for cell in cells]
    assert read_table(tmp_path / "x.csv", Preparation()).values[:, 0].tolist() == [float(cell) for cell in cells]


@pytest.mark.parametrize("name", ["f.png", "f.bag", "f.db3", "f.mcap"])
def test_no_reader_waits_for_a_fifo_that_it_would_open_itself(name: str, tmp_path: Path) -> None:
    os.mkfifo(path := tmp_path / name)
    with pytest.raises(InputError, match=rf"^{path} is a FIFO; give a file$"):
        read_image(path) if name == "f.png" else read_bag(path, "", "")
