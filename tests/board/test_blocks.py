"""Test the blocks of a board: packets, samples and records compared with the Python codec, and rejected packets."""

from typing import Any

import numpy as np
import pytest
from amaranth.sim import Simulator

from eskin.board.changes import ChangeCoder
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.gateware.loader import Loader
from eskin.board.gateware.recorder import Recorder
from eskin.board.gateware.serial_frames import FrameReceiver, FrameSender
from eskin.board.records import COUNT_BITS, Class, Event, Reason, RecordReader, additions
from eskin.board.serial_frames import Frame, FrameReader, Kind
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig

SERIAL = SerialConfig(baud=12_500_000, buffer_bytes=512, idle_bits=32, records=128)


def sent_by_rtl(words: list[int]) -> bytes:
    """Return the bytes that the RTL sends for waiting words."""
    dut = FrameSender(SERIAL)
    out = bytearray()
    left = list(words)

    async def bench(ctx: Any) -> None:
        ctx.set(dut.ready, 1)
        for _ in range(4000):
            ctx.set(dut.level, len(left))
            ctx.set(dut.word, left[0] if left else 0)
            if ctx.get(dut.valid):
                out.append(ctx.get(dut.byte))
            if ctx.get(dut.take):
                left.pop(0)
            await ctx.tick()

    simulate(dut, bench)
    return bytes(out)


def received_by_rtl(data: bytes, keep: bool = True) -> tuple[bytes, list[tuple[int, int, int]], int]:
    """Return the bytes that the RTL accepts, the rejections, and the started sessions."""
    dut = FrameReceiver(SERIAL)
    taken, refused, sessions = bytearray(), [], 0

    async def bench(ctx: Any) -> None:
        nonlocal sessions
        ctx.set(dut.ready, keep)
        queue: list[int | None] = [b for byte in data for b in (byte, None, None)]
        for byte in [*queue, *[None] * 300]:
            ctx.set(dut.byte_valid, byte is not None)
            ctx.set(dut.byte, byte or 0)
            if ctx.get(dut.valid) and keep:
                taken.append(ctx.get(dut.data))
            if ctx.get(dut.refused):
                refused.append(tuple(ctx.get(getattr(dut, f"refused_{n}")) for n in ("sequence", "expected", "reason")))
            sessions += ctx.get(dut.session)
            await ctx.tick()

    simulate(dut, bench)
    return bytes(taken), refused, sessions


def simulate(dut: Any, bench: Any) -> None:
    simulator = Simulator(dut)
    simulator.add_clock(1e-6)
    simulator.add_testbench(bench)
    simulator.run()


def body(frame: Frame) -> bytes:
    return bytes([frame.kind, frame.sequence, len(frame.payload)]) + frame.payload


HELLO = Frame(Kind.HELLO, 0, b"")
GOOD = Frame(Kind.SAMPLES, 1, bytes([0x7E, 0x7D, 0, 255, 0x7E ^ 0x20, 9]))


def test_words_go_out_as_the_codec_reads_them() -> None:
    words = [0x7E7D_7E7D, 0, 0xFFFF_FFFF, *range(70)]
    frames = list(FrameReader().feed(sent_by_rtl(words)))
    assert [frame.kind for frame in frames] == [Kind.RECORDS] * 2  # type: ignore[union-attr]
    assert [frame.sequence for frame in frames] == [0, 1]  # type: ignore[union-attr]
    assert b"".join(f.payload for f in frames) == b"".join(w.to_bytes(4, "little") for w in words)  # type: ignore[union-attr]


def altered(frame: Frame, place: int, bit: int) -> bytes:
    data = bytearray(frame.encode())
    data[place] ^= 1 << bit
    return bytes(data)


NEXT = Frame(Kind.RUN, 2, bytes(4))
AGAIN = Frame(Kind.RUN, 1, b"\x01\x02\x03\x04")
DAMAGED = (1, 1, Reason.DAMAGED)

