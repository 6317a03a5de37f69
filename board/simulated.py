"""Simulated board: the golden model with the board's serial protocol at a pseudo-terminal."""

from __future__ import annotations

import math
import os
import select
import threading
import time
import tty
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.board.config import BoardConfig
from eskin.board.records import (
    STATUS_WORDS,
    Ack,
    Event,
    Feature,
    Record,
    RecordWriter,
    Tag,
    Words,
    additions,
    classes_of,
    hello_values,
)
from eskin.board.serial_frames import MAX_PAYLOAD, Damaged, Frame, FrameReader, Kind
from eskin.model.classifier.chip import channels_of, simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import network_of

NAP_S, MAX_NAP_S = 0.001, 0.02  # wait for bytes of the host
AT_ONCE = 4096  # records that are sent before the board looks for frames again
WORDS_OF_A_FRAME = MAX_PAYLOAD // 4
WEIGHT_HEAD = 3
MAX_COST = Frame(Kind.SAMPLES, 0, bytes(MAX_PAYLOAD)).cost


class SimulatedBoard:
    """Simulated board that answers a host from its own thread at the pseudo-terminal ``port``.

    ``clock_hz`` is the clock of the times in the records. The speed is seconds of the records per second of the host;
    by default everything is sent at once.
    """

    def __init__(self, config: BoardConfig, clock_hz: float, speed: float | None = None) -> None:
        self.config = config
        self.clocks_per_s = math.inf if speed is None else speed * clock_hz
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._origin = (0.0, 0.0)
        self._ending = False
        self._out: deque[tuple[int, Record]] = deque()  # bytes to send, and the clock of their transmission
        self._begin()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> SimulatedBoard:
        self._thread.start()
        return self

    def __exit__(self, *error: Any) -> None:
        self._ending = True
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)

    def carry_out(self, frame: Frame) -> list[Record]:
        """Execute a frame, and return the answer."""
        raise NotImplementedError

    def _run(self) -> None:
        reader = FrameReader()
        while not self._ending:
            wait = MAX_NAP_S
            if self._out:
                left = (self._out[0][0] - self._now()) / self.clocks_per_s if self.clocks_per_s < math.inf else 0.0
                wait = min(max(left, NAP_S), MAX_NAP_S)
            if select.select([self._master], [], [], wait)[0]:
                for frame in reader.feed(os.read(self._master, 1 << 16)):
                    self._take(frame)
            self._send_due()

    def _take(self, frame: Frame | Damaged) -> None:
        """Execute a frame of the host, which sends only good frames in order."""
        assert isinstance(frame, Frame), frame
        if frame.kind == Kind.HELLO:
            self._begin()
            early = additions(self.config) & Feature.EARLY
            self._say([Words(Tag.HELLO, hello_values(self.config), early)])
            return
        self.taken += 1
        assert frame.sequence == self.taken % 256, frame
        self._say(self.carry_out(frame))

    def _begin(self) -> None:
        self._sequence = self.taken = 0
        self._writer = RecordWriter()
        self._out.clear()

    def _restart_at(self, clock: float) -> None:
        self._origin = (time.monotonic(), clock)

    def _now(self) -> float:
        begun, clock = self._origin
        return math.inf if self.clocks_per_s == math.inf else clock + (time.monotonic() - begun) * self.clocks_per_s

    def _send_due(self) -> None:
        now = self._now()
        records: list[Record] = []
        while self._out and self._out[0][0] <= now and len(records) < AT_ONCE:
            records.append(self._out.popleft()[1])
        if records:
            self._say(records)

    def framed(self, records: list[Record]) -> bytearray:
        """Return the next frames with records for the host."""
        words = self._writer.feed(records)
        frames = bytearray()
        for at in range(0, len(words), WORDS_OF_A_FRAME):
            payload = b"".join(word.to_bytes(4, "little") for word in words[at : at + WORDS_OF_A_FRAME])
            frames += Frame(Kind.RECORDS, self._sequence, payload).encode()
            self._sequence = (self._sequence + 1) % 256
        return frames

    def _say(self, records: list[Record]) -> None:
        frames = self.framed(records)
        while frames and not self._ending:
            if select.select([], [self._master], [], MAX_NAP_S)[1]:
                del frames[: os.write(self._master, frames)]

    def _status(self, clock: int, **counts: int) -> Words:
        low, high = clock & 0xFFFFFFFF, clock >> 32
        values = dict.fromkeys(STATUS_WORDS, 0) | {"time_low": low, "time_high": high, "taken": self.taken}
        return Words(Tag.STATUS, values | counts)


