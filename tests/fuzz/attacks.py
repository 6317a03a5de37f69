"""Attacks on commands, and on the readers and writers below them.

An attack of a command returns its exit code. Others return nothing where the result is right, and raise InputError
where it is refused. All fail otherwise.
"""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.base.outputs import check_folder, file_of
from eskin.base.workers.store import Store, store_of
from eskin.board.config import BoardConfig
from eskin.board.journal import SUFFIX, Journal, convert
from eskin.board.link import Link
from eskin.board.live import View
from eskin.board.records import VERSION, Ack, Class, Event, Lost, RecordWriter, Tag
from eskin.board.serial_frames import Frame, Kind
from eskin.board.session import Received, foreign_events
from eskin.flow.liberty.library import read
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.folder import sources_of
from eskin.skin.samples import SIGNAL_SUFFIXES
from tests.fuzz.cases import FILES, _cut, _flipped, damaged, hostile_commands
from tests.fuzz.corpus import LIBERTY
from tests.fuzz.run import checked

Draw = Callable[[Any], Any]
Attack = Callable[[Draw, Path], int | None]

# -- commands ----------------------------------------------------------------------------------------


def files(draw: Draw, root: Path) -> int | None:
    """Run a command on a damaged file of the corpus."""
    name = draw(st.sampled_from(sorted(FILES)))
    arguments = draw(st.sampled_from(FILES[name]))
    place = root / "bad" / Path(name).name
    clean(root)
    place.parent.mkdir()
    place.write_bytes(draw(damaged((root / "good" / name).read_bytes(), name)))
    return checked(tuple(f"bad/{place.name}" if word == "{}" else word for word in arguments), root)


def options(draw: Draw, root: Path) -> int | None:
    """Run a command with random values of options."""
    command = draw(hostile_commands())
    clean(root)
    code = checked(command, root)
    assert not (root / "planted").exists()
    return code


def clean(root: Path) -> None:
    """Remove all files except the corpus."""
    for path in root.iterdir():
        if path.name != "good":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


# -- cell libraries ----------------------------------------------------------------------------------

TABLE = 'cell_rise (t) { values ("1, 2", "3, 4"); } rise_transition (t) { values ("1, 2", "3, 4"); }'
CELLS = LIBERTY.replace(
    "library (small) {",
    """library (small) { nom_voltage : 1.2; nom_temperature : 25; nom_process : 1; time_unit : "1ns";
  capacitive_load_unit (1, pf); lu_table_template (t) { variable_1 : input_net_transition;
    variable_2 : total_output_net_capacitance; index_1 ("1, 2"); index_2 ("1, 2"); }""",
).replace('function : "!A"; }', f'function : "!A"; timing () {{ related_pin : "A"; {TABLE} }} }}', 1)
WORDS = ("nan", "inf", "-1", "1e308", "1e400", "abc", '""', "()", "(1)", "(1, 2)", "(a, zz)", "1xs", '"1ns"', "true",
         "{", "}", '"A & (B"', '"Z"', "0", "{ }", "x" * 300, '"1, 2"', '"1, x"')  # fmt: skip


def liberty(draw: Draw, root: Path) -> None:
    """Damage a cell library in its words or bytes, and read all its content."""
    text = CELLS
    for _ in range(draw(st.integers(1, 3))):
        words = text.split(" ")
        at = draw(st.integers(0, len(words) - 1))
        action = draw(st.integers(0, 5))
        if action == 0:
            del words[at]
        elif action == 1:
            words.insert(at, words[draw(st.integers(0, len(words) - 1))])
        else:
            words[at] = draw(st.sampled_from(WORDS)) + ";" * words[at].endswith(";")
        text = " ".join(words)
    content = text.encode()
    if draw(st.integers(0, 9)) == 0:
        content = draw(st.sampled_from([_cut, _flipped]))(draw, content)
    path = root / "bad.lib"
    path.write_bytes(content)
    os.utime(path, ns=(0, time.monotonic_ns()))  # a library is read once while it does not change
    found = read(path)
    found.check()
    numbers = [found.voltage_v, found.temperature_c, found.process]
    numbers += [n for cell in found.cells.values() for n in (cell.area_um2, *cell.loads.values())]
    assert np.isfinite(numbers).all(), numbers
    assert min(numbers[3:], default=0) >= 0, numbers
    assert found.voltage_v > 0
    for cell in found.cells.values():
        for pin in cell.pins.values():
            assert all(
                np.isfinite(t.values).all() for arc in pin.arcs for t in (*arc.delay.values(), *arc.slew.values())
            )


# -- boards ------------------------------------------------------------------------------------------

