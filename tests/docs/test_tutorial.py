"""Test that the tutorial runs, and that its page shows the output."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def without_numbers(text: str) -> str:
    """Return a text with every number replaced, because the last digits depend on libraries."""
    return re.sub(r"\d+(\.\d+)?", "#", re.sub(" +", " ", text))


@pytest.fixture(autouse=True)
def tools() -> None:
    if not shutil.which("iverilog"):
        missing = "iverilog is not installed: apt-get install iverilog"
        assert not os.environ.get("CI"), missing
        pytest.skip(missing)


def test_the_page_shows_what_the_tutorial_prints(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; sys.path.insert(0, 'docs'); import tutorial_page as page; "
        "(Path(sys.argv[1]) / 'page.md').write_text(page.run(Path(sys.argv[1])))"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    made, kept = (tmp_path / "page.md").read_text(), (ROOT / "docs" / "tutorial.md").read_text()
    assert without_numbers(made) == without_numbers(kept), "run python docs/tutorial_page.py"
    assert "0 mismatches" in made
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {path.name for path in (ROOT / "docs" / "figures" / "tutorial").glob("*.png")}
    assert len(pictures) == made.count("![") > 3


def test_an_unchanged_tutorial_is_not_run_again(tmp_path: Path) -> None:
    page = tmp_path / "tutorial.md"
    page.write_text("# Title\n\n```python\nprint(6 * 7)\n```\n\nThe end.\n\n")
    program = tmp_path / "tutorial_page.py"
    program.write_text((ROOT / "docs" / "tutorial_page.py").read_text())

    def made() -> tuple[str, str]:
        done = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, check=True)
        return done.stderr, page.read_text()

    first, again = made(), made()
    assert first[0] == "tutorial: cell 1 of 1\n"
    assert "42" in first[1]
    assert again == ("tutorial: unchanged\n", first[1])
    page.write_text(first[1].replace("6 * 7", "7 * 7"))
    assert "49" in made()[1]
    assert "42" not in made()[1]
