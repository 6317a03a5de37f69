"""Measure loss and latency of events from a serial port over UDP to another program on this machine.

``python benchmarks/udp.py --json benchmarks/results/udp.json`` plays random events of an 8 x 8 array in real time: a
simulated receiver in a process of its own, the host program of ``eskin listen --udp`` with its journal and its page, a
process of clients that ask the page as fast as it answers, and another process that receives the datagrams and counts
the gaps in their numbers. The recording must have every event.
"""

import multiprocessing
import os
import socket
import tempfile
import threading
import time
import urllib.request
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from measure import JsonFile, write

from eskin.board import session
from eskin.board.config import BoardConfig
from eskin.board.demo import foreign_records
from eskin.board.link import Link
from eskin.board.live import View, served
from eskin.board.serial_frames import Kind
from eskin.board.simulated import SimulatedReceiver
from eskin.board.udp import UdpSender, read_datagram
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording

BOARD = BoardConfig(chip=None)
CLOCK_HZ = BOARD.serial.clock_hz
SILENCE_S = 2.0
"""Time without a datagram after which the receiver stops."""


def send(pipe: Connection, rate_hz: int, seconds: int) -> None:
    """Simulate a board that sends random events."""
    config, rng = ReadoutConfig(), np.random.default_rng(0)
    events = np.zeros(rate_hz * seconds, EVENT_DTYPE)
    events["t"] = np.sort(rng.integers(0, config.clock_hz * seconds, len(events)))
    events["x"], events["y"] = rng.integers(0, 8, (2, len(events)))
    events["p"] = rng.integers(0, 2, len(events))
    with SimulatedReceiver(BOARD, foreign_records(config, events, CLOCK_HZ), speed=1.0) as board:
        pipe.send(board.port)
        pipe.recv()


def receive(pipe: Connection) -> None:
    """Receive UDP datagrams; count events and missing datagrams."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        pipe.send(listener.getsockname()[1])
        events = datagrams = 0
        last = -1
        try:
            while True:
                number, found = read_datagram(listener.recv(1 << 16))
                listener.settimeout(SILENCE_S)
                events, datagrams, last = events + len(found), datagrams + 1, max(last, number)
        except TimeoutError:
            pipe.send({"events": events, "datagrams": datagrams, "lost_datagrams": last + 1 - datagrams})


def look(pipe: Connection, port: int, clients: int) -> None:
    """Ask the page for its whole state again and again, and count the answers."""
    answers, ends = [0] * clients, threading.Event()

    def ask(number: int) -> None:
        while not ends.is_set():
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/state") as answer:
                answer.read()
            answers[number] += 1

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(clients)]
    for thread in threads:
        thread.start()
    pipe.recv()
    ends.set()
    for thread in threads:
        thread.join()
    pipe.send(sum(answers))


def measure(rate_hz: int, seconds: int, clients: int, path: Path) -> dict[str, Any]:
    """Return numbers of sent and received events and of lost datagrams, and the latency on the host."""
    spawn = multiprocessing.get_context("spawn")
    (board, board_end), (other, other_end), (page, page_end) = spawn.Pipe(), spawn.Pipe(), spawn.Pipe()
    processes = [
        spawn.Process(target=send, args=(board_end, rate_hz, seconds)),
        spawn.Process(target=receive, args=(other_end,)),
    ]
    for process in processes:
        process.start()
    config = ReadoutConfig()
    view, sender = View(config, CLOCK_HZ, 3.0), UdpSender(f"127.0.0.1:{other.recv()}", CLOCK_HZ)
    received = session.Received(session.foreign_events(config), forward=sender, keep=False)
    waits: list[tuple[float, int]] = []
    with (
        Link(board.recv(), received, patience_s=60.0) as link,
        served(view, 0) as port,
        session.recording(path, config, {}, received),
    ):
        processes.append(spawn.Process(target=look, args=(page_end, port, clients)))
        processes[-1].start()

        def watch(records: Any, events: Any) -> None:
            view(records, events, link.waited_s())
            waits.append((link.waited_s(), len(events)))

        received.watch = watch
        link.hello("receiver", BOARD)
        link.send(Kind.RESTART)
        begun, began = time.process_time(), time.monotonic()
        while received.count < rate_hz * seconds:
            link.receive()
        busy_s, took_s = time.process_time() - begun, time.monotonic() - began
        page.send(None)
        answers = page.recv()
    board.send(None)
    recorded = len(Recording.load(path).events)
    found = other.recv()
    for process in processes:
        process.join()
    sender.close()
    each = np.repeat(*map(np.array, zip(*waits, strict=True)))
    latency = {name: round(float(np.percentile(each, part)) * 1e3, 3) for name, part in (("median", 50), ("99 %", 99))}
    return {
        "events_per_s": rate_hz,
        "seconds": seconds,
        "took_s": round(took_s, 2),
        "recorded": recorded,
        "clients": clients,
        "answers_per_s": round(answers / took_s),
        "sent": sender.events,
        "received": found["events"],
        "datagrams": found["datagrams"],
        "lost_datagrams": found["lost_datagrams"],
        "host_latency_ms": latency,
        "host_cpu_us_per_event": round(1e6 * busy_s / sender.events, 2),
    }


def main(
    rate: Annotated[int, typer.Option(help="events per second")] = 90_000,
    seconds: Annotated[int, typer.Option(help="duration")] = 60,
    clients: Annotated[int, typer.Option(help="clients of the page")] = 10,
    json_file: JsonFile = None,
) -> None:
    """Run the benchmark, print the results, and write JSON."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        result = measure(rate, seconds, clients, Path(folder) / "heard.npz")
    print(result)
    options = f"--rate {rate} --seconds {seconds} --clients {clients}"
    write(json_file, "udp", options, {"cores": os.cpu_count(), "load_average": load, "result": result})


if __name__ == "__main__":
    typer.run(main)
