"""Test that every command checks its output path before any work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from eskin.app.catalogue import MODULES, words_of
from eskin.app.cli import Commands
from eskin.app.options import outputs_of

OUTPUTS = {"-o", "--out", "--keep", "--plot", "--data-out"}
"""Options under which commands take a place to write to."""


def line_of(name: str, given: dict[str, str]) -> str:
    """Return a command line with given options, and "x" for every required one."""
    words = words_of(name)
    for parameter in Commands(MODULES)[name].params:
        if parameter.param_type_name == "argument":
            words += ["x"] * (parameter.required or parameter.nargs != 1)
        elif (option := max(parameter.opts, key=len)) in given:
            words += [option, given[option]]
        elif parameter.required:
            words += [option, "x"]
    return " ".join(words)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_wrong_output_is_refused_before_the_work(name: str, call: Any, folder: Path) -> None:
    (folder / "file").touch()
    (folder / "folder").mkdir()
    command = Commands(MODULES)[name]
    found, outputs = outputs_of(command.callback), [p for p in command.params if OUTPUTS & set(p.opts)]
    assert {str(p.name) for p in outputs} == set(found), "an output without a mark, or a mark on an input"
    for parameter in outputs:
        for place in ("file" if found[str(parameter.name)].folder is True else "folder", "file/x", "/proc/x"):
            if name in ("encode", "report") and place == "folder":
                continue  # it may be one
            code, out, err = call(line_of(name, {max(parameter.opts, key=len): place}))
            assert (code, out, err.count("\n")) == (2, "", 1), (place, err)
            assert err.startswith("error: cannot write "), err
    assert sorted(path.name for path in folder.rglob("*")) == ["file", "folder"]


def test_the_input_is_neither_replaced_nor_searched_for_output(call: Any, folder: Path) -> None:
    (folder / "skin" / "a").mkdir(parents=True)
    (folder / "x.csv").write_text("1,2\n3,4\n")
    (folder / "link.csv").symlink_to("x.csv")
    inside = "it is inside the input skin; choose a folder outside\n"
    for line in (
        "encode skin -o skin/events",
        "train --data skin -o skin",
        "play x --port y --data skin -o skin/e.npz",
    ):
        code, out, err = call(line)
        assert (code, out) == (2, "")
        assert err == f"error: cannot write to {line.split()[-1]}: {inside}"
    assert call("decode x.csv -o link.csv") == (
        2,
        "",
        "error: cannot write x.csv: it is the input; choose another name\n",
    )