RECEIVED: dict[str, tuple[bytes, bytes, list[tuple[int, int, int]]]] = {
    "a good frame": (GOOD.encode(), body(GOOD), []),
    "a bit flipped in the payload": (altered(GOOD, 8, 3), b"", [DAMAGED]),
    "a bit flipped in the length": (altered(GOOD, 3, 0), b"", [DAMAGED]),
    "a byte lost": (GOOD.encode()[:7] + GOOD.encode()[8:], b"", [DAMAGED]),
    "a frame that stops": (GOOD.encode()[:-3], b"", [DAMAGED]),
    "a frame lost": (NEXT.encode(), b"", [(2, 1, Reason.SEQUENCE)]),
    "a frame twice": (GOOD.encode() * 2, body(GOOD), [(1, 2, Reason.SEQUENCE)]),
    "a new session": (altered(GOOD, 8, 3) + HELLO.encode() + AGAIN.encode(), body(AGAIN), [DAMAGED]),
}
"""Bytes after a greeting, the data that come in, and the rejections (sequence number, expected number, reason)."""


@pytest.mark.parametrize("what", RECEIVED)
def test_only_good_frames_come_in(what: str) -> None:
    data, taken, refused = RECEIVED[what]
    assert received_by_rtl(HELLO.encode() + data) == (taken, refused, 1 + ("session" in what))


def test_a_frame_without_room_is_refused_as_a_whole() -> None:
    frames = [Frame(Kind.SAMPLES, number, bytes([number]) * 240) for number in (1, 2, 3)]
    _, refused, _ = received_by_rtl(HELLO.encode() + b"".join(f.encode() for f in frames), keep=False)
    assert refused == [(3, 3, Reason.OVERRUN)]


# -- samples by their changes ------------------------------------------------------------------------


def player(rows: int, columns: int, **readout: Any) -> BoardConfig:
    config = ReadoutConfig(rows=rows, columns=columns, clocks_per_sample=4, **readout)
    network = ClassifierConfig(
        inputs=config.taxels * (1 + config.has_polarity), hidden=8, classes=2, lanes=2, bin_s=0.01
    )
    return BoardConfig(chip=ChipConfig(readout=config, classifier=network), serial=SERIAL)


def loaded_by_rtl(config: BoardConfig, frames: list[Frame]) -> tuple[list[int], list[int], int]:
    """Return the samples at each tick, the acknowledged frames, and the number of unknown ones."""
    dut = Loader(config)
    ticks, acks, unknown = [], [], 0

    async def bench(ctx: Any) -> None:
        nonlocal unknown
        for name in ("ack_ready", "unknown_ready", "run"):
            ctx.set(getattr(dut, name), 1)
        queue = [byte for frame in frames for byte in body(frame)]
        quiet = 0
        while quiet < 40:
            ctx.set(dut.run, ctx.get(dut.active))
            ctx.set(dut.valid, bool(queue))
            ctx.set(dut.data, queue[0] if queue else 0)
            if ctx.get(dut.ready) and queue:
                queue.pop(0)
            if ctx.get(dut.sample_valid & dut.run):
                ticks.append(ctx.get(dut.sample))
            if ctx.get(dut.ack_valid):
                acks.append(ctx.get(dut.ack_sequence))
            unknown += ctx.get(dut.unknown_valid)
            quiet = 0 if queue or ctx.get(dut.active) else quiet + 1
            await ctx.tick()

    simulate(dut, bench)
    return ticks, acks, unknown


