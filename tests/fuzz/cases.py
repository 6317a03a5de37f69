"""Random damage to the files and options of commands."""

import functools
import io
import json
import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from hypothesis import strategies as st

from eskin.app.catalogue import COMMANDS, words_of
from eskin.app.cli import Commands
from tests.fuzz.run import Command

HOSTILE_TEXT = (
    "", " ", "-1", "0", "1", "1.5", "true", "null", "nan", "inf", "-inf", "1e308", "1e-320", "1e400", "9" * 40,
    "0x10", "1_000", "'", '"; touch planted', "$(touch planted)", "a" * 5000, "\x1b[31mred", "\u00e9" * 3, "..", "/",
    "/dev/null", "/dev/full", "good", "good/config.json", "good/events", "good/nothing.npz", "lcs", "nlcs", "cw-lcs",
    "a,b", "lcs:6,lcs:6", "a=b", "=",
)  # fmt: skip
HOSTILE_JSON = (
    None, True, False, -1, 0, 1.5, 1e308, 10**400, float("nan"), float("inf"), "", "x" * 5000, "\x1b[31m", [], {}, [[]],
    ["a", "a"], "NaN", "1", 2**63, -(2**63),
)  # fmt: skip
HOSTILE_NUMBERS = (np.nan, np.float32(np.inf), -1, 2**62, "text", 1j)
DEPTH = 200_000

LISTED = tomllib.loads(Path(__file__).with_name("commands.toml").read_text())
FILES = {file: [tuple(line.split()) for line in lines] for file, lines in LISTED.items()}
GOOD = {name: tuple(found.fuzz.split()) for name, found in COMMANDS.items() if found.fuzz is not None}


@functools.cache
def commands() -> dict[str, click.Command]:
    """Return every fuzzed command by name."""
    return dict(Commands(GOOD))


def options_of(name: str) -> list[str]:
    """Return the long options of a command."""
    return [
        option
        for parameter in commands()[name].params
        for option in parameter.opts
        if option.startswith("--") and option not in ("--help", "--workers", "--scheduler")
    ]


# -- options -----------------------------------------------------------------------------------------

texts = st.sampled_from(HOSTILE_TEXT) | st.text(max_size=12) | st.integers().map(str) | st.floats().map(str)


@st.composite
def hostile_commands(draw: Callable[[Any], Any]) -> Command:
    """Return a valid command with one or two additional options of random value."""
    name = draw(st.sampled_from(sorted(name for name in GOOD if options_of(name))))
    arguments = [*words_of(name), *GOOD[name]]
    flags = {o for p in commands()[name].params if getattr(p, "is_flag", False) for o in p.opts}
    for _ in range(draw(st.integers(1, 2))):
        option = draw(st.sampled_from(options_of(name)))
        value = draw(texts).replace("\0", "")
        if option == "--dataset":
            value = value or "nothing"  # an empty one is the default, whose measurement takes minutes and is right
        arguments += [option] if option in flags else [option, value]
    return tuple(arguments)


# -- files -------------------------------------------------------------------------------------------


@st.composite
def damaged(draw: Callable[[Any], Any], good: bytes, name: str) -> bytes:
    """Return a valid file after damage to its bytes, JSON values or archive members."""
    kinds: list[Callable[..., Any]] = [_cut, _flipped, _foreign]
    if name.endswith(".json"):
        kinds += [_other_value] * 5 + [_deep]
    if name.endswith(".npz"):
        kinds += [_other_member] * 5
    if name.endswith(".csv"):
        kinds += [_other_cell] * 3
    return bytes(draw(st.sampled_from(kinds))(draw, good))


def _cut(draw: Callable[[Any], Any], good: bytes) -> bytes:
    return good[: draw(st.integers(0, len(good) - 1))]


def _flipped(draw: Callable[[Any], Any], good: bytes) -> bytes:
    changed = bytearray(good)
    for _ in range(draw(st.integers(1, 8))):
        changed[draw(st.integers(0, len(good) - 1))] = draw(st.integers(0, 255))
    return bytes(changed)


def _foreign(draw: Callable[[Any], Any], good: bytes) -> bytes:
    heads = [b"", b"PK\x05\x06" + bytes(18), b"\x89HDF\r\n\x1a\n", b"{}", b"[]", b"\xff\xfe"]
    return bytes(draw(st.sampled_from(heads) | st.binary()))


def _deep(draw: Callable[[Any], Any], good: bytes) -> bytes:
    return draw(st.sampled_from([b"[", b'{"a":'])) * DEPTH


def _other_value(draw: Callable[[Any], Any], good: bytes) -> bytes:
    content = json.loads(good)
    places = list(_places(content))
    for _ in range(draw(st.integers(1, 2))):
        parent, key = draw(st.sampled_from(places))
        if draw(st.booleans()) or isinstance(parent, list):
            parent[key] = draw(st.sampled_from(HOSTILE_JSON))
        else:
            parent.pop(key, None)
    return json.dumps(content).encode()


def _places(content: Any) -> Any:
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in items:
        yield content, key
        if isinstance(value, dict | list) and len(value) < 300:
            yield from _places(value)


def _other_member(draw: Callable[[Any], Any], good: bytes) -> bytes:
    """Change one array of an archive, or JSON in a member."""
    with np.load(io.BytesIO(good), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = draw(st.sampled_from(sorted(arrays)))
    array = arrays[name]
    if array.dtype.kind == "U" and array.ndim == 0 and draw(st.booleans()):
        arrays[name] = np.array(_other_value(draw, str(array).encode()).decode())
    else:
        others = [array.reshape(-1)[:0], array[None], np.resize(array, (max(array.size, 1) + 3,))]
        others += [np.zeros((2**14, 2**13), np.int8), *(np.full(array.shape, value) for value in HOSTILE_NUMBERS)]
        arrays[name] = others[draw(st.integers(0, len(others) - 1))]
    if draw(st.integers(0, 5)) == 0:
        arrays.pop(name)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, array in arrays.items():
            data = io.BytesIO()
            np.lib.format.write_array(data, np.asanyarray(array), allow_pickle=False)
            archive.writestr(f"{member}.npy", data.getvalue())
    return made.getvalue()


def _other_cell(draw: Callable[[Any], Any], good: bytes) -> bytes:
    lines = [line.split(",") for line in good.decode().splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        line = draw(st.sampled_from(lines))
        line[draw(st.integers(0, len(line) - 1))] = draw(st.sampled_from(HOSTILE_TEXT))
    return "\n".join(",".join(line) for line in lines).encode()
