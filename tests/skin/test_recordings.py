"""Test recordings of a user: time column, taxel columns, clock, scale and losses."""

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.columns import match_columns, read_one
from eskin.skin.recordings.event_files import kept_events
from eskin.skin.recordings.fitting import Fit, with_clock, with_seconds
from eskin.skin.recordings.folder import quality_warnings, read_set, sources_of, write_folder
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.prepare import on_grid, prepare, without_baseline
from eskin.skin.recordings.quality import encoded, measure_quality, pooled
from eskin.skin.recordings.table import Table, read_table
from eskin.skin.recordings.trained_on import OwnReadout
from eskin.skin.samples import array_of
from tests.skins import counts, write_csv, write_skin

FIRST = Preparation(baseline="first")


class FirstTwo(Fit):
    """Learn from the first two recordings."""

    def learned(self, names, classes, groups):
        return np.arange(2)


def table_of(folder: Path, text: str, options: Preparation | None = None):
    (folder / "x.csv").write_text(text)
    return read_table(folder / "x.csv", options or Preparation())


# -- tables ------------------------------------------------------------------------------------------


COMMAS = "t;a;b\n0,00;1,5;2\n0,10;2,5;3\n0,20;0,5;-4\n"
QUOTED = '"t","a, left","b"\n"0,00","1,5","2"\n"0,10","2,5","3"\n"0,20","0,5","-4"\n'


@pytest.mark.parametrize(
    ("text", "options", "names"),
    [(COMMAS, {}, "a b"), (COMMAS, {"delimiter": ";"}, "a b"), (COMMAS, {"decimal": "comma"}, "a b")]
    + [(QUOTED, {}, "a,_left b")]
    + [(COMMAS.replace(";", "\t"), {}, "a b")]
    + [(COMMAS.replace(",", ".").replace(";", mark), {}, "a b") for mark in (",", ";", " ", "\t")]
    + [(COMMAS.replace(",", ".").replace(";", "|"), {"delimiter": "|"}, "a b")],
)
def test_any_delimiter_quotes_and_decimal_commas_are_read(tmp_path, text, options, names):
    table = table_of(tmp_path, text, Preparation(**options))
    assert [name.replace(" ", "_") for name in table.names] == names.split()
    assert table.values.tolist() == [[1.5, 2], [2.5, 3], [0.5, -4]]
    assert table.time_s == pytest.approx([0, 0.1, 0.2])


@pytest.mark.parametrize("mark", ["\t", " ", ";", "|"])
def test_a_table_needs_no_header(tmp_path, mark):
    options = Preparation(delimiter=mark if mark == "|" else "")
    text = "1,-2\n3,4\n0,5\n".replace(",", mark)
    assert table_of(tmp_path, text, options).values.tolist() == [[1, -2], [3, 4], [0, 5]]


def test_a_comma_that_may_separate_thousands_is_refused_unless_it_is_said(tmp_path):
    text = '"a","b"\n"1,500","2,250"\n"1,750","2,000"\n'
    with pytest.raises(InputError, match=r"the comma in '1,500' may be .*; add --decimal comma, or remove"):
        table_of(tmp_path, text)
    assert table_of(tmp_path, text, Preparation(decimal="comma")).values.tolist() == [[1.5, 2.25], [1.75, 2.0]]
    assert table_of(tmp_path, text.replace('"1,7', '"0,7')).values.tolist() == [[1.5, 2.25], [0.75, 2.0]]
    assert table_of(tmp_path, '"a" "b"\n1 "2"\n3 4\n').names == ("a", "b")


@pytest.mark.parametrize(
    ("name", "step", "unit_s"),
    [
        ("time", 0.02857, 1),
        ("time_ms", 28.57, 1e-3),
        ("t [us]", 28571.4, 1e-6),
        ("timestamp", 28.57, 1e-3),
        ("timestamp", 1_000_000, 1e-9),
    ],
)
def test_time_stamps_are_no_taxel_and_give_the_rate(tmp_path, name, step, unit_s):
    rows = "".join(f"{1000 + k * step:.8g},{k % 5},{-k % 7}\n" for k in range(40))
    table = table_of(tmp_path, f"{name},a,b\n{rows}")
    assert table.names == ("a", "b")
    assert table.time_s[0] == 0
    assert 39 / table.time_s[-1] == pytest.approx(1 / (step * unit_s), rel=0.02)
    assert table.notes[0].startswith(f"column {name!r} is used as time stamps, because of its name; --time-column")


