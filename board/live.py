"""What a board sends, to be looked at while it comes: raster, class, and a page for a browser."""

from __future__ import annotations

import json
import threading
from collections import Counter, deque
from collections.abc import Sequence
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any, cast

from eskin.base.errors import InputError
from eskin.board.records import Class, Event, Lost, Record

COLUMNS = 120
"""Steps of time that are shown."""

SHADES = " .:*#"


class View:
    """Events per address and step, for the last steps; the thread of the page reads what another writes.

    Parameters
    ----------
    addresses : int
    clocks_per_step : int
    clock_hz : float
    class_names : sequence of str
    """

    def __init__(self, addresses: int, clocks_per_step: int, clock_hz: float, class_names: Sequence[str] = ()) -> None:
        self.addresses, self.clocks_per_step, self.clock_hz = addresses, clocks_per_step, clock_hz
        self.class_names = list(class_names)
        self.events = self.lost = self.bins = self.clock = 0
        self.evidence: list[int] = []
        self.winner: str | None = None
        self._steps: deque[tuple[int, Counter[int]]] = deque(maxlen=COLUMNS)
        self._lock = threading.Lock()

    def __call__(self, records: list[Record]) -> None:
        """Take the records of a frame."""
        with self._lock:
            for record in records:
                self._take(record)

    def _take(self, record: Record) -> None:
        if isinstance(record, Event):
            self.events += 1
            self.clock = record.time
            step = record.time // self.clocks_per_step
            if not self._steps or self._steps[-1][0] != step:
                self._steps.append((step, Counter()))
            self._steps[-1][1][record.address] += 1
        elif isinstance(record, Class):
            self.bins += 1
            self.clock = record.time
            self.evidence = list(record.evidence)
            self.winner = self.class_names[record.winner] if record.winner < len(self.class_names) else None
        elif isinstance(record, Lost):
            self.lost += record.count

    def state(self) -> dict[str, Any]:
        """Return all that is shown, for JSON."""
        with self._lock:
            return {
                "addresses": self.addresses,
                "steps": [[step, sorted(counts.items())] for step, counts in self._steps],
                "columns": COLUMNS,
                "seconds": self.clock / self.clock_hz,
                "events": self.events,
                "lost": self.lost,
                "bins": self.bins,
                "class": self.winner,
                "classes": self.class_names,
                "evidence": self.evidence,
            }

    def raster(self, lines: int, columns: int = COLUMNS) -> list[str]:
        """Return the raster as text: addresses down, steps across, a darker sign for more events."""
        state = self.state()
        last = state["steps"][-1][0] if state["steps"] else 0
        grid = [[0] * columns for _ in range(lines)]
        for step, counts in state["steps"]:
            if 0 <= (at := columns - 1 - (last - step)) < columns:  # the clock of a board that was reset runs backwards
                for address, count in counts:
                    grid[min(address * lines // self.addresses, lines - 1)][at] += count
        return ["".join(SHADES[min(count.bit_length(), len(SHADES) - 1)] for count in row) for row in grid]


class _Handler(BaseHTTPRequestHandler):
    """Answers a browser on this machine: the page, and what it shows."""

    def __init__(self, view: View, *arguments: Any) -> None:
        self.view = view
        super().__init__(*arguments)

    def do_GET(self) -> None:
        """Answer a request that was made to this page by its own name."""
        port = cast(ThreadingHTTPServer, self.server).server_port
        if self.headers.get("Host") not in (f"127.0.0.1:{port}", f"localhost:{port}"):
            self.send_error(403)  # a page of another name, which its owner lets lead here, would read the events
            return
        if self.path == "/":
            content, kind = (
                resources.files("eskin.board").joinpath("page.html").read_bytes(),
                "text/html; charset=utf-8",
            )
        elif self.path == "/state":
            content, kind = json.dumps(self.view.state()).encode(), "application/json"
        else:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Say nothing."""


def serve(view: View, port: int) -> ThreadingHTTPServer:
    """Serve the page to browsers of this machine alone; ``server_port`` says where, ``shutdown`` ends it.

    Raises
    ------
    InputError
        If the port is taken.
    """
    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), partial(_Handler, view))
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot serve a page on port {port}: {reason}; choose another --page") from None
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server
