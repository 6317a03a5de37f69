"""Test the simulated board, the demo, its page in a browser, and events over UDP."""

import dataclasses
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.base.figures.style import PALETTE
from eskin.board import session
from eskin.board.config import BoardConfig
from eskin.board.demo import NETWORKS, TEXTURES_NETWORK, foreign_records, new_view
from eskin.board.link import Link
from eskin.board.serial_frames import Frame, Kind
from eskin.board.simulated import SimulatedPlayer, SimulatedReceiver
from eskin.board.udp import UdpSender, datagram, parse_destination, read_datagram
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus, simulate
from eskin.skin.encode import encode_samples
from tests import browser as browsers
from tests.board.test_gateware import TICKS, hears_ctrl_c, small_chip, walk, weights_of
from tests.conftest import Call

EVENTS_A_SECOND = 45_000  # the most that the serial line of a board takes


@contextmanager
def heard() -> Iterator[tuple[str, list[bytes]]]:
    """Yield a destination and the UDP datagrams that arrive there; an empty datagram ends the reception."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        listener.bind(("127.0.0.1", 0))
        found: list[bytes] = []
        arrivals = iter(lambda: listener.recv(1 << 16), b"")
        thread = threading.Thread(target=lambda: found.extend(arrivals), daemon=True)
        thread.start()
        yield f"127.0.0.1:{listener.getsockname()[1]}", found
        listener.sendto(b"", listener.getsockname())
        thread.join(timeout=10)


def test_play_on_a_simulated_board_is_the_models_and_sends_every_event(call: Call, folder: Path) -> None:
    """Decode the datagrams by jAER's rules for its DVS128, independently of our reader."""
    chip = small_chip()
    weights_of(chip, folder / "weights.npz")
    np.save(folder / "codes.npy", walk(TICKS, chip.readout.taxels))
    with heard() as (destination, found), SimulatedPlayer(BoardConfig(chip=chip)) as board:
        line = f"play weights.npz --samples codes.npy --port {board.port} --udp {destination} --out a.npz"
        line += " --patience 300"  # the model may be compiled first
        code, out, err = call(line)
    assert (code, out.splitlines()[1:]) == (0, ["events and classes equal the model's"]), err
    events = Recording.load(folder / "a.npz").events
    assert len(events) > 300
    assert [struct.unpack(">i", data[:4])[0] for data in found] == list(range(len(found)))
    pairs = [pair for data in found for pair in struct.iter_unpack(">ii", data[4:])]
    as_jaer = [(us, 127 - ((a & 0xFE) >> 1), (a & 0x7F00) >> 8, bool((1 - a) & 1)) for a, us in pairs]
    microseconds = np.round(events["t"] * 1e6 / chip.clock_hz).astype(int).tolist()
    assert as_jaer == list(zip(microseconds, *(events[name].tolist() for name in "xyp"), strict=True))


def test_udp_forwards_all_events_of_a_full_serial_line() -> None:
    config, board_config = ReadoutConfig(), BoardConfig(chip=None)
    rng = np.random.default_rng(3)
    events = np.zeros(EVENTS_A_SECOND, EVENT_DTYPE)
    events["t"] = np.sort(rng.integers(0, config.clock_hz, len(events)))
    events["x"], events["y"] = rng.integers(0, 8, (2, len(events)))
    events["p"] = rng.integers(0, 2, len(events))
    records = foreign_records(config, events, board_config.serial.clock_hz)
    with heard() as (destination, found), SimulatedReceiver(board_config, records) as board:
        sender = UdpSender(destination, board_config.serial.clock_hz)
        received = session.Received(session.foreign_events(config), forward=sender, keep=False)
        with Link(board.port, received) as link:
            link.hello("receiver", board_config)
            link.send(Kind.RESTART)
            while received.count < len(events):
                link.receive()
        sender.close()
    numbers, parts = zip(*map(read_datagram, found), strict=True)
    assert numbers == tuple(range(len(numbers)))
    got = np.concatenate(parts)
    assert np.array_equal(got[:, 1:], np.stack([events[name] for name in "xyp"], 1))
    assert np.abs(got[:, 0] - events["t"] * 1e6 / config.clock_hz).max() <= 1


def test_the_time_of_a_player_begins_with_a_run_and_stands_still_while_the_models_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    chip, host_s, found = small_chip(), 0.0, []
    monkeypatch.setattr("eskin.board.simulated.time", SimpleNamespace(monotonic=lambda: host_s))
    with SimulatedPlayer(BoardConfig(chip=chip), speed=1.0) as board:
        board.carry_out(Frame(Kind.RESTART, 1, b""))
        for clocks in (5000, 400, 9000):  # of the host, until the models run up to clocks 1000, 2000 and 3000
            host_s += clocks / chip.clock_hz
            board.carry_out(Frame(Kind.RUN, 2, (1000).to_bytes(4, "little")))
            board.carry_out(Frame(Kind.STATUS, 3, b""))
            found.append(board._now())
    assert found == pytest.approx([0, 400, 2000])