def test_time_stamps_and_counters_without_a_name_are_known_by_their_rise(tmp_path):
    rows = "".join(f"{k * 28.57:.2f},{k % 5},{-k % 7}\n" for k in range(40))
    table = table_of(tmp_path, rows)
    assert table.values.shape == (40, 2)
    assert "rises steadily: used as time stamps" in table.notes[0]
    none = table_of(tmp_path, rows, Preparation(time_column="none"))
    assert (none.values.shape, none.time_s) == ((40, 2), None)
    assert "column '1' is left out: it rises steadily" in none.notes[0]
    kept = table_of(tmp_path, rows, Preparation(time_column="none", taxel_columns="1-3"))
    assert (kept.values.shape, kept.time_s) == ((40, 3), None)
    assert table_of(tmp_path, rows, Preparation(time_column="1", time_unit="s")).time_s[1] == pytest.approx(28.57)
    (tmp_path / "x.csv").write_text("".join(f"{k},{k % 5},{-k % 7}\n" for k in range(40)))
    counted, notes = read_one(tmp_path / "x.csv", Preparation())
    assert (counted.values.shape, counted.time_s) == ((40, 2), None)
    assert notes[0] == "column '1' is left out: it counts the samples"


def test_chosen_columns_are_the_taxels(tmp_path):
    text = "t,a,b,c\n" + "".join(f"{k / 10},{k % 3},{k % 5},{k % 7}\n" for k in range(9))
    assert table_of(tmp_path, text, Preparation(taxel_columns="b,4")).names == ("b", "c")
    assert table_of(tmp_path, text, Preparation(taxel_columns="2-3")).names == ("a", "b")
    np.save(tmp_path / "x.npy", np.array([[1.0, 5.0, 2.0], [0.0, 3.0, 4.0]]))
    assert read_table(tmp_path / "x.npy", Preparation()).names == ("1", "2", "3")


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        ("t,a\n0,1\n0,2\n", {}, "x.csv: the time stamp of sample 2 is not later than the previous time stamp"),
        ("t,a\n0,1\n1,2\n2,0\n", {}, "x.csv: the time stamps rise by one; give their unit with --time-unit"),
        ("t\n0\n0.1\n", {}, "x.csv has only time stamps"),
        ("t,a\n0,nan\n0.1,2\n", {}, "x.csv has nan in sample 1, column 'a' (up to 10% of a column"),
        ("t,a\n0,x\n", {}, "x.csv has no column of samples, only t, a; add a column for each taxel"),
        ("t,a\n", {}, "x.csv holds no samples below its header"),
        ("", {}, "x.csv is empty; fetch or record it again"),
        ("a,b,c\n1,2\n", {}, "x.csv names 3 columns, but has 2"),
        ("a,b\n1,2\n", {"taxel_columns": "c"}, "x.csv has no column 'c'; it has 2: a, b"),
        ("a,b\n1,2\n", {"time_column": "7"}, "x.csv has no column '7'"),
        ("a,b\n1,2\n", {"decimal": "comma"}, "a decimal comma needs another delimiter"),
    ],
)
def test_tables_that_cannot_be_read_get_one_sentence(tmp_path, monkeypatch, text, options, sentence):
    monkeypatch.chdir(tmp_path)
    Path("x.csv").write_text(text)
    with pytest.raises(InputError) as refused:
        read_table(Path("x.csv"), Preparation(**options))
    assert sentence in str(refused.value)


