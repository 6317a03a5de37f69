"""Measure loss and latency of events from a serial port over UDP to another program on this machine.

``python benchmarks/udp.py --json benchmarks/results/udp.json`` plays random events of an 8 x 8 array in real time: a
simulated receiver in a process of its own, the host program of ``eskin listen --udp`` with the state of its page, and
another process that receives the datagrams and counts the gaps in their numbers.
"""

import multiprocessing
import os
import socket
import time
from multiprocessing.connection import Connection
from typing import Annotated, Any

import numpy as np
import typer
from measure import JsonFile, write

from eskin.board import session
from eskin.board.config import BoardConfig
from eskin.board.demo import foreign_records
from eskin.board.link import Link
from eskin.board.live import View
from eskin.board.serial_frames import Kind
from eskin.board.simulated import SimulatedReceiver
from eskin.board.udp import UdpSender, read_datagram
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import ReadoutConfig

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


def measure(rate_hz: int, seconds: int) -> dict[str, Any]:
    """Return numbers of sent and received events and of lost datagrams, and the latency on the host."""
    spawn = multiprocessing.get_context("spawn")
    (board, board_end), (other, other_end) = spawn.Pipe(), spawn.Pipe()
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
    with Link(board.recv(), received, patience_s=60.0) as link:

        def watch(records: Any, events: Any) -> None:
            view(records, events, link.waited_s())
            waits.append((link.waited_s(), len(events)))

        received.watch = watch
        link.hello("receiver", BOARD)
        link.send(Kind.RESTART)
        begun = time.process_time()
        while received.count < rate_hz * seconds:
            link.receive()
        busy_s = time.process_time() - begun
    board.send(None)
    found = other.recv()
    for process in processes:
        process.join()
    sender.close()
    each = np.repeat(*map(np.array, zip(*waits, strict=True)))
    latency = {name: round(float(np.percentile(each, part)) * 1e3, 3) for name, part in (("median", 50), ("99 %", 99))}
    return {
        "events_per_s": rate_hz,
        "seconds": seconds,
        "sent": sender.events,
        "received": found["events"],
        "datagrams": found["datagrams"],
        "lost_datagrams": found["lost_datagrams"],
        "host_latency_ms": latency,
        "host_cpu_us_per_event": round(1e6 * busy_s / sender.events, 2),
    }


def main(
    rate: Annotated[int, typer.Option(help="events per second")] = 45_000,
    seconds: Annotated[int, typer.Option(help="duration")] = 20,
    json_file: JsonFile = None,
) -> None:
    """Run the benchmark, print the results, and write JSON."""
    report = {"cores": os.cpu_count(), "load_average": os.getloadavg()[0], "result": measure(rate, seconds)}
    print(report["result"])
    write(json_file, "udp", f"--rate {rate} --seconds {seconds}", report)


if __name__ == "__main__":
    typer.run(main)