def test_times_wrap_and_long_lists_are_cut() -> None:
    late = np.array([[(1 << 32) + 7, 63, 63, 1]])
    assert read_datagram(datagram(3, late))[1].tolist() == [[7, 63, 63, 1]]
    with heard() as (destination, found):
        sender = UdpSender(destination, 1e6)
        sender([(clock, 1, 2, True) for clock in range(400)])
        sender.close()
    assert max(map(len, found)) <= 1472
    assert [event[0] for data in found for event in read_datagram(data)[1].tolist()] == list(range(400))


def test_faery_reads_what_is_sent_to_it() -> None:
    faery = pytest.importorskip("faery")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    found: list[np.ndarray] = []

    def read() -> None:
        for part in faery.events_stream_from_udp((64, 64), ("127.0.0.1", port)):
            found.append(part[part["t"] > 0])
            if sum(map(len, found)) >= len(sent):
                return

    sent = [(3 * clock + 1, clock % 64, clock % 50, bool(clock % 3)) for clock in range(400)]
    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    sender = UdpSender(f"faery://127.0.0.1:{port}", 1e6)
    until = time.monotonic() + 20
    while not found and time.monotonic() < until:  # faery opens its socket in its own time
        sender([(0, 0, 0, True)])
        time.sleep(0.05)
    sender.begins_us = 1 << 32  # beyond 32 bits
    sender(sent)
    sender.close()
    thread.join(timeout=20)
    assert [len(part) for part in found if len(part)] == [113, 113, 113, 61]
    got = np.concatenate(found)
    wanted = [(at + (1 << 32), column, row, on) for at, column, row, on in sent]
    assert list(zip(*(got[name].tolist() for name in ("t", "x", "y", "on")), strict=True)) == wanted


def test_the_finger_is_recognised_by_its_network(call: Call) -> None:
    """Check the classes of recordings that the network was not trained on."""
    code, out, err = call("demo finger --no-browser --port 0 --limit 4 --speed 1000")
    assert code == 0, err
    fabrics = ("BeigeCotton", "Canvas", "Denim", "Linen")
    lines = [rf"{fabric}/F120_V-150mmps_1: {fabric}, right; \d+ events" for fabric in fabrics]
    for line, wanted in zip(
        out.splitlines()[1:], [r"scale \S+", *lines, "played 4 recordings, 4 of 4 classes right"], strict=True
    ):
        assert re.fullmatch(wanted, line)


def test_a_users_recording_is_shown_without_a_network(call: Call, folder: Path) -> None:
    np.save(folder / "touch.npy", walk(300, 6) / 2048)
    code, out, err = call("demo touch.npy --sample-rate 1000 --no-browser --port 0 --limit 1 --speed 5")
    assert code == 0, err
    from eskin.board.demo import show_of

    show = show_of(Path("touch.npy"), None, readout={"sample_rate_hz": 1000.0})
    codes, _ = show.load("touch")
    events = simulate(show.config, Stimulus.from_samples(show.config, codes))
    assert len(events) > 100
    assert out.splitlines()[1:] == ["scale 1", f"touch: {len(events)} events", "played 1 recording"]


@pytest.mark.parametrize("options", [{}, {"baseline": "first"}, {"scale": "2"}])
@pytest.mark.parametrize("form", ["%.6f", "%d"])
def test_demo_and_encode_scale_a_file_equally(options: dict[str, str], form: str, folder: Path, call: Call) -> None:
    values = walk(300, 6) / (1 if form == "%d" else 4096) + 0.1
    np.savetxt("touch.csv", values, form, delimiter=",")
    if form == "%d" and "scale" in options:
        options = {"scale": "0.0001"}
    from eskin.board.demo import show_of

    show = show_of(Path("touch.csv"), None, None, {"sample_rate_hz": 1000.0}, options)
    if form == "%d" and not options:  # raw counts are scaled like a folder
        options = {"baseline": "first", "scale": "max"}
    words = " ".join(f"--{name} {value}" for name, value in options.items())
    code, out, err = call(f"encode touch.csv -o e.npz --sample-rate 1000 --rows 2 --columns 3 {words}")
    assert code == 0, err
    assert f"clipped, scale {show.scale:.4g}\n" in out
    config = ReadoutConfig(rows=2, columns=3, sample_rate_hz=1000.0)
    made = encode_samples(Path("touch.csv"), config, {"sample_rate_hz", "rows", "columns"}, options)
    assert np.array_equal(made.codes, show.load("touch")[0])


def test_raw_counts_are_scaled_and_named_as_in_a_folder(folder: Path) -> None:
    from eskin.board.demo import show_of

    counts = 500 + walk(300, 6) // 64  # of 10 bits, on a baseline
    header = "t1_x,t1_y,t1_z,t2_x,t2_y,t2_z"
    np.savetxt("raw.csv", counts, "%d", delimiter=",", header=header, comments="")
    show = show_of(Path("raw.csv"), None, None, {"sample_rate_hz": 1000.0}, {})
    codes, piece = show.load("raw")
    assert piece.taxels == header.split(",")
    assert np.abs(codes).max() > 0.99 * show.config.full_scale
    assert np.abs(codes[0]).max() <= 1
    assert len(simulate(show.config, Stimulus.from_samples(show.config, codes))) > 100
    view = new_view(show)
    view.loading = "raw"
    view.begin(piece, 1.0)
    assert view.state()["readout"].startswith("6 taxels, ")
    assert view.state()["loading"] == "raw"
    view([], [(5, 0, 0, True)])
    assert view.state()["loading"] == ""