@pytest.mark.parametrize(
    "options",
    [
        {"scale": "p0"},
        {"scale": "p100.5"},
        {"scale": "much"},
        {"scale": "0"},
        {"baseline": "mean"},
        {"highpass_hz": -1.0},
    ],
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(InputError, match=next(iter(options)).removesuffix("_hz")):
        Preparation(**options)


# -- preparation -------------------------------------------------------------------------------------


def test_jittering_time_stamps_are_resampled(tmp_path):
    time_s = np.arange(100) / 35 + np.random.default_rng(0).uniform(-0.01, 0.01, 100)
    time_s -= time_s[0]
    rows = "".join(f"{at:.6f},{3 * at:.6f},{math.sin(9 * at):.6f}\n" for at in time_s)
    table = table_of(tmp_path, f"t,line,wave\n{rows}")
    values, moved = on_grid(table, 35.0)
    assert moved
    grid = np.minimum(np.arange(len(values)) / 35, time_s[-1])
    assert values[:, 0] == pytest.approx(3 * grid, abs=1e-4)  # a line stays one, whatever the jitter
    assert np.abs(values[:, 1] - np.interp(grid, time_s, np.sin(9 * time_s))).max() < 1e-4


def test_stamps_of_whole_milliseconds_are_even_and_gaps_are_filled(tmp_path):
    """Read time stamps in whole milliseconds from a sensor of 36 Hz, with one repeated stamp."""
    time_s = np.arange(400) / 35.61
    stamps = np.floor(time_s * 1e3)
    stamps[200] = stamps[199]
    wave = np.abs(200 - np.arange(400))  # straight but for its middle, so that filling in is exact

    def set_of(stamps, cells):
        for name in ("a/0", "b/0"):
            path = tmp_path / f"s/{name}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            rows = [f"{t:.0f},{cell},{k % 7},{k % 5}" for k, (t, cell) in enumerate(zip(stamps, cells, strict=True))]
            path.write_text("ms,x,y,z\n" + "\n".join(rows) + "\n")
        return read_set(tmp_path / "s", FIRST, ReadoutConfig())

    even = set_of(np.floor(time_s * 1e3), wave)
    assert (even.warnings, [note for note in even.notes if "resampled" in note]) == ((), [])
    assert np.array_equal(even.codes[0][:, 0], np.rint((wave - 200) * 2047 / 200))
    twice = set_of(stamps, wave)
    assert any("2 of 2 recordings have uneven time stamps and were resampled" in note for note in twice.notes)
    kept = np.delete(np.arange(400), [50, 51, 300])
    holed = ["" if k in (10, 90) else str(wave[k]) for k in kept]
    found = set_of(np.floor(time_s * 1e3)[kept], holed)
    assert "6 samples are missing in the time stamps of 2 recordings: filled in, linearly" in found.notes
    assert "4 cells of 2 recordings hold no number: filled in, linearly" in found.notes
    ticks = len(found.codes[0])
    assert ticks >= 399
    assert (
        np.abs(found.codes[0][:, 0] - even.codes[0][:ticks, 0]).max() <= 2047 / 200
    )  # a tenth of a step of the stamps


def test_a_taxel_that_alone_is_touched_is_one(tmp_path):
    for number in range(3):
        values = np.random.default_rng(number).integers(-2, 3, (200, 6))
        values[80:120, 2] += 30_000
        write_csv(tmp_path / f"s/tap/{number}.csv", values)
    assert read_set(tmp_path / "s", FIRST, ReadoutConfig()).config.taxels == 6


def test_columns_that_are_no_taxels_are_left_out_and_named(tmp_path):
    for name in ("tap/0", "tap/1", "press/0"):
        values = counts(name.split("/")[0], taxels=12)
        values[:, 1] = 77
        values[:, 2] = np.where(np.arange(len(values)) % 9 < 8, 65535, 40_000)
        values[:, 3] *= 900
        values[:, 4] = 5 * np.arange(len(values))
        write_csv(tmp_path / f"s/{name}.csv", values)
        path = tmp_path / f"s/{name}.csv"
        path.write_text(path.read_text().replace("s0", "proximity1"))
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig())
    assert found.codes[0].shape[1] == found.config.taxels == 7
    assert found.options.taxel_columns == "s5,s6,s7,s8,s9,s10,s11"
    left = [note.removeprefix("column ") for note in found.notes if "is left out" in note]
    assert [note.split("'")[1] for note in left] == ["proximity1", "s1", "s2", "s3", "s4"]
    reasons = (
        "a name that is not that of a taxel",
        "it is 77 in all",
        "it has 89% of its samples at 65535",
        "times those of the others: another unit",
        "it rises",
    )
    assert all(reason in note for reason, note in zip(reasons, left, strict=True)), left
    assert read_set(tmp_path / "s", Preparation(taxel_columns="2-13"), ReadoutConfig()).config.taxels == 12


@pytest.mark.parametrize("baseline", ["first", "median", "highpass"])
def test_a_baseline_is_taken_off_every_taxel(baseline):
    signal = np.array([5e4, -3e4]) + np.concatenate([np.zeros((400, 2)), np.ones((20, 2)), np.zeros((400, 2))])
    rest = without_baseline(signal, 35.0, Preparation(baseline=baseline))
    assert np.abs(rest[:400]).max() < 1e-6
    assert rest[400] == pytest.approx([1, 1], abs=0.02)


