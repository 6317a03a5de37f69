"""Test the host software: codec, records, journal, and a faulty board."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.journal import Journal, convert
from eskin.board.link import Link
from eskin.board.live import COPY_S, View, served
from eskin.board.records import (
    STATUS_WORDS,
    VERSION,
    Ack,
    Class,
    Event,
    Feature,
    Lost,
    Reason,
    Record,
    RecordReader,
    RecordWriter,
    Refused,
    Tag,
    Words,
    additions,
    hello_values,
)
from eskin.board.serial_frames import FLAG, Damaged, Frame, FrameReader, Kind
from eskin.board.session import Received, foreign_events, listen, load, observed_clocks, recording
from eskin.board.simulated import SimulatedReceiver
from eskin.board.udp import UdpSender
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.foreign.address_map import AddressMap

FRAMES = st.builds(Frame, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=255))
TIMES = st.integers(0, 1 << 40)
RECORDS = st.one_of(
    st.builds(Event, TIMES, st.integers(0, 4095)),
    st.builds(
        Class,
        TIMES,
        st.integers(0, 2),
        st.booleans(),
        st.tuples(*[st.integers(-(1 << 31), (1 << 31) - 1)] * 3),
        st.booleans(),
    ),
    st.builds(Lost, st.integers(0, (1 << 28) - 1)),
    st.builds(Ack, st.integers(0, 255)),
    st.builds(Refused, st.integers(0, 255), st.integers(0, 255), st.sampled_from(sorted(Reason))),
    st.just(Words(Tag.STATUS, dict(zip(STATUS_WORDS, range(8), strict=True)))),
)


def packed(records: list[Record]) -> bytes:
    return b"".join(word.to_bytes(4, "little") for word in RecordWriter().feed(records))


# -- frames and records ------------------------------------------------------------------------------


@given(st.lists(FRAMES, max_size=4), st.integers(1, 40))
def test_frames_come_back_however_the_bytes_are_cut(frames: list[Frame], size: int) -> None:
    data = b"noise" + b"".join(frame.encode() for frame in frames)
    reader = FrameReader()
    found = [one for at in range(0, len(data), size) for one in reader.feed(data[at : at + size])]
    assert found == frames


def test_a_frame_byte_for_byte() -> None:
    assert Frame(Kind.RUN, 0x7D, b"\x7e\x00").encode().hex(" ") == "7e 04 7d 5d 02 7d 5e 00 8a a9 cf 18 7e"


@given(FRAMES, st.integers(0, 10**6), st.integers(0, 8))
def test_a_flipped_bit_or_a_lost_byte_is_never_taken_for_data(frame: Frame, place: int, bit: int) -> None:
    data = bytearray(frame.encode())
    place %= len(data)
    if bit < 8:
        data[place] ^= 1 << bit
    elif 0 < place < len(data) - 1:  # of two flags in a row one is enough
        del data[place]
        data.insert(0, FLAG)
    else:
        return
    assert all(isinstance(one, Damaged) for one in FrameReader().feed(bytes(data) + bytes([FLAG])))


@given(st.lists(RECORDS, max_size=20), st.integers(1, 9))
def test_records_come_back_however_the_frames_are_cut(records: list[Record], words: int) -> None:
    data = packed(records)
    reader = RecordReader(classes=3)
    assert [one for at in range(0, len(data), 4 * words) for one in reader.feed(data[at : at + 4 * words])] == records


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ((0xF << 28).to_bytes(4, "little"), "a record with the unknown tag 15"),
        (packed([Event(1, 4000)]), "an event with the address 4000, but has 16 addresses"),
        (packed([Class(1, 63, False, (0, 0))]), "the class 63, but has 2 classes"),
    ],
)
def test_records_that_the_board_cannot_send_are_refused(data: bytes, sentence: str) -> None:
    with pytest.raises(InputError, match=f"^the board sent {sentence}; load its bitstream again$"):
        list(RecordReader(classes=2, addresses=16).feed(data))


def test_a_board_that_sends_no_early_decisions_is_refused() -> None:
    network = ClassifierConfig(inputs=32, hidden=4, classes=2, margin=3)
    config = BoardConfig(chip=ChipConfig(readout=ReadoutConfig(rows=2, columns=8), classifier=network))

    def answer(frame: Frame, board: FakeBoard) -> bytes:
        return board.say(Words(Tag.HELLO, hello_values(config), features))

    for features in (additions(config) & ~Feature.EARLY, additions(config)):
        refused = pytest.raises(InputError, match="the board sends no early decisions; build its bitstream again")
        with linked(answer) as (link, _), contextlib.nullcontext() if features & Feature.EARLY else refused:
            link.hello("player", config)


# -- journal -----------------------------------------------------------------------------------------


@pytest.mark.command("rescue")
def test_rescue_restores_a_killed_recording(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "a.npz", ReadoutConfig(), {"name": "a"})
    journal.add([(5, 1, 2, True), (9, 3, 4, False)])
    with (tmp_path / "a.npz.part").open("ab") as file:
        file.write(b"half")
    with pytest.raises(InputError, match=r"holds an unfinished recording; eskin rescue"):
        Journal(tmp_path / "a.npz", ReadoutConfig(), {})
    recording = convert(tmp_path / "a.npz.part")
    assert recording == Recording.load(tmp_path / "a.npz")
    assert recording.events.tolist() == [(5, 1, 2, True), (9, 3, 4, False)]
    assert (recording.duration_clocks, recording.metadata) == (10, {"name": "a"})
    assert not (tmp_path / "a.npz.part").exists()


def test_something_else_is_no_journal(tmp_path: Path) -> None:
    (tmp_path / "b.npz.part").write_bytes(b"{}\n")
    with pytest.raises(InputError, match="is not a partial recording"):
        convert(tmp_path / "b.npz.part")


def test_a_clock_that_runs_backwards_parts_the_recording(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "a.npz", ReadoutConfig(), {"name": "a"})
    journal.add([(5, 1, 2, True), (9, 3, 4, False), (2, 0, 0, True), (2, 0, 1, True), (0, 7, 7, False)])
    convert(tmp_path / "a.npz.part")
    found = [Recording.load(tmp_path / f"a{piece}.npz").events["t"].tolist() for piece in ("", "-2", "-3")]
    assert found == [[5, 9], [2, 2], [0]]
    assert not (tmp_path / "a.npz.part").exists()
    Journal(tmp_path / "b.npz", ReadoutConfig(), {}).add([(5, 1, 99, True)])
    with pytest.raises(InputError, match=r"b.npz.part holds events outside its array: event 0 has y = 99"):
        convert(tmp_path / "b.npz.part")
    with pytest.raises(InputError, match=r"/dev/zero is a device; give a file that ends in .npz.part"):
        convert(Path("/dev/zero"))


# -- a board that misbehaves -------------------------------------------------------------------------

RECEIVER = BoardConfig(chip=None, serial=SerialConfig(buffer_bytes=512))
HELLO = hello_values(RECEIVER)


class FakeBoard(SimulatedReceiver):
    """Receiver without events; ``answer`` returns the bytes of another answer, or None."""

    def __init__(self, answer: Callable[[Frame, FakeBoard], bytes | None]) -> None:
        super().__init__(RECEIVER, [])
        self.answer = answer

    def say(self, *records: Record) -> bytes:
        return bytes(self.framed(list(records)))

    def _take(self, frame: Frame) -> None:
        if (answer := self.answer(frame, self)) is None:
            super()._take(frame)
        else:
            os.write(self._master, answer)

    def pull(self) -> bytes:
        """Simulate a disconnected cable."""
        os.close(self._slave)
        os.close(self._master)
        self._master, self._slave = os.openpty()
        return b""


@contextmanager
def linked(answer: Callable[[Frame, FakeBoard], bytes | None]) -> Iterator[tuple[Link, list[Record]]]:
    came: list[Record] = []
    with FakeBoard(answer) as board, Link(board.port, came.extend, patience_s=0.4) as link:
        yield link, came


def on_status(what: Callable[[Frame, FakeBoard], bytes]) -> Callable[[Frame, FakeBoard], bytes | None]:
    return lambda frame, board: what(frame, board) if frame.kind == Kind.STATUS else None


EVENT = Event(70_000, 5)

MISHAPS = {
    "has sent nothing for 0.4 s; check the cable": lambda frame, board: b"",
    "a frame from the board arrived damaged .its CRC is wrong.": lambda f, b: b.say(EVENT) + b.say(EVENT)[:-3] + b"~",
    "1 frames from the board were lost before number 3; play again": lambda f, b: (
        b.say(EVENT) + b.say(EVENT)[:0] + b.say(EVENT)
    ),
    "frame 1 to the board arrived damaged .it waits for 1.": lambda f, b: b.say(EVENT, Refused(1, 1, Reason.DAMAGED)),
    "frame 1 to the board arrived out of order": lambda f, b: b.say(EVENT, Refused(1, 0, Reason.SEQUENCE)),
    "is gone; check the cable": lambda f, b: b.pull(),
    "acknowledged frame 9, which is not the next frame": lambda f, b: b.say(EVENT, Ack(9)),
}


@pytest.mark.parametrize("sentence", MISHAPS)
def test_a_mishap_is_one_sentence_and_what_came_before_is_kept(sentence: str) -> None:
    with linked(on_status(MISHAPS[sentence])) as (link, came):
        link.hello("receiver")

        def ask() -> None:  # the answer may be there before the frame is sent
            link.send(Kind.STATUS)
            link.wait()

        with pytest.raises(InputError, match=sentence):
            ask()
        if "gone" not in sentence and "nothing" not in sentence:
            assert came == [EVENT]


@pytest.mark.command("load")
@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": 9}, "the board uses protocol version 9, but this program uses 1; load its bitstream again"),
        ({"design": 1}, "the board holds the player, but this command needs the receiver; load that bitstream"),
        ({"design": 7}, "the board holds the design 7"),
        ({"identity": 1}, r"has another network or array \(00000001, not [0-9a-f]{8}\)"),
    ],
)
def test_another_bitstream_is_refused(changes: dict[str, int], sentence: str) -> None:
    def answer(frame: Frame, board: FakeBoard) -> bytes:
        return board.say(Words(Tag.HELLO, HELLO | changes))

    with linked(answer) as (link, _), pytest.raises(InputError, match=sentence):
        link.hello("receiver", BoardConfig(chip=None))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "describes itself in 0 numbers, not 8"),
        ([VERSION, 2], "describes itself in 2 numbers, not 8"),
        ([7], "uses protocol version 7, but this program uses 1"),
        ([VERSION, 2, 0, 0, 512, 1, 0, 0], r"reports clock_hz = 0, outside 1000\.\.1000000000"),
        ([VERSION, 2, 0, 50_000_000, 1, 1, 0, 0], r"reports buffer_bytes = 1, outside 512\.\.16777216"),
        ([VERSION, 1, 0, 50_000_000, 512, 16, 200, 3], r"reports classes = 200, outside 0\.\.64"),
        ([VERSION, 1, 0, 50_000_000, 512, 16, 3, 1 << 31], r"reports word_bytes = 2147483648, outside 0\.\.252"),
    ],
)
def test_a_board_with_impossible_values_is_refused(words: list[int], sentence: str) -> None:
    first = Tag.HELLO << 28 | len(words)
    data = b"".join(word.to_bytes(4, "little") for word in (first, *words))

    def answer(frame: Frame, board: FakeBoard) -> bytes:
        return Frame(Kind.RECORDS, 0, data).encode()

    with linked(answer) as (link, _), pytest.raises(InputError, match=f"^the board .*{sentence}; load its bitstream"):
        link.hello("receiver")


def test_a_board_that_floods_and_never_acknowledges_is_left() -> None:
    def flood(board: FakeBoard) -> None:
        with contextlib.suppress(OSError, ValueError):  # the test ends in the middle of a frame
            while not board._ending:
                board._say([EVENT])

    def answer(frame: Frame, board: FakeBoard) -> bytes | None:
        if frame.kind == Kind.RESTART:
            threading.Thread(target=flood, args=(board,), daemon=True).start()
        return None if frame.kind == Kind.HELLO else b""

    received = Received(lambda event: (event.time, 0, 0, True), keep=False)
    with linked(answer) as (link, _):
        link.sink, link.patience_s = received, 0.3
        link.hello("receiver")
        with pytest.raises(InputError, match=r"sends, but has not acknowledged frame 1 for 0\.3 s; load its bitstream"):
            listen(link, received, 0.2)
    assert received.count


def test_a_board_without_memories_of_weights_takes_none() -> None:
    link = SimpleNamespace(said={"word_bytes": 0})
    with pytest.raises(
        InputError, match=r"^the board reports word_bytes = 0, so no memory takes its weights; load its"
    ):
        load(link, None)  # type: ignore[arg-type]


@pytest.mark.command("play")  # a run takes a simulation
def test_no_board_is_one_sentence() -> None:
    with pytest.raises(InputError, match=r"no board at /dev/none: .*; give the name of its port"):
        Link("/dev/none", lambda records: None)
    with (
        linked(lambda frame, board: b"not a board~~") as (link, _),
        pytest.raises(InputError, match="no board answers at"),
    ):
        link.hello("receiver")


def test_the_host_never_has_more_under_way_than_the_board_can_keep() -> None:
    kept: list[Frame] = []
    most = 0

    def answer(frame: Frame, board: FakeBoard) -> bytes | None:
        nonlocal most
        if frame.kind == Kind.HELLO:
            return None
        kept.append(frame)
        most = max(most, sum(one.cost for one in kept))
        if len(kept) < 2:
            return b""
        return board.say(*(Ack(kept.pop(0).sequence) for _ in range(len(kept))))

    with linked(answer) as (link, _):
        link.hello("receiver")
        for _ in range(600):  # the sequence numbers pass 255 twice
            link.send(Kind.SAMPLES, bytes(200))
        link.wait()
    assert 400 < most <= 512


def test_frames_from_before_a_session_are_ignored() -> None:
    def answer(frame: Frame, board: FakeBoard) -> bytes | None:
        if frame.kind != Kind.HELLO:
            return None
        old = b"".join(Frame(Kind.RECORDS, number, packed([EVENT])).encode() for number in (77, 0))
        return old[3:] + old + board.say(Words(Tag.HELLO, HELLO))

    with linked(answer) as (link, came):
        assert link.hello("receiver") == HELLO
        link.send(Kind.STATUS)
        link.wait()
        assert EVENT not in came


@pytest.mark.command("listen")
def test_listening_asks_and_ends(tmp_path: Path) -> None:
    def answer(frame: Frame, board: FakeBoard) -> bytes | None:
        if frame.kind != Kind.STATUS:
            return None
        status = Words(Tag.STATUS, dict(zip(STATUS_WORDS, (5, 1, 2, 0, 0, 0, 3, 0), strict=True)))
        return board.say(EVENT, Lost(3), status, Ack(frame.sequence))

    config = ReadoutConfig(rows=1, columns=8)
    received = Received(foreign_events(config))
    with linked(answer) as (link, _):
        link.sink = received
        link.hello("receiver")
        listen(link, received, 0.01)
    assert received.events[0] == (70_000, 5, 0, False)
    assert (observed_clocks(received), received.counts["lost"]) == ((1 << 32) + 5, 3)


# -- what is looked at -------------------------------------------------------------------------------


def test_the_page_shows_what_came() -> None:
    view = View(ReadoutConfig(rows=2, columns=4), 1e6, 0.036, ("wood", "wool"), 300)
    events = [(250, 3, 0, True), (260, 3, 0, True), (330, 0, 1, False)]
    view([Class(400, 1, False, (-4, 9), True), Lost(2)], events, 0.002)
    with served(view, 0) as port:
        place = f"http://127.0.0.1:{port}/"
        said = json.loads(urllib.request.urlopen(f"{place}state").read())
        page = urllib.request.urlopen(place).read().decode()
        for host in (f"evil.example:{port}", "127.0.0.1", "localhost:1", ""):
            for path in ("", "state"):
                with pytest.raises(urllib.error.HTTPError, match="403"):
                    urllib.request.urlopen(urllib.request.Request(place + path, headers={"Host": host}))
        urllib.request.urlopen(f"http://localhost:{port}/state").close()
    assert said["steps"] == [[2, [[7, 2]]], [3, [[8, 1]]]]
    assert view.state(said["number"], since=3)["steps"] == [[3, [(8, 1)]]]
    assert (said["class"], said["evidence"], said["events"], said["lost"]) == ("wool", [-4, 9], 3, 2)
    assert said["early"] == ["wool", 0.0003]
    assert said["class_latency_s"] == [101e-6, 101e-6]
    assert said["host_latency_s"] == [0.002, 0.002]
    assert "http" not in page.replace("http-equiv", "")
    assert not re.findall("%[a-z]+%", page)  # all colours are there
    assert [row[-2:] for row in view.raster(8, columns=360)] == ["  ", "  ", "  ", ": ", " .", "  ", "  ", "  "]
    view([], [(5, 0, 0, True)])  # a board that was reset: the raster begins anew
    assert [row[-1] for row in view.raster(4)] == [".", " ", " ", " "]
    assert view.state(said["number"])["number"] > said["number"]


def test_no_number_of_clients_asks_the_recording_for_more_than_its_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client's question took the time of a thousand events from the recording."""
    view, asked = View(ReadoutConfig(rows=2, columns=4), 1e6, 0.036), []
    state = view.state
    monkeypatch.setattr(view, "state", lambda *given: asked.append(given) or state(*given))
    with served(view, 0) as port:
        for clock in range(0, 300, 3):
            view([], [(clock, 3, 0, True)])
            said = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{port}/state").read())
        while said["events"] < 100:
            said = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{port}/state").read())
        assert len(said["steps"]) == 3
        assert sum(count for _, counts in said["steps"] for _, count in counts) == 100
        begun, before = time.monotonic(), len(asked)
        for _ in range(50):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/state").close()
        assert len(asked) - before <= (time.monotonic() - begun) / COPY_S + 1


