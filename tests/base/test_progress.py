"""Test the lines that tell the progress of a command in a log."""

import time

from eskin.base import progress


def test_a_log_gets_a_line_with_a_count_while_a_step_lasts(monkeypatch, capsys):
    monkeypatch.setattr(progress, "SILENCE_S", 0.05)
    with progress.bar("encoding", 3) as step, progress.reported("building"):
        step()
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert "encoding: 1 of 3, 0 s so far" in lines
    assert "building: 0 s so far" in lines


def test_a_display_ends_with_its_other_texts():
    columns = progress.progress_of("first", "second", "third").columns
    assert [getattr(column, "text_format", None) for column in columns] == ["first", *[None] * 3, "second", "third"]


def test_a_finished_or_quick_step_says_nothing(monkeypatch, capsys):
    with progress.bar("quick", 2) as step:
        step()
    monkeypatch.setattr(progress, "SILENCE_S", 0.05)
    with progress.bar("done", 1) as step:
        step()
        time.sleep(0.15)
    with progress.bars() as show:
        show("unknown length", None)
        time.sleep(0.15)
    assert set(capsys.readouterr().err.splitlines()) == {"unknown length: 0, 0 s so far"}