CONFIG = ReadoutConfig(rows=3, columns=4)
GOOD_HELLO = (VERSION, 2, BoardConfig(chip=None).identity, 50_000_000, 512, 4096, 2, 0)
records = st.one_of(
    st.builds(Event, st.integers(0, 1 << 40), st.integers(0, 31) | st.integers(0, 4095)),
    st.builds(Class, st.integers(0, 1 << 40), st.integers(0, 63), st.booleans(), st.tuples(*[st.integers(-9, 9)] * 2)),
    st.builds(Lost, st.integers(0, (1 << 28) - 1)),
    st.builds(Ack, st.integers(0, 255)),
)


class Line(io.BytesIO):
    """Serial line of a fake board with given output."""

    in_waiting = 1 << 16

    def __call__(self, *_: Any, **__: Any) -> Line:
        return self

    def write(self, data: Any) -> int:
        """Accept bytes from the host."""
        return len(data)

    def reset_input_buffer(self) -> None:
        """Do nothing, so that all input remains."""

    close = reset_input_buffer


def boards(draw: Draw, root: Path) -> None:
    """Send frames with valid CRC and random content from a fake board, and record them."""
    import serial

    hello = list(GOOD_HELLO)
    if draw(st.booleans()):
        hello[draw(st.integers(0, len(hello) - 1))] = draw(st.integers(0, 2**32 - 1) | st.integers(0, 70))
        hello = hello[: draw(st.integers(0, 8) | st.just(8))]
    said = [Tag.HELLO << 28 | draw(st.just(len(hello)) | st.integers(0, 255)), *hello]
    frames = [
        [draw(st.integers(0, 2**32 - 1)) for _ in range(draw(st.integers(0, 3)))]
        for _ in range(draw(st.integers(0, 2)))
    ]
    frames += [RecordWriter().feed(draw(st.lists(records, max_size=4))) for _ in range(draw(st.integers(0, 3)))]
    payloads = [b"".join(word.to_bytes(4, "little") for word in words) for words in (said, *frames)]
    if draw(st.integers(0, 7)) == 0:
        payloads[-1] = payloads[-1][: draw(st.integers(0, len(payloads[-1])))]
    kind = st.one_of(*[st.just(Kind.RECORDS)] * 9, st.integers(0, 255))
    data = [Frame(draw(kind), number, payload[:255]).encode() for number, payload in enumerate(payloads)]
    path = root / "heard.npz"
    for left in root.glob("heard*"):
        left.unlink()
    before, serial.Serial = serial.Serial, Line(data[0])
    try:
        received, view = Received(foreign_events(CONFIG)), View(CONFIG, 50e6, 1.0)
        received.watch = view
        with Link("port", received, patience_s=0.02) as link:
            link.hello("receiver")
            received.journal = Journal(path, CONFIG, {})
            for frame in data[1:]:
                link._handle(frame)
    finally:
        serial.Serial = before
        assert view.state()["events"] <= 10_000
        assert len(view.raster(4)) == 4
        if Path(f"{path}{SUFFIX}").exists():
            recording = convert(Path(f"{path}{SUFFIX}"))
            assert Recording.load(path) == recording
            assert sum(len(Recording.load(one).events) for one in root.glob("heard*.npz")) == len(received.events)


# -- files of the program's own ----------------------------------------------------------------------


def state(draw: Draw, root: Path) -> None:
    """Damage a stored result of a campaign, and continue the campaign."""
    folder = root / "kept"
    folder.mkdir(exist_ok=True)
    if draw(st.booleans()):
        _damaged_journal(draw, root / "rec.npz.part")
    else:
        _damaged_store(draw, folder / "r.json")


def _damaged_store(draw: Draw, out: Path) -> None:
    kept = store_of(out)
    kept.unlink(missing_ok=True)
    first = Store(out, "1")
    good = {name: first.add(name, {"seconds": number}) for number, name in enumerate("abc")}
    kept.write_bytes(draw(st.sampled_from([_cut, _flipped]))(draw, kept.read_bytes()))
    again = Store(out, "1")
    for name, result in good.items():
        assert name not in again or again[name] == result, "a damaged result was believed"
    assert again.of("d", lambda: {"seconds": 9}) == {"seconds": 9}


