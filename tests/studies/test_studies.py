"""Test that every figure of the documents has a line that draws it, and that the studies run from stored data."""

import re
import runpy
import shlex
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from eskin.app.catalogue import COMMANDS
from eskin.base.errors import InputError
from studies.study import ROOT, Result, run

LIST = ROOT / "studies" / "README.md"
FIGURES = ROOT / "docs" / "figures"
HELPERS = {"drawing", "networks", "study"}
STUDIES = sorted(path.stem for path in LIST.parent.glob("*.py") if path.stem not in {"__init__", *HELPERS})
STORED = ("faults", "robustness", "precision", "noise_power", "merits", "frontier")
"""Studies whose computation takes hours or needs trained networks; they draw the published data."""


def lines() -> dict[str, str]:
    """Return the line that draws each figure, by its pattern below ``docs/figures``."""
    rows = re.findall(r"^\| (`[^|]*`) \| `(.*)` \|$", LIST.read_text(), re.MULTILINE)
    return {pattern: line for patterns, line in rows for pattern in re.findall(r"`([^`]+)`", patterns)}


def shown() -> set[Path]:
    """Return the figures that pages show."""
    found = set()
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for place in re.findall(r'!\[[^\]]*\]\(([^)]+)\)|<img[^>]*?src="([^"]+)"', page.read_text()):
            found.add((page.parent / "".join(place)).resolve())
    return found


def test_every_figure_that_a_page_shows_has_its_line() -> None:
    listed = {pattern: set(FIGURES.glob(pattern)) for pattern in lines()}
    assert all(listed.values()), [pattern for pattern, paths in listed.items() if not paths]
    assert len(shown()) > 20
    assert shown() <= set.union(*listed.values())


def test_every_line_names_a_program_or_a_target() -> None:
    for line in set(lines().values()):
        program, *words = shlex.split(line.split(" && ")[-1])
        if program == "cp":
            program, *words = shlex.split(line.split(" && ")[0])
        if program == "make":
            assert words[0] in COMMANDS
        else:
            assert (program, words[0]) == (".venv/bin/python", "-m")
            assert find_spec(words[1]), line


@pytest.mark.parametrize("name", STUDIES)
def test_each_study_explains_itself(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    monkeypatch.delitem(sys.modules, f"studies.{name}", raising=False)
    with pytest.raises(SystemExit) as left:
        runpy.run_module(f"studies.{name}", run_name="__main__")
    assert left.value.code == 0
    assert f"usage: python -m studies.{name} [-h] [--out DIR]" in capsys.readouterr().out


@pytest.mark.parametrize("name", STORED)
def test_figures_are_drawn_from_stored_data(name: str, folder: Path) -> None:
    result = import_module(f"studies.{name}").RESULT
    assert result.long
    (folder / "data").symlink_to(ROOT / "docs" / "data")
    (figure,) = result.make(name, folder)
    assert figure == folder / "figures" / f"{name}.png"
    assert figure.read_bytes()[:4] == b"\x89PNG"
    assert figure.stat().st_size > 20_000


def test_a_study_tells_its_files_and_mistakes(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> dict[str, int]:
        raise InputError("there is no network")

    def stop() -> dict[str, int]:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "argv", ["x", "--out", "a"])
    run("x", Result("b/c", lambda: {"found": 3}))
    assert capsys.readouterr().out == "wrote a/data/b/c.json\n"
    text = Path("a/data/b/c.json").read_text()
    assert '"command": "python -m studies.x"' in text
    assert '"found": 3' in text
    for compute, code, words in (
        (fail, 2, "error: there is no network\n"),
        (stop, 130, "stopped; run the study"),
    ):
        with pytest.raises(SystemExit) as left:
            run("x", Result("d", compute))
        assert left.value.code == code
        assert words in capsys.readouterr().err
        assert not Path("a/data/d.json").exists()


def test_a_study_runs_as_the_list_says(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "studies.fig7", "--out", str(tmp_path)], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"wrote {tmp_path}/data/fig7.json", f"wrote {tmp_path}/figures/fig7.png"]
