"""Test the blocks of a board: frames compared with the Python codec, and rejected frames."""

from __future__ import annotations

from typing import Any

import pytest
from amaranth.sim import Simulator

from eskin.board.config import SerialConfig
from eskin.board.gateware.serial_frames import FrameReceiver, FrameSender
from eskin.board.records import Reason
from eskin.board.serial_frames import Frame, FrameReader, Kind

SERIAL = SerialConfig(clocks_per_bit=4, buffer_bytes=512, idle_bits=32, records=128)


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


def test_good_frames_come_in() -> None:
    taken, refused, sessions = received_by_rtl(HELLO.encode() + GOOD.encode())
    assert (taken, refused, sessions) == (body(GOOD), [], 1)


def altered(frame: Frame, place: int, bit: int) -> bytes:
    data = bytearray(frame.encode())
    data[place] ^= 1 << bit
    return bytes(data)


NEXT = Frame(Kind.RUN, 2, bytes(4))

REFUSED = {
    "a bit flipped in the payload": (HELLO.encode() + altered(GOOD, 8, 3), (1, 1, Reason.DAMAGED)),
    "a bit flipped in the length": (HELLO.encode() + altered(GOOD, 3, 0), (1, 1, Reason.DAMAGED)),
    "a byte lost": (HELLO.encode() + GOOD.encode()[:7] + GOOD.encode()[8:], (1, 1, Reason.DAMAGED)),
    "a frame that stops": (HELLO.encode() + GOOD.encode()[:-3], (1, 1, Reason.DAMAGED)),
    "a frame lost": (HELLO.encode() + NEXT.encode(), (2, 1, Reason.SEQUENCE)),
    "a frame twice": (HELLO.encode() + GOOD.encode() * 2, (1, 2, Reason.SEQUENCE)),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_no_good_frame_is_refused_and_never_data(what: str) -> None:
    data, reason = REFUSED[what]
    taken, refused, _ = received_by_rtl(data)
    assert taken == (body(GOOD) if "twice" in what else b"")
    assert refused == [tuple(map(int, reason))]


def test_a_frame_without_room_is_refused_as_a_whole() -> None:
    """Check that a frame that exceeds the buffer space is rejected completely."""
    frames = [Frame(Kind.SAMPLES, number, bytes([number]) * 240) for number in (1, 2, 3)]
    _, refused, _ = received_by_rtl(HELLO.encode() + b"".join(f.encode() for f in frames), keep=False)
    assert refused == [(3, 3, Reason.OVERRUN)]


def test_a_session_empties_what_waits() -> None:
    again = Frame(Kind.RUN, 1, b"\x01\x02\x03\x04")
    data = HELLO.encode() + altered(GOOD, 8, 3) + HELLO.encode() + again.encode()
    taken, refused, sessions = received_by_rtl(data)
    assert (taken, len(refused), sessions) == (body(again), 1, 2)