def test_a_fixed_offset_a_taxel_keeps_the_level_and_comes_from_the_training_recordings(tmp_path):
    rest = np.array([300, 5000])
    for number, level in enumerate((10, 40, 90)):
        values = rest + level + np.arange(100)[:, None] % 2
        values[50:] -= level  # every recording comes to rest
        values -= 20 * (number == 2)
        values[0] = [0, 9999][number > 0]  # outliers
        write_csv(tmp_path / f"s/press/{number}.csv", values)
    fixed = Preparation(baseline="fixed", scale="0.01")
    found = read_set(tmp_path / "s", fixed, ReadoutConfig(), {"resolution"}, fit=FirstTwo())
    assert found.options.offsets == (300, 5000), "the outlier and the third recording set nothing"
    assert [codes[20].tolist() for codes in found.codes] == [[205, 205], [819, 819], [1434, 1434]]
    again = OwnReadout.of(Recording.load(write_folder(found, tmp_path / "e") and tmp_path / "e/press/2.npz"))
    assert again is not None
    assert again.options.offsets == (300, 5000)
    write_csv(tmp_path / "new/0.csv", rest + 50 + 0 * values)  # at another level: the offsets stay
    assert again.read(tmp_path / "new", flat=True).codes[0][3].tolist() == [1024, 1024]
    with pytest.raises(InputError, match="the fixed baseline has 2 offsets, but the recording has 1 taxels"):
        without_baseline(np.zeros((9, 1)), 35.0, again.options)
    with pytest.raises(InputError, match=r"offsets of the taxels must be finite numbers, not \(nan,\)"):
        Preparation(offsets=(math.nan,))


def test_one_scale_and_one_configuration_hold_for_the_whole_set(tmp_path):
    write_csv(tmp_path / "s/soft/0.csv", counts("press") // 10)
    write_csv(tmp_path / "s/hard/0.csv", counts("press"))
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig())
    peaks = {source.class_name: codes.max() for source, codes in zip(found.sources, found.codes, strict=True)}
    assert peaks["hard"] == 2047
    assert 190 < peaks["soft"] < 220
    assert found.clipped == 0


def test_a_percentile_clips_what_lies_above_it_and_says_so(tmp_path):
    write_skin(tmp_path / "s", each=1)
    found = read_set(tmp_path / "s", Preparation(baseline="first", scale="p90"), ReadoutConfig())
    samples = sum(codes.size for codes in found.codes)
    assert 0.05 * samples < found.clipped < 0.11 * samples
    assert any("are beyond full scale and clipped; try --scale max" in warning for warning in found.warnings)


def test_warnings_say_what_is_there_and_no_more():
    wave = np.sin(np.arange(100.0) / 3)
    said = {"codes": False, "time_s": None, "rate_hz": 35, "notes": (), "named": False, "filled": 0, "start_s": 0.0}
    flat = Table(Path("x.csv"), np.stack([wave, 0 * wave, 0 * wave, 0 * wave], 1), tuple("abcd"), **said)
    found = prepare([flat], Preparation(scale="2"), 12)
    assert found.warnings[0] == "column 'b' (and 2 more) never changes; leave it out with --taxel-columns"
    assert found.warnings[1].startswith(f"{found.clipped / 400:.1%} of the samples are beyond full scale")
    assert 0.1 < found.clipped / 400 < 0.25
    quiet = Table(Path("x.csv"), 100.0 + wave[:, None], ("a",), **said)  # little moves, on little
    assert prepare([quiet], Preparation(scale="0.001"), 12).warnings == ()
    far = Table(Path("x.csv"), np.stack([50 + wave, 50 + np.arange(100) / 100], 1), ("a", "b"), **said)
    rising, left = prepare([far], Preparation(), 12).warnings
    assert rising.startswith("column 'b' rises steadily; if it is time or a counter, name it with --time-column")
    assert left.startswith("the signals have a baseline and use 3.9% of full scale; subtract the baseline with --base")


def test_nlcs_warns_of_what_lies_below_zero(tmp_path):
    write_csv(tmp_path / "s/tap/0.csv", -counts("press"))
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig(encoding="nlcs"), {"encoding"})
    assert any("below zero, which N-LCS cannot represent" in text for text in found.warnings)