class SimulatedPlayer(SimulatedBoard):
    """Simulated board with readout and classifier, computed by the golden models.

    The models run when the host asks for the status, or cannot send more frames into the buffer. Samples may come from
    ``RESTART`` on until the first ``RUN``.
    """

    def __init__(self, config: BoardConfig, speed: float | None = None) -> None:
        assert config.chip is not None
        self.chip: ChipConfig = config.chip
        classifier = self.chip.classifier
        self._memories = ([0] * classifier.weight_words, [0] * classifier.neuron_words)
        self._reset()
        super().__init__(config, self.chip.clock_hz, speed)

    def _reset(self) -> None:
        self._samples, self._run_clocks, self._done, self._waiting = bytearray(), 0, 0, 0
        self._acks: list[tuple[int, Record]] = []
        self._counts: dict[str, int] = {}

    def carry_out(self, frame: Frame) -> list[Record]:
        """Execute a frame, and return the answer; samples and clocks to run are acknowledged at their clock."""
        ack = Ack(frame.sequence)
        if frame.kind == Kind.SAMPLES and not self._run_clocks:
            self._samples += frame.payload
            self._acks.append((max(self._clocks - self.chip.readout.clocks_per_sample, 0), ack))
        elif frame.kind == Kind.RUN:
            self._run_clocks += int.from_bytes(frame.payload, "little")
            self._acks.append((self._clocks, ack))
        elif frame.kind in (Kind.RESTART, Kind.WEIGHTS):
            self._reset()
            self._restart_at(0)
            if frame.kind == Kind.WEIGHTS:
                self._load(frame.payload)
            return [ack]
        elif frame.kind == Kind.STATUS:
            self._simulate()
            self._out += [(self._done, self._status(self._done, **self._counts)), (self._done, ack)]
            return []
        else:
            raise NotImplementedError(frame)
        self._waiting += frame.cost
        if self._waiting + MAX_COST > self.config.serial.buffer_bytes:
            self._simulate()
        return []

    def _load(self, payload: bytes) -> None:
        size, at = self.config.word_bytes, int.from_bytes(payload[1:WEIGHT_HEAD], "little")
        for place in range(WEIGHT_HEAD, len(payload), size):
            self._memories[payload[0]][at] = int.from_bytes(payload[place : place + size], "little")
            at += 1

    @property
    def _ticks(self) -> int:
        return len(self._samples) // (2 * self.chip.readout.taxels)

    @property
    def _clocks(self) -> int:
        return self._ticks * self.chip.readout.clocks_per_sample + self._run_clocks

    def _simulate(self) -> None:
        """Simulate up to the last clock requested by the host."""
        if not self._acks:
            return
        chip, clocks, now = self.chip, self._clocks, self._now()
        whole = bytes(self._samples[: self._ticks * 2 * chip.readout.taxels])
        samples: NDArray[np.int32] = np.frombuffer(whole, "<i2").reshape(-1, chip.readout.taxels).astype(np.int32)
        run = simulate_chip(chip, network_of(chip.classifier, *self._memories), samples, clocks)
        channels = channels_of(chip, run.events).tolist()
        made: list[tuple[int, Record]] = [
            (time, Event(time, channel)) for time, channel in zip(run.events["t"].tolist(), channels, strict=True)
        ]
        made += [(one.time, one) for one in classes_of(run.classifier, clocks)]
        made = [(time, record) for time, record in made if self._done <= time < clocks]
        self._restart_at(min(now, self._done))  # the time stands still while the models run
        self._out.extend(sorted([*made, *self._acks], key=lambda item: item[0]))
        self._counts = {"events": len(channels), "bins": len(run.classifier.bins), "stalls": run.classifier.stalled}
        self._done, self._acks, self._waiting = clocks, [], 0


class SimulatedReceiver(SimulatedBoard):
    """Simulated AER receiver that gets the given events (clock of the board, address) after every ``RESTART``."""

    def __init__(self, config: BoardConfig, events: list[tuple[int, int]], speed: float | None = None) -> None:
        self.events: list[tuple[int, Record]] = [(time, Event(time, address)) for time, address in events]
        super().__init__(config, config.serial.clock_hz, speed)

    def carry_out(self, frame: Frame) -> list[Record]:
        """Execute a frame immediately, and return the answer."""
        if frame.kind == Kind.RESTART:
            self._restart_at(0)
            self._out = deque(self.events)
            return [Ack(frame.sequence)]
        if frame.kind == Kind.STATUS:
            last = self.events[-1][0] + 1 if self.events else 0
            clock = last if self.clocks_per_s == math.inf else int(self._now())
            return [self._status(clock, events=len(self.events) - len(self._out)), Ack(frame.sequence)]
        raise NotImplementedError(frame)
