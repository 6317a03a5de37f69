"""Test event files of other programs: AEDAT 4, tables, arrays, address maps, counter overflow."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.foreign import aedat4
from eskin.skin.foreign.aedat4 import read_aedat4, write_aedat4
from eskin.skin.foreign.events import ForeignEvents, take, unwrapped
from tests.conftest import Call

MICROSECONDS = ReadoutConfig(rows=9, columns=12, sample_rate_hz=1000.0, clocks_per_sample=1000)


def recording(config: ReadoutConfig = MICROSECONDS, events: int = 3000, last: int = 90_000) -> Recording:
    draw = np.random.default_rng(4)
    t = np.sort(draw.integers(0, last, events))
    row, column = draw.integers(0, config.rows, events), draw.integers(0, config.columns, events)
    ticks = -(-last // config.clocks_per_sample)
    made = make_events(t, row, column, draw.integers(0, 2, events) > 0)
    return Recording(made, config, ticks * config.clocks_per_sample)


def test_another_library_reads_our_aedat4_and_it_comes_back_whole(folder: Path, call: Call) -> None:
    aedat = pytest.importorskip("aedat", reason="the group exchange is not installed")
    ours = recording()
    ours.save(Path("e.npz"))
    code, output, error = call("convert e.npz -o e.aedat4")
    assert (code, error) == (0, "")
    assert output == "e.aedat4: 3000 events in 0.09 s\n"
    packets = list(aedat.Decoder("e.aedat4"))
    theirs = np.concatenate([packet["events"] for packet in packets])
    for name in "txy":
        assert np.array_equal(theirs[name], ours.events[name])
    assert np.array_equal(theirs["on"], ours.events["p"])
    assert call("convert e.aedat4 -o back.npz")[0] == 0
    back = Recording.load(Path("back.npz"))
    assert (back.config, back.duration_clocks) == (ours.config, ours.duration_clocks)
    assert np.array_equal(back.events, ours.events)


def test_clocks_above_a_megahertz_merge_and_the_loss_is_said(folder: Path) -> None:
    pytest.importorskip("dv_processing", reason="the group exchange is not installed")
    fast = recording(ReadoutConfig(sample_rate_hz=1000.0, clocks_per_sample=4000), last=4000)
    said = write_aedat4(Path("e.aedat4"), fast)
    found = read_aedat4(Path("e.aedat4"))
    assert np.array_equal(found.time, np.rint(fast.events["t"] / 4))
    lost = len(np.unique(fast.events["t"])) - len(np.unique(found.time))
    assert lost > 1000
    assert said == f"{lost} clocks share their time stamp with another and cannot be told apart again"


def test_a_camera_file_needs_a_map_and_takes_one(folder: Path, call: Call) -> None:
    dv = pytest.importorskip("dv_processing", reason="the group exchange is not installed")
    store = dv.EventStore()
    for n in range(100):
        store.push_back(1_700_000_000_000_000 + 10 * n, 100 + n % 2, 200, n % 3 == 0)
    writer = dv.io.MonoCameraWriter("cam.aedat4", dv.io.MonoCameraWriter.EventOnlyConfig("theirs", (346, 260)))
    writer.writeEvents(store)
    del writer
    code, _, error = call("convert cam.aedat4 -o e.npz")
    assert code == 2
    assert (
        "the sensor has 260 x 346 addresses, but a readout has at most 64 x 64; name the taxels with --map FILE"
        in error
    )
    Path("map.csv").write_text("from_x,from_y,x,y\n100,200,1,0\n101,200,0,0\n")
    assert (
        "more than a day after 0; give the time that becomes clock 0 with --start 1700000000000000"
        in call("convert cam.aedat4 -o e.npz --map map.csv")[2]
    )
    code, output, error = call("convert cam.aedat4 -o e.npz --map map.csv --start 1700000000000000 --plot e.png")
    assert code == 0, error
    assert output.startswith("clock 0 is time 1700000000000000 of the file\n")
    made = Recording.load(Path("e.npz"))
    assert made.events.tolist() == [(10 * n, 1 - n % 2, 0, n % 3 == 0) for n in range(100)]
    assert Path("e.png").stat().st_size > 5000
    Path("holes.csv").write_text("from_x,from_y,x,y\n100,200,0,0\n")
    line = "convert cam.aedat4 -o h.npz --map holes.csv --start 1700000000000000"
    assert "50 events have an address that holes.csv does not map; event 1 has (101, 200)" in call(line)[2]
    assert not Path("h.npz").exists()
    assert "50 events without a taxel were left out" in call(f"{line} --drop-unmapped")[1]


@pytest.mark.parametrize("kind", ["csv", "npy"])
@pytest.mark.parametrize("unit", ["us", "clocks"])
def test_every_kind_comes_back_whole(kind: str, unit: str, folder: Path, call: Call) -> None:
    ours = recording()
    ours.save(Path("e.npz"))
    assert call(f"convert e.npz -o e.{kind} --unit {unit}")[0] == 0
    again = f"--time-unit {unit}" if kind == "npy" else ""
    assert call(f"convert e.{kind} -o back.npz --rows 9 --columns 12", again)[0] == 0
    assert np.array_equal(Recording.load(Path("back.npz")).events, ours.events)


def test_columns_are_found_by_name_in_any_order_and_unit(folder: Path, call: Call) -> None:
    wanted = [(0, 1, 0, True), (1500, 0, 0, False), (2000, 1, 1, True)]
    texts = {
        "a.csv": "polarity;row;time [ms];col\n1;0;0;1\n-1;0;1.5;0\n1;1;2;1\n",
        "b.txt": "# by hand\nx y timestamp p note\n1 0 0.0 1 a\n0 0 0.0015 0 b\n1 1 0.002 1 c\n",
        "c.tsv": "on\taddress\tt_us\ntrue\t7\t0\nfalse\t3\t1500\ntrue\t9\t2000\n",
        "f.csv": "t;x;y;p\n0,0;1;0;1\n0,0015;0;0;0\n0,002;1;1;1\n",
        "g.csv": '"t","x","y","p","a, note"\n"0,0","1","0","1","b, c"\n"0,0015",0,0,0,d\n"0,002",1,1,1,e\n',
    }
    for name, text in texts.items():
        Path(name).write_text(text)
    Path("map.csv").write_text("address,x,y\n3,0,0\n7,1,0\n9,1,1\n")
    np.savez("d.npz", x=np.array([1, 0, 1], "u1"), y=[0, 0, 1], t=[0, 1500, 2000], p=[1, 0, 1])
    np.save("e.npy", np.array([[0, 0, 1, 1], [1500, 0, 0, 0], [2000, 1, 1, 1]]))
    more = {"c.tsv": " --map map.csv", "e.npy": " --fields t,y,x,p"}
    for name in (*texts, "d.npz", "e.npy"):
        code, output, error = call(f"convert {name} -o e.npz{more.get(name, '')}")
        assert code == 0, error
        unit = {"a.csv": "ms", "b.txt": "s", "f.csv": "s", "g.csv": "s"}.get(name, "us")
        assert f"array of 2 rows x 2 columns, clock 1e+06 Hz, times in {unit}; --rows" in output
        assert Recording.load(Path("e.npz")).events.tolist() == wanted, name


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        (
            "t,x,y,p\n5,0,0,1\n4,0,0,1\n",
            "",
            "event 1 has time 4, earlier than the previous time 5; if a counter of N bits",
        ),
        ("t,x,y,p\n5,0,0,1\n5,0,0,2\n", "", "polarities are 0 and 1, or -1 and 1; this column has [1, 2]"),
        ("t,x,y,p\n5,-1,0,1\n", "", "event 0 has x = -1, y = 0, outside"),
        ("t,x,y,p\n5,64,0,1\n", "", "the sensor has 1 x 65 addresses, but a readout has at most 64 x 64"),
        ("t,x,y,p\n5,1.5,0,1\n", "", "event 0 has x 1.5, which is not a whole number"),
        ("t,x,y,p\n5,one,0,1\n", "", "event 0 has x 'one', which is not a number"),
        ("t,x,y,p\nnan,0,0,1\n", "", "event 0 has no finite time; remove it"),
        ('t,x,y,p\n"1,500",0,0,1\n"2,000",0,0,1\n', "", "'1,500' may be a decimal comma or separate thousands; write"),
        (f"t,x,y,p\n{2**63},0,0,1\n", "", "the time 9223372036854775808 is beyond 63 bits"),
        ("t,x,y,p\n5,0,0\n", "", "e.csv names 4 columns, but has 3; repair its header"),
        ("t,x,p\n5,0,1\n", "", "no columns x and y, and no address"),
        ("t,address\n5,0\n", "", "one address each; give the taxel of each address with --map FILE"),
        ("time,t,x,y\n5,5,0,1\n", "", "two columns for t"),
        ("5,0,0,1\n", "", "does not name its 4 columns; name them with --fields"),
        ("5,0,0,1\n", " --fields t,x,y", "--fields names 3 columns, but e.csv has 4"),
        ("5,0,0,1\n", " --fields t,x,y,q", "--fields names 'q'"),
        ("t,x,y\n5,0,0\n", " --encoding nlcs --drop-unmapped", "--drop-unmapped leaves out addresses that a map lacks"),
        ("t,x,y,p\n5,0,0,0\n", " --encoding nlcs", "the file has OFF events, but encoding nlcs sends none"),
        ("t,x,y\n500,0,0\n", " --wrap 8", "time stamps reach 500, beyond a counter of 8 bits"),
        ("t,x,y\n5,0,0\n", " --time-unit min", "--time-unit must be s, ms, us, ns or clocks, not 'min'"),
        ("t,x,y\n", "", "e.csv holds no events below its header"),
    ],
)
def test_a_doubtful_table_is_refused(text: str, options: str, sentence: str, folder: Path, call: Call) -> None:
    Path("e.csv").write_text(text)
    code, _, error = call(f"convert e.csv -o e.npz{options}")
    assert code == 2
    assert sentence in error
    assert not Path("e.npz").exists()


def test_unsorted_events_are_sorted_by_time_and_keep_their_order_at_equal_times(folder: Path, call: Call) -> None:
    Path("e.csv").write_text("t,x,y,p\n9,2,0,1\n5,1,1,0\n5,0,1,1\n7,0,0,0\n")
    code, _, error = call("convert e.csv -o e.npz --sort --start 0 --sample-rate 1e6 --clocks-per-sample 1")
    assert code == 0, error
    assert Recording.load(Path("e.npz")).events.tolist() == [(5, 1, 1, 0), (5, 0, 1, 1), (7, 0, 0, 0), (9, 2, 0, 1)]


def test_options_of_foreign_events_are_refused_for_ours(folder: Path, call: Call) -> None:
    recording().save(Path("e.npz"))
    for option in ("--map x.csv", "--sort", "--rows 3", "--wrap 32"):
        code, _, error = call(f"convert e.npz -o f.npz {option}")
        assert code == 2
        assert f"{option.split()[0]} is for foreign events" in error


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,b\n1,2\n", "an address map has address,x,y or from_x,from_y,x,y"),
        ("address,x,y\n1,0,zero\n", "line 2: '1,0,zero' is not 3 whole numbers"),
        ("address,x,y\n1,0,0\n1,0,1\n", "line 3: address 1 occurs twice"),
        ("address,x,y\n1,0,0\n2,0,0\n", "gives two addresses for taxel (0, 0)"),
        ("address,x,y\n1,64,0\n", "taxel (64, 0) is outside 0..63"),
        ("address,x,y\n", "maps no address"),
        ("from_x,from_y,x,y\n0,0,0,0\n", "maps from_x, but the events have address"),
    ],
)
def test_a_doubtful_map_is_refused(text: str, sentence: str, folder: Path, call: Call) -> None:
    Path("e.csv").write_text("t,address\n5,1\n")
    Path("map.csv").write_text(text)
    code, _, error = call("convert e.csv -o e.npz --map map.csv")
    assert code == 2
    assert sentence in error


@given(st.lists(st.integers(0, 250), min_size=1, max_size=300), st.integers(9, 12))
def test_wraps_are_undone(steps: list[int], bits: int) -> None:
    whole = np.cumsum(steps)
    zeros = np.zeros((len(whole), 2), np.int64)
    counter = ForeignEvents(whole % 2**bits, "us", zeros, np.ones(len(whole), bool))
    found = unwrapped(counter, bits).time
    assert np.array_equal(found - found[0], whole - whole[0])


def test_times_between_clocks_are_counted() -> None:
    events = ForeignEvents(np.array([0.0, 0.0014, 0.0016, 0.002]), "s", np.zeros((4, 2), np.int64), np.ones(4, bool))
    taken = take(events, ReadoutConfig(rows=1, columns=1, sample_rate_hz=1000.0, clocks_per_sample=1))
    assert taken.recording.events["t"].tolist() == [0, 1, 2, 2]
    assert (taken.moved, taken.merged) == (2, 1)
    assert taken.said() == ["2 events were moved to the nearest clock of 1000 Hz; 1 share one now"]


EVENTS = Path(__file__).resolve().parents[2].parent / "shared/data/tables/events"
"""Five events in the layouts of public tools."""


@pytest.mark.skipif(not EVENTS.is_dir(), reason="needs the tables of ../shared")
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("v2e_float.npy", "--fields t,y,x,p"),
        ("savetxt.txt", "--fields t,x,y,p"),
        ("esim.txt", "--fields t,x,y,p"),
        ("arrays_float.npz", ""),
    ],
)
def test_whole_numbers_stored_as_floats_are_addresses(name: str, options: str, folder: Path, call: Call) -> None:
    code, _, error = call(f"convert {EVENTS / name} -o e.npz {options}")
    assert code == 0, error
    wanted = [(12, 3, 1, True), (40, 3, 1, False), (55, 0, 2, False), (81, 1, 0, True), (123, 2, 2, True)]
    assert Recording.load(Path("e.npz")).events.tolist() == wanted


def test_nanoseconds_since_1970_lose_nothing(folder: Path, call: Call) -> None:
    start = 1_709_647_629_500_012_000
    times = [start + step for step in (0, 28_000, 43_001)]
    Path("e.csv").write_text("x,y,timestamp,polarity\n" + "".join(f"3,1,{time},1\n" for time in times))
    line = f"convert e.csv -o e.npz --time-unit ns --start {start} --clocks-per-sample 1000000 --sample-rate 1000"
    code, output, error = call(line)
    assert code == 0, error
    assert Recording.load(Path("e.npz")).events["t"].tolist() == [0, 28_000, 43_001]
    assert f"clock 0 is time {start} of the file" in output
    assert "not 'noon'" in call("convert e.csv -o f.npz --time-unit ns --start noon")[2]


def test_stamps_beyond_63_bits_do_not_wrap(folder: Path, call: Call) -> None:
    np.savez("e.npz", t=np.array([2**64 - 5], np.uint64), x=[0], y=[0], p=[1])
    code, _, error = call("convert e.npz -o f.npz")
    assert code == 2
    assert "the time 18446744073709551611 is beyond 63 bits" in error


@pytest.mark.parametrize(("suffix", "version"), [("raw", "evt2"), ("raw", "evt3"), ("dat", "dat2"), ("es", None)])
def test_files_of_cameras_are_read(suffix: str, version: str | None, folder: Path, call: Call) -> None:
    """Read files that faery, a library of others, wrote."""
    faery = pytest.importorskip("faery", reason="the group files is not installed")
    ours = recording()
    theirs = np.zeros(len(ours.events), faery.EVENTS_DTYPE)
    for field in "txy":
        theirs[field] = ours.events[field]
    theirs["on"] = ours.events["p"]
    stream = faery.events_stream_from_array(theirs, dimensions=(12, 9))
    stream.to_file(f"e.{suffix}", version=version)
    code, _, error = call(f"convert e.{suffix} -o e.npz")
    assert code == 0, error
    made = Recording.load(Path("e.npz"))
    assert (made.config.rows, made.config.columns) == (9, 12)
    wanted = np.sort(ours.events, order=["t", "x", "y"])
    if suffix == "es":  # its times count from the first event
        wanted["t"] -= wanted["t"][0]
    assert np.array_equal(np.sort(made.events, order=["t", "x", "y"]), wanted)
    Path(f"cut.{suffix}").write_bytes(b"% evt 9.0\n")
    assert f"cut.{suffix} is damaged or not a .{suffix} file of events" in call(f"convert cut.{suffix} -o f.npz")[2]


def test_cut_and_damaged_aedat4_is_one_sentence(folder: Path) -> None:
    pytest.importorskip("dv_processing", reason="the group exchange is not installed")
    write_aedat4(Path("e.aedat4"), recording())
    whole = Path("e.aedat4").read_bytes()
    for length in (14, 17, 30, 500, 1000, len(whole) // 2, len(whole) - 1000):
        Path("cut.aedat4").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"^cut.aedat4 is (cut off|damaged)"):
            read_aedat4(Path("cut.aedat4"))
    place = 14 + 4 + int.from_bytes(whole[14:18], "little")
    for at in (18, 26, place + 4, place + 30):
        Path("bad.aedat4").write_bytes(whole[:at] + b"\xff" * 16 + whole[at + 16 :])
        with pytest.raises(InputError, match=r"^bad.aedat4 is "):
            read_aedat4(Path("bad.aedat4"))


def test_aedat4_that_hangs_its_library_ends(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("dv_processing", reason="the group exchange is not installed")
    write_aedat4(Path("e.aedat4"), recording())
    monkeypatch.setattr(aedat4, "START_S", 0.001)
    with pytest.raises(InputError, match=r"^e.aedat4 is damaged: its events cannot be read in 0 s"):
        read_aedat4(Path("e.aedat4"))


def test_a_field_with_a_shape_is_refused(folder: Path, call: Call) -> None:
    np.save("e.npy", np.zeros(3, [("t", "<i8", 2), ("x", "<i8"), ("y", "<i8"), ("p", "?")]))
    assert call("convert e.npy -o e.npz")[::2] == (
        2,
        "error: e.npy: an event has t of shape (2,), not one number\n",
    )


def test_a_header_with_a_wrong_version_or_absurd_clocks_is_refused(folder: Path) -> None:
    good = recording()
    header = good._header()
    for wrong in ({"format_version": 1.0}, {"format_version": True}, {"duration_clocks": 10**18}):
        text = np.array(json.dumps(header | wrong))
        np.savez("e.npz", events=good.events, metadata=text)
        with pytest.raises(InputError, match=r"has format version (1.0|True)|duration_clocks 10{18} are more than"):
            Recording.load("e.npz")