def test_ctrl_c_reaches_the_recording_and_not_the_page() -> None:
    program = """
import os, signal, urllib.request
from eskin.board.live import View, served
from eskin.model.config import ReadoutConfig
signal.signal(signal.SIGINT, signal.default_int_handler)
if __name__ == "__main__":
    with served(View(ReadoutConfig(), 1e6, 1.0), 0) as port:
        try:
            os.killpg(0, signal.SIGINT)
        except KeyboardInterrupt:
            print(len(urllib.request.urlopen(f"http://127.0.0.1:{port}/state", timeout=30).read()) > 100)
"""
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, capture_output=True, text=True, start_new_session=True, timeout=60)
    assert (done.stdout, done.stderr) == ("True\n", "")


def test_a_network_that_takes_no_datagram_is_counted_and_the_journal_is_first(tmp_path: Path) -> None:
    config, path = ReadoutConfig(rows=1, columns=8), tmp_path / "heard.npz"
    sender = UdpSender("255.255.255.255:9", 1e6)  # the system refuses to send to everyone
    received = Received(foreign_events(config), forward=sender, keep=False)
    with recording(path, config, {}, received):
        received([Event(clock, 5) for clock in range(200)])
        received([Event(300, 6)])
    sender.close()
    assert (sender.events, sender.failed, sender.reason) == (0, 3, "Permission denied")
    assert len(Recording.load(path).events) == 201