@pytest.mark.parametrize(
    ("rows", "columns", "readout"),
    [(3, 5, {"resolution": 6}), (1, 1, {"encoding": "nlcs"}), (2, 2, {"encoding": "nlcs", "sample_bits": 16})],
)
def test_changes_become_the_samples_that_the_encoder_reads(rows: int, columns: int, readout: dict[str, Any]) -> None:
    """Steps, turns, jumps, rest, and ticks that are sent whole: all taxels at once over the full scale."""
    config = player(rows, columns, **readout)
    own, rng = config.chip.readout, np.random.default_rng(7)
    low, high = ChangeCoder(own).low, own.full_scale
    walk = np.cumsum(rng.choice([0, 0, 0, 1, -1, 1, 5], (12, own.taxels)) << low, axis=0)
    ends = np.where(np.arange(4)[:, None] % 2, high - 1, -high).repeat(own.taxels, axis=1)
    samples = np.vstack([walk, ends, walk[::-1], np.repeat(walk[:1], 600 if own.taxels == 1 else 3, axis=0)])
    samples = samples.clip(-high, high - 1)
    parts = list(ChangeCoder(own).feed(samples))
    assert sum(part.ticks for part in parts) == len(samples)
    assert {part.kind for part in parts} == ({Kind.CHANGES, Kind.SAMPLES} if own.sample_bits == 16 else {Kind.CHANGES})
    frames = [Frame(Kind.RESTART, 0, b"")]
    frames += [Frame(part.kind, number % 256, part.payload) for number, part in enumerate(parts, 1)]
    ticks, acks, unknown = loaded_by_rtl(config, frames)
    assert (acks, unknown) == ([frame.sequence for frame in frames], 0)
    mask = (1 << own.sample_bits) - 1
    found = [[tick >> own.sample_bits * n & mask for n in range(own.taxels)] for tick in ticks]
    assert np.array_equal(np.array(found) >> low, (samples & mask) >> low)


def test_a_frame_of_changes_that_ends_too_early_or_too_late_is_refused() -> None:
    config = player(2, 2)
    good = bytes([2, 0])  # two ticks of four zeros
    for payload, refused in ((good, 0), (bytes([3, 0]), 1), (good + b"x", 1), (bytes([0, 0]), 1), (b"x", 1)):
        _, acks, unknown = loaded_by_rtl(config, [Frame(Kind.RESTART, 0, b""), Frame(Kind.CHANGES, 1, payload)])
        assert (acks, unknown) == ([0] if refused else [0, 1], refused), payload


def test_short_events_are_the_events() -> None:
    """Usual and other intervals, the next address and any other, long pauses, classes and frames between them."""
    config, rng = player(3, 5), np.random.default_rng(3)
    dut = Recorder(config)
    gaps = rng.choice([4, 4, 4, 9, 254, 255, 70_000], 150)
    addresses = np.where(rng.random(150) < 0.5, np.arange(150), rng.integers(0, 30, 150)) % 30
    events = [Event(int(t), int(a)) for t, a in zip(np.cumsum(gaps), addresses, strict=True)]
    words: list[int] = []
    found: list[Any] = []

    async def bench(ctx: Any) -> None:
        ctx.set(dut.short, 1)
        queue, ends, level = list(events), 0, 0
        for clock in range(20_000):
            takes = clock % 4 == 0 and level > 0  # a word shows a clock after it counts
            level = ctx.get(dut.level)
            ctx.set(dut.take, takes)
            if takes:
                words.append(ctx.get(dut.word))
            comes = bool(queue) and clock % 3 == 0 and bool(ctx.get(dut.idle))
            ctx.set(dut.event_valid, comes)
            ctx.set(dut.class_valid, comes and len(queue) % 30 == 0)
            ctx.set(dut.ack_valid, clock % 97 < 5)
            ctx.set(dut.rests, not queue or clock % 200 < 10)
            if comes:
                ctx.set(dut.event_time, queue[0].time)
                ctx.set(dut.event_address, queue.pop(0).address)
            ends = ends + 1 if not queue else 0
            if ends > 300:
                break
            await ctx.tick()

    simulate(dut, bench)
    reader = RecordReader(2, 30, additions(config) >> COUNT_BITS)
    for word in words:
        found += reader.feed(word.to_bytes(4, "little"))
    assert [one for one in found if isinstance(one, Event)] == events
    assert sum(word >> 28 == 8 for word in words) > 40
    assert sum(isinstance(one, Class) for one in found) == 5
