"""Test that the tutorial runs, and that its page shows the output."""

import os
import shutil
from pathlib import Path

import pytest

from docs import tutorial_page
from tests.conftest import without_numbers

ROOT = Path(__file__).parents[2]


def test_the_page_shows_what_the_tutorial_prints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not shutil.which("iverilog"):
        missing = "iverilog is not installed: apt-get install iverilog"
        assert not os.environ.get("CI"), missing
        pytest.skip(missing)
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    made, kept = tutorial_page.run(tmp_path), tutorial_page.PAGE.read_text()
    assert without_numbers(made) == without_numbers(kept), "run python docs/tutorial_page.py"
    assert "0 mismatches" in made
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {path.name for path in tutorial_page.PICTURES.glob("*.png")}
    assert len(pictures) == made.count("![") > 3


def test_an_unchanged_tutorial_is_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "tutorial.md"
    page.write_text("# Title\n\n```python\nprint(6 * 7)\n```\n\nThe end.\n\n")
    monkeypatch.setattr(tutorial_page, "PAGE", page)
    monkeypatch.setattr(tutorial_page, "PICTURES", tmp_path / "pictures")

    def made(*options: str) -> tuple[str, str]:
        tutorial_page.main(*options)
        return capsys.readouterr().err, page.read_text()

    first, again = made(), made()
    assert first[0] == "tutorial: cell 1 of 1\n"
    assert "42" in first[1]
    assert again == ("tutorial: unchanged\n", first[1])
    assert made("--again") == first
    page.write_text(first[1].replace("6 * 7", "7 * 7"))
    assert "49" in made()[1]
    assert "42" not in made()[1]
