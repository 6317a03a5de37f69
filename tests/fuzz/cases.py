"""What is done to the files and the options of commands."""

from __future__ import annotations

import functools
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import typer
from hypothesis import strategies as st

from tests.fuzz.run import APPS, Command

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
DEPTH = 200_000

ENCODE = ("encode", "{}", "--rows", "1", "--columns", "4", "--sample-rate", "1000", "-o", "new.npz")
FILES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "events.npz": (
        ("model", ("decode", "{}", "-o", "new.csv")), ("model", ("compare", "{}", "good/events.npz")),
        ("snn", ("convert", "{}", "-o", "new.nir")), ("snn", ("convert", "{}", "-o", "new.npy")),
        ("snn", ("predict", "good/train/weights.npz", "--events", "{}", "-o", "new.json")),
        ("model", ("compare", "good/events.npz", "{}", "--plot", "new.png")),
    ),
    "samples.npy": (("model", ENCODE),),
    "samples.npz": (("model", ENCODE),),
    "samples.csv": (("model", ENCODE),),
    "image.png": (("model", ("encode", "{}", "-o", "new.npz")),),
    "config.json": (("model", ("encode", "good/samples.npz", "--config", "{}", "-o", "new.npz")),),
    "rates.json": (
        ("model", ("power", "--mode", "consistent", "--rates", "{}")),
        ("model", ("explore", "--preset", "paper", "--rates", "{}", "-o", "new")),
    ),
    "synthesis.json": (("model", ("power", "--mode", "consistent", "--synthesis", "{}")),),
    "fig9.json": (("model", ("report", "--accuracy", "{}", "-o", "new.html")),),
    "train/weights.npz": (
        ("snn", ("export", "{}", "-o", "new.nir")), ("snn", ("export", "{}", "--eight-bits", "-o", "new.npz")),
    ),
    "train/result.json": (("snn", ("fig8", "--weights", "good/train/weights.npz", "--result", "{}", "-o", "new")),),
    "network.nir": (("snn", ("import", "{}", "-o", "new.npz")),),
    "events.nir": (("snn", ("convert", "{}", "-o", "new.npz")),),
    "sweep/sweep.json": (("snn", ("fig9", "--sweep", "{}", "-o", "new")),),
}  # fmt: skip
"""The commands that read each file of the corpus, ``{}`` in its place."""

GOOD: dict[str, tuple[str, ...]] = {
    "model encode": ("good/samples.npz", "--rows", "1", "--columns", "4", "-o", "new.npz"),
    "model decode": ("good/events.npz", "-o", "new.csv"),
    "model compare": ("good/events.npz", "good/events.npz"),
    "model rates": ("--dataset", "good/images", "--limit", "1"),
    "model event-rates": ("--dataset", "good/nothing", "-o", "new.json"),
    "model power": (),
    "model fig6": ("-o", "new"),
    "model fig7": ("-o", "new"),
    "model sensitivity": ("-o", "new"),
    "model explore": ("-o", "new"),
    "model frames": ("--dataset", "good/images", "--limit", "1"),
    "model study": ("--data", "good/nothing", "-o", "new"),
    "model report": ("-o", "new.html"),
    "model play": ("good/nothing.npz", "--port", "good/nothing", "-o", "new.npz"),
    "model load": ("good/nothing.npz", "--port", "good/nothing"),
    "model listen": ("--port", "good/nothing", "-o", "new.npz"),
    "model rescue": ("good/nothing.npz.part",),
    "rtl verilog": ("-o", "good/config.json/new"),
    "rtl gates": ("--liberty", "good/nothing.lib"),
    "snn train": ("--events", "good/events", "--folds", "2", "--fold", "9"),
    "snn crossval": ("--events", "good/events", "--folds", "99"),
    "snn sweep": ("--points", "lcs:4,lcs:4", "-o", "new"),
    "snn predict": ("good/train/weights.npz", "--events", "good/events.npz", "-o", "new.json"),
    "snn export": ("good/train/weights.npz", "-o", "new.nir"),
    "snn import": ("good/network.nir", "-o", "new.npz"),
    "snn pair": ("good/sweep/sweep.json:lcs-3", "good/sweep/sweep.json:lcs-3", "-o", "new.json"),
    "snn counts": ("--points", "lcs:2", "--dataset", "good/images", "-o", "new.json"),
    "snn robustness": ("good/nothing", "-o", "new"),
    "snn noise-power": ("good/nothing", "-o", "new"),
    "snn merits": ("good/nothing", "-o", "new"),
    "snn precision": ("good/nothing", "-o", "new"),
    "snn quantise": ("good/train/weights.npz", "-o", "new.npz"),
    "snn cache": (),
    "snn convert": ("good/events.npz", "-o", "new.npy"),
    "snn fig8": ("--weights", "good/train/weights.npz", "-o", "new"),
    "snn fig9": ("--sweep", "good/sweep/sweep.json", "-o", "new"),
    "cocotb_tests soak": ("--sim", "good/nothing", "-o", "new"),
    "cocotb_tests sim": ("--only", "no-such-texture"),
    "cocotb_tests touch": ("--only", "no-such-texture"),
    "cocotb_tests replay": ("--dataset", "good/images", "--only", "no-such-texture"),
}
"""Arguments with which each command ends soon; where it would run long, one of them is refused after all options."""


