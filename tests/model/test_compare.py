"""Test the comparison of recordings: first difference, unmatched events, pictures, ``eskin compare``."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from eskin.model.address_events import Events, make_events, no_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import AddressEvent, first_difference, unmatched
from eskin.model.events.recording import Recording
from eskin.skin.figures.raster import plot_comparison, plot_signals

CONFIG = ReadoutConfig(rows=3, columns=5)


def ten_events() -> Events:
    return make_events(np.arange(10) * 7, np.arange(10) % 3, np.arange(10) % 5, np.arange(10) % 2 == 0)


def random_events(n: int, seed: int = 0, clocks: int = 10**6) -> Events:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, clocks, n))
    return make_events(t, rng.integers(0, 3, n), rng.integers(0, 5, n), rng.integers(0, 2, n) > 0)


# -- first difference --------------------------------------------------------------------------------


def test_equal_recordings_have_no_difference() -> None:
    assert first_difference(ten_events(), ten_events()) is None
    assert first_difference(no_events(), no_events()) is None


@pytest.mark.parametrize(
    ("field", "value", "name"),
    [("t", 36, "clock"), ("y", 0, "row"), ("x", 4, "column"), ("p", True, "polarity")],
)
def test_finds_the_field_that_differs(field: str, value: int, name: str) -> None:
    a, b = ten_events(), ten_events()
    b[field][5] = value
    difference = first_difference(a, b)
    assert difference.index == 5
    assert difference.fields == (name,)
    assert difference.a == AddressEvent(35, 2, 0, False)
    assert difference.start == 2
    assert len(difference.context_a) == 7


def test_description_shows_three_events_around() -> None:
    a = ten_events()
    b = np.delete(a, 4)
    difference = first_difference(a, b)
    assert difference.describe().splitlines() == [
        "event 4 differs in clock, row, column, polarity: "
        "expected clock 28, row 1, column 4, ON; got clock 35, row 2, column 0, OFF",
        "",
        "      event   expected                       got",
        "          1   t 7  (1, 1)  OFF               t 7  (1, 1)  OFF",
        "          2   t 14  (2, 2)  ON               t 14  (2, 2)  ON",
        "          3   t 21  (0, 3)  OFF              t 21  (0, 3)  OFF",
        ">         4   t 28  (1, 4)  ON               t 35  (2, 0)  OFF",
        "!         5   t 35  (2, 0)  OFF              t 42  (0, 1)  ON",
        "!         6   t 42  (0, 1)  ON               t 49  (1, 2)  OFF",
        "!         7   t 49  (1, 2)  OFF              t 56  (2, 3)  ON",
    ]


# -- counts and unmatched events ---------------------------------------------------------------------


few_events = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, 1), st.integers(0, 1), st.booleans()), max_size=12
).map(lambda rows: make_events(*(list(c) for c in zip(*sorted(rows), strict=True))) if rows else no_events())


@given(a=few_events, b=few_events)
def test_unmatched_is_the_difference_of_the_multisets(a: Events, b: Events) -> None:
    alone_a, alone_b = unmatched(a, b)
    all_a, all_b = Counter(a.tolist()), Counter(b.tolist())
    assert Counter(a[alone_a].tolist()) == all_a - all_b
    assert Counter(b[alone_b].tolist()) == all_b - all_a


# -- pictures ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n_a", "n_b", "suffix"), [(0, 0, "png"), (0, 1, "svg"), (30_000, 29_000, "png")])
def test_draws_any_number_of_events_reproducibly(n_a: int, n_b: int, suffix: str, tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.{suffix}" for name in ("a", "b")]
    a, b = random_events(n_a), random_events(max(n_a, n_b))[:n_b]
    for path in paths:
        plot_comparison((a, b), CONFIG, path, title="title")
    assert paths[0].stat().st_size > 5000
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert sorted(tmp_path.iterdir()) == paths


@pytest.mark.parametrize(("rows", "columns", "encoding"), [(1, 1, "nlcs"), (64, 64, "lcs")])
def test_draws_any_array(rows: int, columns: int, encoding: str, tmp_path: Path) -> None:
    config = ReadoutConfig(rows=rows, columns=columns, encoding=encoding)  # type: ignore[arg-type]
    events = make_events(np.arange(100), np.arange(100) % rows, np.arange(100) % columns)
    signal = np.zeros((20, config.taxels))
    plot_comparison((events, events), config, tmp_path / "a.png", signal=signal, texture=np.zeros((9, 40), np.uint8))
    plot_signals(events, signal, config, tmp_path / "b.png")
    assert Image.open(tmp_path / "a.png").height > Image.open(tmp_path / "b.png").height


def test_every_mismatch_shows_in_black(tmp_path: Path) -> None:
    def black_pixels(b: Events) -> int:
        plot_comparison((a, b), CONFIG, tmp_path / "a.png", labels=("", ""))
        picture = np.asarray(Image.open(tmp_path / "a.png").convert("RGB")).astype(int)
        return int((picture.sum(axis=2) == 0).sum())

    a = random_events(200)
    one, two = a.copy(), a.copy()
    one["p"][100] ^= True
    two["p"][[30, 160]] ^= True
    assert black_pixels(two) > black_pixels(one) > black_pixels(a)


# -- the command ---------------------------------------------------------------------------------------


def two_recordings(folder: Path) -> None:
    config = ReadoutConfig(rows=2, columns=2)
    events = make_events([1, 5, 9], [0, 1, 1], [1, 0, 1], [True, False, True])
    Recording(events, config, 100).save(folder / "a.npz")
    Recording(events[:2], config.replace(link="four_phase"), 90).save(folder / "b.npz")


def test_equal_files(call: Any, folder: Path) -> None:
    two_recordings(folder)
    assert call("compare a.npz a.npz --plot a.png") == (0, "equal: 3 events\n", "")
    assert (folder / "a.png").exists()


@pytest.mark.command("compare")
def test_different_files(call: Any, folder: Path) -> None:
    two_recordings(folder)
    code, out, err = call("compare a.npz b.npz --plot a.png")
    assert (code, err) == (1, "")
    assert out.splitlines() == [
        "link differs: a.npz stream; b.npz four_phase",
        "duration_clocks differs: a.npz 100; b.npz 90",
        "event 2 differs: a.npz clock 9, row 1, column 1, ON; b.npz nothing more",
        "",
        "      event   a.npz                          b.npz",
        "          0   t 1  (0, 1)  ON                t 1  (0, 1)  ON",
        "          1   t 5  (1, 0)  OFF               t 5  (1, 0)  OFF",
        ">         2   t 9  (1, 1)  ON                -",
        "",
        "a.npz has 3 events, b.npz 2",
        "the number of events differs in 1 of 4 taxels",
        "                                             ",
        "  row   column   a.npz   b.npz   difference  ",
        " ─────────────────────────────────────────── ",
        "    1        1       1       0           -1  ",
        "                                             ",
    ]
    assert (folder / "a.png").exists()


def test_order_alone_makes_a_difference(call: Any, folder: Path) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    Recording(make_events([1, 2], 0, [0, 1]), config, 9).save(folder / "[a].npz")
    Recording(make_events([1, 2], 0, [1, 0]), config, 9).save(folder / "b.npz")
    code, out, _ = call("compare [a].npz b.npz")
    assert code == 1
    assert out.endswith("every taxel has equally many events in both files\n")


def test_arrays_of_different_size(call: Any, folder: Path) -> None:
    Recording(make_events([1], 0, 3), ReadoutConfig(rows=1, columns=4), 9).save(folder / "[a].npz")
    Recording(make_events([1], 4, 0), ReadoutConfig(rows=5, columns=1, encoding="nlcs"), 9).save(folder / "b.npz")
    code, out, err = call("compare [a].npz b.npz --plot p.svg")
    assert (code, err) == (1, "")
    assert "rows differs: [a].npz 1; b.npz 5\n" in out
    assert "  row   column   [a].npz   b.npz   difference" in out
    assert (folder / "p.svg").exists()


def test_many_differing_taxels_are_cut(call: Any, folder: Path) -> None:
    n = np.arange(64)
    Recording(make_events(n, n // 8, n % 8), ReadoutConfig(), 99).save(folder / "a.npz")
    Recording(make_events([], 0, 0), ReadoutConfig(), 99).save(folder / "b.npz")
    code, out, _ = call("compare a.npz b.npz")
    assert code == 1
    assert "the number of events differs in 64 of 64 taxels\n" in out
    assert "and 32 more" in out


def test_files_of_one_name_are_told_apart(call: Any, folder: Path) -> None:
    two_recordings(folder)
    (folder / "sub").mkdir()
    (folder / "b.npz").rename("sub/a.npz")
    _, out, _ = call("compare a.npz sub/a.npz")
    assert out.startswith("link differs: a.npz stream; sub/a.npz four_phase\n")


def test_compare_refuses(refuses: Any, folder: Path) -> None:
    two_recordings(folder)
    refuses("error: cannot read none.npz: No such file or directory\n", "compare a.npz none.npz")
    refuses("error: Missing argument 'B'; eskin compare --help explains it\n", "compare a.npz")
    sentence = "error: pictures end in .png, .pdf, .svg, but a.txt does not; rename the output\n"
    refuses(sentence, "compare a.npz b.npz --plot a.txt")