# -- configuration -----------------------------------------------------------------------------------


def test_time_constants_mean_the_same_on_every_sensor():
    for rate_hz in (35, 200, 20_000):
        config = ReadoutConfig(sample_rate_hz=rate_hz, encoding="nlcs")
        assert with_seconds(config, ()).tau_s == pytest.approx(0.2, rel=0.05)
        assert with_seconds(config, ("leak_shift",)) == config
    assert with_seconds(ReadoutConfig(encoding="nlcs"), ()) == ReadoutConfig(encoding="nlcs")
    assert with_seconds(ReadoutConfig(encoding="cw-lcs"), ()) == ReadoutConfig(encoding="cw-lcs")
    assert with_seconds(ReadoutConfig(encoding="cw-lcs", sample_rate_hz=2000), ()).window_period == 6
    assert with_seconds(ReadoutConfig(encoding="cw-lcs", sample_rate_hz=35), ()).window_period == 4


@pytest.mark.parametrize(("taxels", "array"), [(16, (4, 4)), (64, (8, 8)), (24, (4, 6)), (7, (1, 7)), (67, None)])
def test_the_array_follows_the_number_of_taxels(taxels, array):
    assert array_of(taxels) == array


def plain_snr_db(codes: np.ndarray, config: ReadoutConfig, events: np.ndarray) -> float:
    """Return the reconstruction SNR of LCS events, computed tick by tick."""
    rebuilt = [[0.0] * config.taxels for _ in codes]
    state = [0.0] * config.taxels
    queue = sorted((int(e["t"]), int(e["y"]) * config.columns + int(e["x"]), 1 if e["p"] else -1) for e in events)
    for tick in range(len(codes)):
        while queue and (queue[0][0] - 3) // config.clocks_per_sample <= tick:
            _, taxel, sign = queue.pop(0)
            state[taxel] += sign * 2 ** (config.sample_bits - 2 - config.resolution)
        rebuilt[tick] = list(state)
    mean = [sum(column) / len(codes) for column in zip(*codes.tolist(), strict=True)]
    signal = sum((x - m) ** 2 for row in codes.tolist() for x, m in zip(row, mean, strict=True))
    noise = sum((x - u) ** 2 for a, b in zip(codes.tolist(), rebuilt, strict=True) for x, u in zip(a, b, strict=True))
    return 10 * math.log10(signal / noise)


def test_events_of_the_first_tick_count_as_late_and_as_load():
    config = ReadoutConfig(rows=1, columns=1, clocks_per_sample=10)
    found = measure_quality(config, np.zeros((3, 1), np.int32), make_events([3, 4, 13], 0, 0, True))
    assert (found.late, found.peak_load) == (3, 0.2)


@pytest.mark.parametrize(("resolution", "given"), [(6, {"clocks_per_sample"}), (8, ())])
def test_the_snr_is_that_of_a_plain_reconstruction(tmp_path, resolution, given):
    write_csv(tmp_path / "s/tap/0.csv", counts("tap"))
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig(resolution=resolution), given)
    recording, quality = found.recording(0)
    assert quality.snr_db == pytest.approx(plain_snr_db(found.codes[0], found.config, recording.events), abs=1e-9)


def test_more_bits_give_a_better_signal_because_the_clock_follows_the_slope(tmp_path):
    write_skin(tmp_path / "s", each=1, taxels=64)
    snr_db: dict[tuple[int, bool], float] = {}
    for resolution in (6, 8):
        for slow in (True, False):
            config = ReadoutConfig(resolution=resolution)
            found = read_set(tmp_path / "s", FIRST, config, {"clocks_per_sample"} if slow else ())
            quality = pooled([found.recording(k)[1] for k in range(3)])
            snr_db[resolution, slow] = quality.snr_db
            warnings = quality_warnings(found.config, found.codes, quality)
            if slow:
                assert quality.peak_load > 0.9
                assert any("the link is too slow" in text and "--clocks-per-sample" in text for text in warnings)
            else:
                assert (quality.late, quality.merged, quality.bound_holds) == (0, 0, True)
                assert not warnings
    assert snr_db[8, True] < snr_db[6, True] < 25  # what a clock of 64 times 35 Hz does: more bits, worse signal
    assert snr_db[6, False] > 35
    assert snr_db[8, False] > snr_db[6, False] + 9


