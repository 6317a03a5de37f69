"""Live display of a board: raster and class in the terminal, and a page for the browser."""

import json
import multiprocessing
import signal
import socket
import threading
import urllib.parse
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from multiprocessing.connection import Connection
from typing import Any, cast

import numpy as np

from eskin.base.errors import InputError
from eskin.base.figures.style import PALETTE
from eskin.board.records import Class, Lost, Record, Tag, Words
from eskin.board.udp import AddressEvent, UdpSender
from eskin.model.config import ReadoutConfig

STEPS = 360  # time steps on the page
COLUMNS = 120  # of the raster in a terminal
SHADES = " .:*#"
LATENCIES = 4096  # number of latencies for median and 99 %
RECENT = 0.05  # part of the window for the event rate
COPY_S = 0.08  # time between two copies for the page


@dataclass(frozen=True, kw_only=True)
class Piece:
    """The current input, for the live page."""

    name: str
    truth: str | None = None  # its class, if known
    seconds: float = 0.0
    speed: float = 1.0  # seconds of the skin per second of the page
    signals: list[list[float]] | None = None  # of each taxel in full scales, evenly spread over these seconds
    taxels: list[str] | None = None  # their names, if the array has no other geometry than their order
    picture: dict[str, Any] | None = None  # of the touched surface and the array on it, from ``demo.picture_of``


