"""Test the store: results of the same name and code only, also of other runs, and no damaged ones."""

from pathlib import Path

import pytest

from eskin.base.workers.store import Store, store_of


@pytest.mark.parametrize("damage", ["null", "[]", '{"name": 3}', '{"code": "1"}', '{"name": "a", "co', ""])
def test_a_damaged_result_is_computed_anew(tmp_path: Path, damage: str) -> None:
    first = Store(tmp_path / "r.json", "1")
    first.of("a", lambda: 3)
    first.of("b", lambda: {"seconds": [4]})
    kept = store_of(tmp_path / "r.json")
    _, second = filter(None, kept.read_text().splitlines())
    kept.write_text(f"{damage}\n{second}\n")
    again = Store(tmp_path / "r.json", "1")
    assert "a" not in again
    assert again.of("b", lambda: None) == {"seconds": [4]}
    assert "b" not in Store(tmp_path / "r.json", "2")


def test_two_runs_at_the_same_time_share_their_results(tmp_path: Path) -> None:
    first, second = (Store(tmp_path / "r.json", "1") for _ in range(2))
    first.add("a", [1])
    second.add("b", None)
    assert [first.of("b", list), second.of("a", list)] == [None, [1]]


def test_a_line_that_a_crash_has_cut_is_left_out_and_the_next_one_is_whole(tmp_path: Path) -> None:
    Store(tmp_path / "r.json", "1").add("a", 1)
    kept = store_of(tmp_path / "r.json")
    whole = kept.read_bytes()
    for cut in range(len(whole)):
        kept.write_bytes(whole[:cut])
        Store(tmp_path / "r.json", "1").add("b", cut)
        again = Store(tmp_path / "r.json", "1")
        assert ("a" in again, again.of("b", lambda: None)) == (cut == len(whole) - 1, cut)


def test_nothing_is_stored_without_a_file() -> None:
    found = Store(None, "1")
    assert found.of("a", lambda: 1) == found.of("a", lambda: 2) == 1