def test_silent_taxels_are_said_and_a_choice_of_the_program_is_not_blamed(tmp_path):
    values = counts("tap", taxels=5)
    values[:, 1:4] = 10_000 + values[:, 1:4] % 3  # noise far below a step
    write_csv(tmp_path / "s/tap/0.csv", values)
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig(resolution=3), {"resolution"})
    _, quality = found.recording(0)
    assert quality.silent == {1, 2, 3}
    said = quality_warnings(found.config, found.codes, quality)
    assert said[0].startswith("3 of 5 taxels send no event; --scale per-taxel ")
    assert any("raise --resolution" in text for text in quality_warnings(found.config, found.codes, noisy(quality)))
    blamed = quality_warnings(found.config, found.codes, noisy(quality), chosen=True)
    assert blamed == ("3 of 5 taxels send no event; --taxel-columns leaves columns out",)
    write_csv(tmp_path / "s/tap/1.csv", values[:, [1, 0, 2, 3, 4]])  # another taxel is touched
    both = pooled([read_set(tmp_path / "s", FIRST, found.config, {"resolution"}).recording(k)[1] for k in range(2)])
    assert both.silent == {2, 3}


def noisy(quality):
    """Return a quality with an SNR of 0 dB."""
    return dataclasses.replace(quality, noise=quality.signal)


def test_the_clock_is_as_slow_as_can_be(tmp_path):
    write_csv(tmp_path / "s/tap/0.csv", counts("tap"))
    found = read_set(tmp_path / "s", FIRST, ReadoutConfig())
    codes, config = found.codes[0], found.config
    half = config.replace(clocks_per_sample=config.clocks_per_sample // 4)
    _, worse = encoded(half, codes)
    assert worse.late + worse.merged > 0
    assert with_clock(config.replace(link="four_phase"), found.codes).clocks_per_sample > config.clocks_per_sample


def test_the_clock_begins_with_what_the_largest_burst_takes():
    config = ReadoutConfig(rows=1, columns=1)
    burst = np.array([[0], [11 * config.step], [0]], np.int32)  # 11 events, and 4 clocks for each of a taxel, and 8
    assert with_clock(config, [burst]).clocks_per_sample == 64
    assert with_clock(config, [2 * burst]).clocks_per_sample == 128


def test_equal_file_names_in_two_classes_stay_apart(tmp_path):
    write_skin(tmp_path / "s", each=2)
    sources, _ = sources_of(tmp_path / "s")
    assert [source.name for source in sources] == [f"{c}/{k}" for c in ("press", "stroke", "tap") for k in (0, 1)]
    assert [source.class_name for source in sources] == ["press"] * 2 + ["stroke"] * 2 + ["tap"] * 2


# -- folders -----------------------------------------------------------------------------------------


def test_folders_that_are_no_set_get_one_sentence(tmp_path):
    with pytest.raises(InputError, match="contains no recordings; put files ending in"):
        sources_of(tmp_path)
    write_csv(tmp_path / "a/0.csv", counts("tap"))
    np.save(tmp_path / "a/0.npy", counts("tap"))
    with pytest.raises(InputError, match="holds a/0 twice, with two endings"):
        sources_of(tmp_path)
    write_csv(tmp_path / "b.csv", counts("tap"))
    with pytest.raises(InputError, match="is beside the class folders"):
        sources_of(tmp_path)


def test_links_pipes_and_folders_named_like_recordings_are_reported_or_refused(tmp_path):
    write_skin(tmp_path / "s", each=1)
    (tmp_path / "elsewhere").mkdir()
    write_csv(tmp_path / "elsewhere/far.csv", counts("tap"))
    (tmp_path / "s/linked").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "s/linked/up").symlink_to(tmp_path / "s")  # a ring
    assert sources_of(tmp_path / "s")[0][0].name == "linked/far"
    (tmp_path / "s/tap/gone.csv").symlink_to("not/fetched.csv")
    os.mkfifo(tmp_path / "s/tap/pipe.npy")
    (tmp_path / "s/tap/folder.csv").mkdir()
    (tmp_path / "s/tap/zero.csv").symlink_to("/dev/zero")
    sources, warnings = sources_of(tmp_path / "s")
    assert len(sources) == 4
    for odd in ("folder.csv is a folder", "gone.csv is a broken link", "pipe.npy is a FIFO", "zero.csv is a device"):
        assert f"s/tap/{odd}" in warnings[0]
    with pytest.raises(
        InputError, match=r"^4 recordings of .*s cannot be read: .*s/tap/folder.csv is a folder; fetch or "
    ):
        sources_of(tmp_path / "s", strict=True)


