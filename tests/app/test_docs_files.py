"""Test that the session and the program in docs/guide/files.md give the printed output."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

DOCUMENT = Path(__file__).parents[2] / "docs" / "guide" / "files.md"


def block(language: str) -> str:
    """Return the fenced code block of a language."""
    (text,) = re.findall(rf"```{language}\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    return str(text)


def shape(text: str) -> str:
    """Return a text with every number replaced, because the last digits depend on libraries."""
    return re.sub(r"\d+(\.\d+)?(e\+\d+)?", "#", re.sub(" +", " ", text))


def test_the_session_and_the_program(folder: Path, call: Any) -> None:
    for step in re.split(r"^\$ ", block("console"), flags=re.MULTILINE)[1:]:
        command, _, shown = step.partition("\n")
        if program := re.fullmatch('python -c "(.*)"', command):
            exec(program[1])
            continue
        code, out, err = call(command.removeprefix("eskin "))
        assert (code, err) == (1 if "differ" in shown else 0, ""), command
        told, cut, _ = shown.partition("...\n")
        assert shape(out).startswith(shape(told)) if cut else shape(out) == shape(shown), command
    assert {"brick.npz", "rebuilt.npz", "rebuilt.png", "slow.npz", "both.png"} <= {
        path.name for path in folder.iterdir()
    }
    values: dict[str, Any] = {}
    exec(block("python"), values)
    assert len(values["time_s"]) > 1000
    assert values["time_s"].max() < 1.0