@pytest.mark.command("demo")  # the page takes seconds
def test_mistakes_are_one_sentence(call: Call) -> None:
    taken = socket.create_server(("127.0.0.1", 0))
    port = taken.getsockname()[1]
    sentences = {
        f"demo --port {port}": f"cannot serve a page on port {port}: Address already in use; choose another --port",
        "demo nothing.csv": "nothing.csv does not exist; give an image, a recording, or a folder of them",
        "demo --only marble": "there is no input 'marble'; the first input is brick/brick-00",
        "demo --resolution 4": "resolution is a setting of the network; leave it out, or play a recording without "
        "--weights",
        "demo --udp host:0": "--udp takes HOST:PORT, such as 127.0.0.1:8991, not 'host:0'",
        "demo --udp no.such.host.invalid": "cannot send to no.such.host.invalid: ",
    }
    for line, sentence in sentences.items():
        code, _, err = call(f"{line} --no-browser")
        assert code == 2, line
        assert err.splitlines()[-1].startswith(f"error: {sentence}"), err
    taken.close()
    assert parse_destination("[::1]:9") == ("::1", 9)
    assert parse_destination("localhost") == ("localhost", 8991)


ALL_OF_IT = """(() => {
  if (!last || last.seconds < 0.15 || $("class").textContent !== "brick") return null;
  const colours = (id) => {
    const data = $(id).getContext("2d").getImageData(0, 0, $(id).width, $(id).height).data, seen = new Set();
    for (let at = 0; at < data.length; at += 4) if (data[at + 3]) seen.add(data.slice(at, at + 3).join());
    return [...seen].map((one) => one.split(",").map(Number));
  };
  return { text: document.body.innerText, raster: colours("raster"), evidence: colours("evidence"),
           shown: [...document.querySelectorAll("main section")].every((one) => !one.hidden),
           photo: document.querySelector("#photo img").naturalWidth };
})()"""
"""What the page shows at the end of a scan, in one go: the next scan may begin at any time."""


def named(seen: list[list[int]]) -> set[str]:
    """Return the palette colours in a list of colours, with a tolerance for rounding."""
    wanted = {name: [int(colour[at : at + 2], 16) for at in (1, 3, 5)] for name, colour in PALETTE.items()}
    return {name for name, rgb in wanted.items() if (np.abs(np.array(seen) - rgb).max(1) <= 2).any()}


def test_the_page_of_the_demo_in_a_browser(tmp_path: Path) -> None:
    if reason := browsers.missing():
        assert not os.environ.get("CI"), reason
        pytest.skip(reason)
    words = [sys.executable, "-m", "eskin", "demo", "--port", "0", "--no-browser", "--speed", "0.5"]
    words += ["--only", "brick/brick-00", "--udp", "127.0.0.1:9"]
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True, preexec_fn=hears_ctrl_c) as demo,
        browsers.opened(tmp_path / "profile") as browser,
    ):
        address = re.search(r"http\S+", demo.stdout.readline())
        assert address is not None
        browser.open(address[0])
        page = browser.wait_for(ALL_OF_IT, 120)
        assert (named(page["raster"]), page["shown"], page["photo"]) == ({"sky", "orange"}, True, 256)
        assert "green" in named(page["evidence"])
        browser.size(1280, 800)
        assert browser.run("return $('evidence').getBoundingClientRect().bottom") <= 800
        for words_of_page in (
            "✓ right",
            "brick/brick-00",
            "8 x 8 taxels, LCS 3 b",
            "ON, left",
            "OFF, right",
            "sent to",
        ):
            assert words_of_page in page["text"]
        assert re.search(r"end of bin to class\s+\d+ µs\s+\d+ µs\s+serial port to here\s+[\d.]+ \wm?s", page["text"])
        browser.size(360, 800)
        assert browser.run("return document.documentElement.scrollWidth") <= 360
        assert browser.problems() == []
        demo.send_signal(signal.SIGINT)
        assert "played" in demo.stdout.read()
        assert demo.wait(timeout=30) == 0
        browser.wait_for("document.getElementById('class').textContent === 'the program has ended'")


@pytest.mark.parametrize(
    ("kept", "sentence"),
    [
        ((), "the network lacks the readout of its training"),
        (("readout",), "the training data in the network are damaged"),
    ],
)
def test_a_network_without_whole_notes_on_its_training_is_refused(kept: tuple[str, ...], sentence: str) -> None:
    whole = IntegerWeights.load(NETWORKS / TEXTURES_NETWORK)
    notes = {"training": {name: whole.notes["training"][name] for name in kept}}
    with pytest.raises(InputError, match=sentence):
        session.chip_of(dataclasses.replace(whole, notes=notes))
