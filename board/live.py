"""Live display of a board: raster and class in the terminal, and a page for the browser."""

import json
import threading
import urllib.parse
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
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
                "classes": self.class_names,
                "evidence": self.evidence,
                "class_latency_s": _median_and_99(self._class_s),
                "host_latency_s": _median_and_99(*zip(*self._host_s, strict=True)) if self._host_s else None,
                "udp": self.sender and {"to": self.sender.destination, "events": self.sender.events},
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


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, view: View, *arguments: Any) -> None:
        self.view = view
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
            content = json.dumps(self.view.state(asked.get("number", 0), asked.get("since", 0))).encode()
        elif place.path == "/piece":
            content = json.dumps(asdict(self.view.piece)).encode()
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


@contextmanager
def served(view: View, port: int, option: str = "--page") -> Iterator[ThreadingHTTPServer]:
    """Serve the live page to this machine only, and yield the server.

    An error message names ``option``, which chooses another port.
    """
    try:
        server = _Server(("127.0.0.1", port), partial(_Handler, view))
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot serve a page on port {port}: {reason}; choose another {option}") from None
    with server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        try:
            yield server
        finally:
            server.shutdown()