def commands() -> dict[str, click.Command]:
    """Return every command of the packages by what a user types."""
    found = {}
    for package, app in APPS.items():
        group = typer.main.get_command(app)
        assert isinstance(group, click.Group) or hasattr(group, "commands")
        for name, command in group.commands.items():  # type: ignore[attr-defined]
            found[f"{package} {name}"] = command
    return found


@functools.cache
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
    """A command whose good arguments are followed by one or two options with values that nobody means."""
    name = draw(st.sampled_from(sorted(name for name in GOOD if options_of(name))))
    package, command = name.split()
    arguments = [command, *GOOD[name]]
    flags = {o for p in commands()[name].params if getattr(p, "is_flag", False) for o in p.opts}
    for _ in range(draw(st.integers(1, 2))):
        option = draw(st.sampled_from(options_of(name)))
        value = draw(texts).replace("\0", "")
        if option == "--dataset":
            value = value or "nothing"  # an empty one is the default, whose measurement takes minutes and is right
        arguments += [option] if option in flags else [option, value]
    return Command(package, tuple(arguments))


# -- files -------------------------------------------------------------------------------------------


@st.composite
def damaged(draw: Callable[[Any], Any], good: bytes, name: str) -> bytes:
    """A good file after damage: of bytes, of the values of JSON, of the members of an archive."""
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
    return bytes(
        draw(
            st.sampled_from([b"", b"PK\x05\x06" + bytes(18), b"\x89HDF\r\n\x1a\n", b"{}", b"[]", b"\xff\xfe"])
            | st.binary()
        )
    )


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
    """Change one array of an archive, or the JSON that a member holds."""
    with np.load(io.BytesIO(good), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = draw(st.sampled_from(sorted(arrays)))
    array = arrays[name]
    if array.dtype.kind == "U" and array.ndim == 0 and draw(st.booleans()):
        arrays[name] = np.array(_other_value(draw, str(array).encode()).decode())
    else:
        change: Callable[[Any], Any] = draw(
            st.sampled_from(
                [
                    lambda a: a.reshape(-1)[:0],
                    lambda a: a[None],
                    lambda a: np.resize(a, (max(a.size, 1) + 3,)),
                    lambda a: np.full(a.shape, np.nan),
                    lambda a: np.full(a.shape, np.inf, np.float32),
                    lambda a: np.full(a.shape, -1),
                    lambda a: np.full(a.shape, 2**62),
                    lambda a: np.full(a.shape, "text"),
                    lambda a: np.full(a.shape, 1j),
                    lambda a: np.zeros((2**14, 2**13), np.int8),
                ]
            )
        )
        arrays[name] = change(array)
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


@st.composite
def hostile_files(draw: Callable[[Any], Any], root: Path) -> tuple[Command, str, bytes]:
    """A damaged file, where it goes, and a command that reads it."""
    name = draw(st.sampled_from(sorted(FILES)))
    package, arguments = draw(st.sampled_from(FILES[name]))
    place = f"bad/{Path(name).name}"
    content = draw(damaged((root / "good" / name).read_bytes(), name))
    return Command(package, tuple(place if a == "{}" else a for a in arguments)), place, content