def _damaged_journal(draw: Draw, part: Path) -> None:
    for left in part.parent.glob("rec*"):
        left.unlink()
    journal = Journal(part.with_suffix(""), CONFIG, {})
    journal.add([(draw(st.integers(0, 50)), draw(st.integers(0, 4)), draw(st.integers(0, 2)), True) for _ in range(4)])
    part.write_bytes(draw(st.sampled_from([_cut, _flipped, lambda _, good: good]))(draw, part.read_bytes()))
    size = part.stat().st_size
    try:
        recording = convert(part)
    except InputError:
        assert part.stat().st_size == size, "a journal was lost"
        raise
    assert Recording.load(part.with_suffix("")) == recording


# -- output paths ------------------------------------------------------------------------------------

names = st.sampled_from(
    ["a", "file", "folder", "link", "out.npz", "dangling", "ring", "null", "..", "é" * 200, "x" * 255, "x" * 256, " ",
     "-o", "[a]*?", "far", "a\nb"]
) | st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), min_size=1, max_size=5)  # fmt: skip


def outputs(draw: Draw, root: Path) -> None:
    """Write to random paths, and check that links, devices and other files are unchanged."""
    place = root / "place"
    shutil.rmtree(place, ignore_errors=True)
    (place / "folder").mkdir(parents=True)
    (place / "file").write_text("old")
    links = {"link": "file", "dangling": "fresh", "ring": "ring", "null": "/dev/null", "far": "folder"}
    for name, target in links.items():
        (place / name).symlink_to(target)
    parts = draw(st.lists(names, min_size=1, max_size=3))
    path = place.joinpath(*parts) if parts.count("..") == 0 else place
    if draw(st.integers(0, 3)) == 0:
        with contextlib.suppress(InputError):
            check_folder(path)
            path.mkdir(parents=True, exist_ok=True)
            assert path.is_dir()
        return
    before = {one: (one.lstat().st_ino, one.lstat().st_mode) for one in place.rglob("*")}
    content = draw(st.binary(max_size=9))
    try:
        target = file_of(path)
        with atomic_write(target) as file:
            file.write(content)
    except InputError:
        assert before == {one: (one.lstat().st_ino, one.lstat().st_mode) for one in place.rglob("*")}
        raise
    assert stat.S_ISCHR(target.stat().st_mode) or path.read_bytes() == content
    after = {one: (one.lstat().st_ino, one.lstat().st_mode) for one in place.rglob("*")}
    changed = {one for one in before | after if before.get(one) != after.get(one)}
    assert {one.resolve() for one in changed} <= {target.resolve()}, changed


# -- folders of recordings ---------------------------------------------------------------------------

KINDS = ("file", "file", "file", "folder", "dangling", "fifo", "device", "link", "ring", "hidden", "text")


def folders(draw: Draw, root: Path) -> None:
    """Fill a folder with files and non-files, and check that each is read or reported."""
    shutil.rmtree(root / "skin", ignore_errors=True)
    wanted, odd = set[Path](), 0
    for number in range(draw(st.integers(1, 6))):
        label = root / "skin" / draw(st.sampled_from(["tap", "press", "a/b", ".hidden", "x.csv"]))
        label.mkdir(parents=True, exist_ok=True)
        kind, suffix = draw(st.sampled_from(KINDS)), draw(st.sampled_from([*SIGNAL_SUFFIXES, ".CSV"]))
        path = label / f"{number}{suffix}"
        hidden = ".hidden" in path.parts
        if kind == "file":
            path.touch()
            wanted |= set() if hidden else {path}
        elif kind == "link":
            (root / "far.csv").touch()
            path.symlink_to(root / "far.csv")
            wanted |= set() if hidden else {path}
        elif kind in ("hidden", "text"):
            (label / (f".{path.name}" if kind == "hidden" else f"{number}.doc")).touch()
        elif kind == "ring":
            (label / f"ring{number}").symlink_to(root / "skin")
        else:
            if kind == "folder":
                path.mkdir()
            elif kind == "fifo":
                os.mkfifo(path)
            else:
                path.symlink_to("/dev/zero" if kind == "device" else "nowhere")
            odd += not hidden
    odd += (root / "skin" / "x.csv").exists()
    strict = draw(st.booleans())
    sources, warnings = sources_of(root / "skin", flat=draw(st.booleans()), strict=strict)
    assert {source.path for source in sources} == wanted
    labels = {path for path in (root / "skin").iterdir() if not path.name.startswith(".")}
    empty = {
        f"folder {label} contains no recording" for label in labels if not any(label in one.parents for one in wanted)
    }
    assert {text for text in warnings if text.startswith("folder ")} == empty
    assert len(warnings) - len(empty) == bool(odd)
    assert not (strict and odd)


ATTACKS: dict[str, Attack] = {
    attack.__name__: attack for attack in (files, options, liberty, boards, state, outputs, folders)
}
"""By the name under which their cases are counted."""