def test_the_journal_has_an_event_before_it_is_sent_on(tmp_path: Path) -> None:
    config, path = ReadoutConfig(rows=1, columns=8), tmp_path / "heard.npz"
    received = Received(foreign_events(config), forward=lambda events: 1 // 0)
    with pytest.raises(ZeroDivisionError), recording(path, config, {}, received):
        received([Event(7, 5)])
    assert len(Recording.load(path).events) == 1


@pytest.mark.parametrize(
    ("baud", "limit"), [(13_000_000, "at most clock_hz / 4 = 12500000, not 13000000"), (0, "at least 1, not 0")]
)
def test_a_line_that_cannot_be_is_refused(baud: int, limit: str) -> None:
    with pytest.raises(InputError, match=f"^baud of the serial line must be {limit}$"):
        SerialConfig(baud=baud)


def test_an_address_that_the_array_has_not_is_refused() -> None:
    with pytest.raises(
        InputError, match="the foreign chip sent the address 0xc, which 3 x 4 taxels of lcs do not have"
    ):
        foreign_events(ReadoutConfig(rows=3, columns=4))(Event(0, 12))
    assert foreign_events(ReadoutConfig(rows=3, columns=4, encoding="nlcs"))(Event(1, 9)) == (1, 1, 2, True)
    assert np.array(foreign_events(ReadoutConfig(rows=3, columns=4))(Event(1, 0x19))).tolist() == [1, 1, 2, 1]
    mapping = AddressMap({(y + 1, x + 1): (x, y) for x in range(3) for y in range(2)}, "map.csv")  # with swapped axes
    to_event = foreign_events(ReadoutConfig(rows=2, columns=3), mapping)
    assert [to_event(Event(0, address)) for address in (0x16, 0x5)] == [(0, 0, 1, True), (0, 0, 0, False)]
    with pytest.raises(InputError, match=r"the foreign chip sent the address 0x3, which map\.csv does not map"):
        to_event(Event(0, 0x3))