class View:
    """Event counts per taxel, polarity and time step, shared by the receiver thread and the page thread.

    The view shows ``window_s`` seconds. ``clocks_per_bin`` is 0 without a classifier.
    """

    def __init__(
        self,
        config: ReadoutConfig,
        clock_hz: float,
        window_s: float,
        class_names: Sequence[str] = (),
        clocks_per_bin: int = 0,
    ) -> None:
        self.config, self.clock_hz, self.clocks_per_bin = config, clock_hz, clocks_per_bin
        self.class_names = list(class_names)
        self.sender: UdpSender | None = None
        self.number = 0
        self.loading = ""  # name of the input whose first data have not arrived
        self._lock = threading.Lock()
        self._class_s: deque[float] = deque(maxlen=LATENCIES)
        self._host_s: deque[tuple[float, int]] = deque(maxlen=LATENCIES)
        self.begin(Piece(name=""), window_s)

    def begin(self, piece: Piece, window_s: float) -> None:
        """Restart at time 0 with another input."""
        with self._lock:
            self.piece, self.window_s = piece, window_s
            self.clocks_per_step = max(round(window_s * self.clock_hz / STEPS), 1)
            self.events = self.lost = 0
            self._clear()

    def _clear(self) -> None:
        self.number += 1
        self.bins = self.clock = 0
        self.evidence: list[int] = []
        self.winner: str | None = None
        self.early: tuple[str, float] | None = None  # class and seconds of the early decision
        self._steps: deque[tuple[int, Counter[int]]] = deque(maxlen=STEPS + 1)
        self._bins: deque[tuple[int, list[int]]] = deque(maxlen=STEPS)

    def __call__(self, records: list[Record], events: list[AddressEvent], waited_s: float = 0.0) -> None:
        """Add the records and events of a frame, with their age on this machine."""
        with self._lock:
            for clock, column, row, polarity in events:
                step = clock // self.clocks_per_step
                if self._steps and step < self._steps[-1][0]:  # a reset board restarts its clock
                    self._clear()
                if not self._steps or self._steps[-1][0] != step:
                    self._steps.append((step, Counter()))
                self._steps[-1][1][2 * (row * self.config.columns + column) + polarity] += 1
            if events:
                self.events += len(events)
                self.clock = max(self.clock, events[-1][0])
                self._host_s.append((waited_s, len(events)))
            for record in records:
                self._take(record)
            if self.clock:
                self.loading = ""

    def _take(self, record: Record) -> None:
        if isinstance(record, Class):
            self.bins += 1
            self.clock = max(self.clock, record.time)
            self.evidence = list(record.evidence)
            self.winner = self.class_names[record.winner] if record.winner < len(self.class_names) else None
            if record.sure and self.winner and self.early is None:
                self.early = self.winner, self.bins * self.clocks_per_bin / self.clock_hz
            self._bins.append((record.time, self.evidence))
            if self.clocks_per_bin:
                self._class_s.append((record.time + 1) % self.clocks_per_bin / self.clock_hz)
        elif isinstance(record, Lost):
            self.lost += record.count
        elif isinstance(record, Words) and record.tag == Tag.STATUS:
            self.clock = max(self.clock, record.values["time_high"] << 32 | record.values["time_low"])

    def _array(self) -> str:
        return str(self.config.taxels) if self.piece.taxels else f"{self.config.rows} x {self.config.columns}"

    def state(self, number: int = 0, since: int = 0) -> dict[str, Any]:
        """Return the data of the live page as a dictionary for JSON, starting from step ``since`` for a known input."""
        with self._lock:
            since = since if number == self.number else 0
            step_s = self.clocks_per_step / self.clock_hz
            recent = self.clock // self.clocks_per_step - max(round(RECENT * STEPS), 1)
            of_late = sum(counts.total() for step, counts in self._steps if step > recent)
            return {
                "number": self.number,
                "readout": f"{self._array()} taxels, {self.config.encoder.title} {self.config.resolution} b",
                "loading": self.loading,
                "rows": self.config.rows,
                "columns": self.config.columns,
                "polarity": self.config.has_polarity,
                "window_s": self.window_s,
                "step_s": step_s,
                "steps": [[step, sorted(counts.items())] for step, counts in self._steps if step >= since],
                "bins": [[time / self.clock_hz, evidence] for time, evidence in self._bins],
                "seconds": self.clock / self.clock_hz,
                "rate_hz": of_late / (RECENT * self.window_s),
                "events": self.events,
                "lost": self.lost,
                "class": self.winner,
                "early": self.early,
                "classes": self.class_names,
                "evidence": self.evidence,
                "class_latency_s": _median_and_99(self._class_s),
                "host_latency_s": _median_and_99(*zip(*self._host_s, strict=True)) if self._host_s else None,
                "udp": self.sender
                and {"to": self.sender.destination, "events": self.sender.events, "failed": self.sender.failed},
            }

    def raster(self, lines: int, columns: int = COLUMNS) -> list[str]:
        """Return the raster as text: taxels as rows, time steps as columns, darker characters for more events."""
        with self._lock:
            steps = [(step, dict(counts)) for step, counts in self._steps]
        last = steps[-1][0] if steps else 0
        grid = [[0] * columns for _ in range(lines)]
        for step, counts in steps:
            if (at := columns - 1 - (last - step) * columns // STEPS) >= 0:
                for key, count in counts.items():
                    grid[(key >> 1) * lines // self.config.taxels][at] += count
        return ["".join(SHADES[min(count.bit_length(), len(SHADES) - 1)] for count in row) for row in grid]


def _median_and_99(values: Sequence[float], counts: Sequence[int] | None = None) -> list[float] | None:
    """Return the median and the 99 % quantile of counted values."""
    if not len(values):
        return None
    every = np.repeat(values, counts) if counts is not None else np.array(values)
    return [float(np.percentile(every, part, method="higher")) for part in (50, 99)]


def page() -> bytes:
    """Return the HTML of the live page."""
    text = resources.files("eskin.board").joinpath("page.html").read_text(encoding="utf-8")
    for name, colour in PALETTE.items():
        text = text.replace(f"%{name}%", colour)
    return text.encode()


class Copy:
    """The page's copy of a view, in a process of its own, so that no client slows a recording."""

    def __init__(self) -> None:
        self._lock, self._filled = threading.Lock(), threading.Event()
        self._said: dict[str, Any] = {"number": -1}
        self._steps: dict[int, Any] = {}
        self.piece = b""  # JSON

    def take(self, said: dict[str, Any], piece: Piece | None) -> None:
        """Add what is new in the view; ``piece`` is None for a known input."""
        with self._lock:
            if piece is not None:
                self._steps, self.piece = {}, json.dumps(asdict(piece)).encode()
            self._steps.update(said["steps"])
            self._steps = dict(sorted(self._steps.items())[-STEPS - 1 :])
            self._said = said
        self._filled.set()

    def state(self, number: int = 0, since: int = 0) -> bytes:
        """Return the JSON of the live page, starting from step ``since`` for a known input."""
        self._filled.wait()
        with self._lock:
            since = since if number == self._said["number"] else 0
            return json.dumps(self._said | {"steps": [one for one in self._steps.items() if one[0] >= since]}).encode()


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, copy: Copy, *arguments: Any) -> None:
        self.copy = copy
        super().__init__(*arguments)

    def do_GET(self) -> None:
        """Answer a request if its host header names this server."""
        port = cast(ThreadingHTTPServer, self.server).server_port
        if self.headers.get("Host") not in (f"127.0.0.1:{port}", f"localhost:{port}"):
            self.send_error(403)  # a foreign host name that resolves to this machine could read the events
            return
        place = urllib.parse.urlsplit(self.path)
        asked = {
            name: int(value)
            for name, value in urllib.parse.parse_qsl(place.query)
            if value.isdecimal() and len(value) < 19
        }
        if place.path == "/":
            content = page()
        elif place.path == "/state":
            content = self.copy.state(asked.get("number", 0), asked.get("since", 0))
        elif place.path == "/piece":
            content = self.copy.piece
        else:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8" if place.path == "/" else "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Suppress the log of requests."""


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore closed connections of the browser."""


def serve(listener: socket.socket, updates: Connection) -> None:
    """Serve the page from the copies that come from the recording process, and end with that process."""
    copy = Copy()
    server = _Server(listener.getsockname(), partial(_Handler, copy), bind_and_activate=False)
    server.socket.close()
    server.socket, server.server_port = listener, listener.getsockname()[1]
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            copy.take(*updates.recv())


def _publish(view: View, updates: Connection, ends: threading.Event) -> None:
    """Send what is new in a view at a fixed rate, whatever the page's clients do."""
    number = since = 0  # a view begins with number 1
    with suppress(OSError):  # the other process has ended
        while True:
            said = view.state(number, since)
            updates.send((said, view.piece if said["number"] != number else None))
            number, since = said["number"], max((step for step, _ in said["steps"]), default=0)
            if ends.wait(COPY_S):
                return


@contextmanager
def served(view: View, port: int, option: str = "--page") -> Iterator[int]:
    """Serve the live page to this machine only, and yield its port.

    A process of its own answers the clients, from a copy every ``COPY_S``. An error message names ``option``, which
    chooses another port.
    """
    listener = socket.socket()
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen()
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot serve a page on port {port}: {reason}; choose another {option}") from None
    spawn = multiprocessing.get_context("spawn")
    there, here = spawn.Pipe(duplex=False)
    process, ends = spawn.Process(target=serve, args=(listener, there), daemon=True), threading.Event()
    with listener, here:
        heard = signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the recording alone
        try:
            process.start()
        finally:
            signal.signal(signal.SIGINT, heard)
        there.close()
        publisher = threading.Thread(target=_publish, args=(view, here, ends), daemon=True)
        publisher.start()
        try:
            yield listener.getsockname()[1]
        finally:
            ends.set()
            process.terminate()
            process.join()
            publisher.join()