def test_columns_are_matched_by_name(tmp_path):
    values, options = counts("tap", taxels=3), Preparation(baseline="first")
    for place, order in (("s/a/0.csv", "s0,s1,s2"), ("s/b/0.csv", "s2,s1,s0"), ("t/a/0.csv", "s1,s2,s0")):
        (tmp_path / place).parent.mkdir(parents=True)
        rows = values[:, [int(name[1]) for name in order.split(",")]]
        np.savetxt(tmp_path / place, rows, "%d", delimiter=",", header=order, comments="")
    config = ReadoutConfig(sample_rate_hz=35, rows=1, columns=3)
    given = {"sample_rate_hz", "rows", "columns", "clocks_per_sample"}
    found = read_set(tmp_path / "s", options, config, given)
    assert (found.codes[0] == found.codes[1]).all()
    assert "the column order differs between files: columns are matched by name" in found.notes
    again = OwnReadout.of(found.recording(0)[0]).read(tmp_path / "t")  # as those of a training
    assert (again.codes[0] == found.codes[0]).all()
    (tmp_path / "s/b/0.csv").write_text("s0,s1,x\n3,2,3\n2,3,5\n4,3,2\n")
    with pytest.raises(InputError, match="has the column 'x', the other files s0, s1, s2; rename it, or choose"):
        read_set(tmp_path / "s", options, config, given)
    (tmp_path / "s/b/0.csv").unlink()
    nameless = read_table(tmp_path / "s/a/0.csv", options)
    tables, _ = match_columns([dataclasses.replace(nameless, named=False), nameless], options)
    assert len(tables) == 2, "a file without a header does not end the list"
    with pytest.raises(InputError, match="--taxel-columns s0,s1,1 has s0 twice; name every column once"):
        read_table(tmp_path / "s/a/0.csv", Preparation(taxel_columns="s0,s1,1"))


@pytest.mark.parametrize(
    ("other", "fields", "sentence"),
    [
        ({"taxels": 9}, {}, r"has 16 taxels, .* has 9; choose the same taxels with --taxel-columns"),
        ({"rate_hz": 200}, {}, "has 200 samples/s, but the others have 35; give the rate of all with --sample-rate"),
        ({"rate_hz": 10}, {}, "has 10 samples/s, but the others have 35"),
        (
            {},
            {"rows": 2, "columns": 4},
            "16 taxels, but the array has 2 x 4 = 8; give --rows and --columns, or",
        ),
    ],
)
def test_recordings_of_other_arrays_or_rates_are_refused(tmp_path, other, fields, sentence):
    for name, made in (("a", {}), ("b", other), ("c", {})):
        write_csv(tmp_path / f"s/{name}/0.csv", counts("tap", **made), made.get("rate_hz", 35))
    with pytest.raises(InputError, match=sentence):
        read_set(tmp_path / "s", FIRST, ReadoutConfig(**fields), fields)


def test_event_files_are_kept_by_what_makes_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_skin(tmp_path / "s", each=1, taxels=4)
    made = []

    def kept(**fields):
        done: list[None] = []
        folder, *_ = kept_events(tmp_path / "s", FIRST, ReadoutConfig(**fields), fields, lambda: done.append(None))
        made.append(len(done))
        return folder

    first = kept(resolution=4)
    assert len(list(first.rglob("*.npz"))) == 3
    assert kept(resolution=4) == first
    assert kept(resolution=5) != first
    write_csv(tmp_path / "s/tap/0.csv", counts("tap", taxels=4, seed=99))
    assert kept(resolution=4) != first
    assert made == [3, 0, 3, 3]
    assert len(list((tmp_path / "out/recordings").iterdir())) == 3  # nothing half made beside them


def test_cw_lcs_renders_a_slow_skin_as_well_as_lcs(tmp_path):
    write_skin(tmp_path / "s", each=1)
    found = {
        encoding: pooled([quality for _, _, quality in read_set(tmp_path / "s", FIRST, config, ()).each_recording()])
        for encoding in ("lcs", "cw-lcs")
        if (config := ReadoutConfig(encoding=encoding))
    }
    assert found["cw-lcs"].snr_db > found["lcs"].snr_db - 3  # with windows that close at every sample 20 dB less
