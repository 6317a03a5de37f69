"""Test script for a board: all frames, transmission errors, sessions, resets and full memories."""

import json
import os
import random
import zlib
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import Timer
from cocotb.utils import get_sim_time

from eskin.board.changes import ChangeCoder
from eskin.board.config import ADDRESS_BITS, BOTH_FLAG, OFF_FLAG, BoardConfig, SerialConfig
from eskin.board.records import Class, Event, Record, Refused, Words
from eskin.board.serial_frames import ESCAPE, FLAG, MAX_PAYLOAD, Frame, Kind
from eskin.cocotb_tests.bench.line import CLOCK_NS
from eskin.model.classifier.chip_config import ChipConfig
from eskin.verify.coverage.boards.host import JOB, QUIET_BITS, RUN_CLOCKS, Host, Mismatch, damaged

LONGEST_RUN = (1 << 32) - 1
MAX_SAMPLES = MAX_PAYLOAD // 2 * 2


@cocotb.test()
async def host_does_everything(dut: Any) -> None:
    """Run all host actions and disturbances, and check every response."""
    job = json.loads(Path(os.environ[JOB]).read_text())
    chip = ChipConfig.from_dict(job["chip"]) if job["chip"] else None
    config = BoardConfig(chip=chip, serial=SerialConfig(**job["serial"]))
    host = Host(dut, config, random.Random(job["seed"]))
    if config.chip is None:
        dut.aer_req.value = 0
        dut.aer_req_off.value = 0
        dut.aer_addr.value = 0
    Clock(dut.clk, CLOCK_NS, "ns").start()
    await host.reset()
    await host.bad(Frame(Kind.STATUS, 9, b"").encode(), 2, 9)  # in front of any session
    await the_line(host)
    await frames(host)
    if config.chip is None:
        await foreign(host)
    else:
        await player(host, job)
    await a_whole_round(host)
    await full(host)
    await sessions(host)


# -- any board ---------------------------------------------------------------------------------------


async def the_line(host: Host) -> None:
    """Test noise on the line, a line stuck low, and repeated flags."""
    await host.hello()
    for low in (0.2, 0.3, 0.4):
        await host.level(0, low)
        await host.level(1, 12)
    await host.expect()
    await host.level(0, 40)
    await host.level(1, 3)
    await host.bad(bytes([FLAG, FLAG, FLAG]), 1)
    await host.status()


async def frames(host: Host) -> None:
    """Test the rejection of damaged, out-of-order, too long and unknown frames, each followed by a valid frame."""
    await host.hello(number=host.rng.randrange(256))
    await host.carry_out(Kind.RESTART)
    due = Frame(Kind.RESTART, host.sequence, b"")
    await host.bad(damaged(due, [3]), 1)
    await host.bad(damaged(due, [4]), 1)
    await host.bad(damaged(Frame(Kind.SAMPLES, host.sequence, bytes(range(20))), [9]), 1, host.sequence)
    for length in (1, 2, 3, 6):
        await host.bad(bytes([FLAG, *range(1, length + 1), FLAG]), 1)
    await host.bad(due.encode()[:-1] + bytes([ESCAPE, FLAG]), 1)
    await host.bad(bytes([FLAG]) + bytes(300) + bytes([FLAG]), 1)
    await host.bad(bytes([FLAG]) + bytes(range(1, 100)) * 8 + bytes([FLAG]), 3)
    wrong = Frame(Kind.RESTART, host.sequence, b"abc").encode()  # the right CRC of another length
    body = bytearray(wrong[1:-5])
    body[2] = 2
    await host.bad(bytes([FLAG]) + with_crc(bytes(body)) + bytes([FLAG]), 1, host.sequence)
    for number in (host.sequence - 1, host.sequence + 1, host.sequence + 128):
        await host.bad(Frame(Kind.STATUS, number % 256, b"").encode(), 2, number % 256)
    stopped = Frame(Kind.RESTART, host.sequence, b"").encode()
    await host.bad(stopped[:4], 1, host.sequence)  # and then nothing
    await host.bad(stopped[:2], 1)
    await host.unknown(0)
    await host.unknown(Kind.RECORDS, b"xyz")
    await host.unknown(Kind.HELLO + 0x40, bytes(range(256))[:MAX_PAYLOAD])
    await host.unknown(Kind.RESTART, b"12")
    await host.unknown(Kind.STATUS, b"12")
    if host.config.chip is None:
        for kind in (Kind.SAMPLES, Kind.RUN, Kind.WEIGHTS):
            await host.unknown(kind, bytes(4))
    await host.status()


def with_crc(body: bytes) -> bytes:
    """Return a frame body with CRC, escaped."""
    whole = body + zlib.crc32(body).to_bytes(4, "little")
    stuffed = (bytes([ESCAPE, byte ^ 0x20]) if byte in (FLAG, ESCAPE) else bytes([byte]) for byte in whole)
    return b"".join(stuffed)


async def a_whole_round(host: Host) -> None:
    """Send frames until all sequence numbers have wrapped around."""
    await host.hello()
    for number in range(300):
        await host.put(Frame(Kind.RESTART, host.sequence, b"").encode())
        host.sequence = (host.sequence + 1) % 256
        host.taken += 1
        if number % 2:
            await host.bits(150)
    await host.quiet()
    numbers = [one.sequence for one in host.said]  # type: ignore[union-attr]
    host.said.clear()
    if numbers != [(1 + n) % 256 for n in range(300)]:
        raise Mismatch(f"the board acknowledges {numbers}")
    host.data = []
    await host.status()


async def full(host: Host) -> None:
    """Send queries until the output memory is full, and check that all are answered in order."""
    await host.hello()
    acks = [await host.send(Kind.STATUS) for _ in range(25)]
    for _ in range(4):  # the first rejection waits for its record; later rejections may only be counted
        await host.put(damaged(Frame(Kind.STATUS, host.sequence, b""), [4]))
        host.refused += 1
    await host.quiet()
    said = [one for one in host.said if one in acks]
    taken = [one.values["taken"] for one in host.said if isinstance(one, Words)]
    refused = [one for one in host.said if isinstance(one, Refused) and one.reason == 1]
    told = 2 * len(acks) + len(refused)
    if said != acks or len(host.said) != told or taken != sorted(taken) or not 0 < len(refused) <= 4:
        raise Mismatch(f"asked {len(acks)} times the board says {host.said}")
    host.said.clear()
    await host.status()
    for count in (8, 9, 10, 11, 12, 20):  # and a session begins in the middle of it
        for _ in range(count):
            await host.send(Kind.STATUS)
        await host.hello()
        await host.status()
        for _ in range(count):
            await host.send(Kind.STATUS)
        await host.reset(count)
        await host.hello()


async def sessions(host: Host) -> None:
    """Start sessions and resets while the board sends, receives and runs."""
    busy = (Kind.RUN, LONGEST_RUN.to_bytes(4, "little")) if host.config.chip else (Kind.STATUS,)
    for pause in (1, 3, 11, 25, 60, 130, 260):
        await host.hello(wait=False)
        await host.bits(pause)
        await host.hello()
        await host.send(Kind.STATUS)
        await host.bits(pause)
        await host.hello(number=pause % 256)
        await host.send(*busy)
        await host.hello(wait=False)
        await host.bits(QUIET_BITS)
        await host.send(*busy)
        await host.put(Frame(Kind.STATUS, host.sequence, b"").encode()[: 3 + pause % 5])
        await host.reset(2 + pause)
        await host.hello()
        await host.status()


# -- a player ----------------------------------------------------------------------------------------


async def player(host: Host, job: dict[str, Any]) -> None:
    """Load weights, play samples at several rates, and save the responses for comparison with the model."""
    chip = host.config.chip
    assert chip is not None
    scans = dict(np.load(job["scans"]))
    payloads = [bytes(line) for line in json.loads(Path(job["weights"]).read_text())]
    await host.hello()
    for payload in payloads:
        await host.carry_out(Kind.WEIGHTS, payload)
    size = host.hello_words.values["word_bytes"]
    for payload in (b"", b"abc", payloads[-1][:3] + bytes(size - 1), payloads[-1][:3] + bytes(size + 1)):
        await host.unknown(Kind.WEIGHTS, payload)
    await host.unknown(Kind.SAMPLES)
    await host.unknown(Kind.SAMPLES, b"abc")
    for length in (0, 3, 5):
        await host.unknown(Kind.RUN, bytes(length))
    for payload in payloads:  # again, because a rejected frame may have written something
        await host.carry_out(Kind.WEIGHTS, payload)
    for payload in (b"", b"1", bytes([0, 0]), bytes([9, 0]), bytes([1, 0, 0, 0])):
        await host.carry_out(Kind.RESTART)
        await host.unknown(Kind.CHANGES, payload)
    for number, (name, samples) in enumerate(scans.items()):
        clocks = len(samples) * chip.readout.clocks_per_sample + sum(RUN_CLOCKS)
        await _play(host, chip, samples, number)
        await _leave(host, f"{name}.json", clocks)
        await _play_changes(host, chip, samples)
        await _leave(host, f"{name}-short.json", clocks)
    await _no_room(host)


async def _play(host: Host, chip: ChipConfig, samples: np.ndarray, number: int) -> None:
    """Play samples after a reset, with few or many taxels per frame."""
    await host.carry_out(Kind.RESTART)
    codes = samples.astype("<i2").ravel()
    at, acks = 0, list[Record]()
    while at < len(codes):
        count = host.rng.choice([1, 2, chip.readout.taxels, 3 * chip.readout.taxels, MAX_SAMPLES // 2])
        acks.append(await host.send(Kind.SAMPLES, codes[at : at + count].tobytes()))
        at += count
        await host.bits(600 if number % 2 else 12 * min(count, 60))  # or the memory for frames would be full
        if number % 2 or host.rng.random() < 0.3:
            await host.expect(*acks)
            acks = []
    await _run(host, acks)


async def _run(host: Host, acks: list[Record]) -> None:
    """Run the clocks after the last sample, and check that all frames are acknowledged."""
    for clocks in RUN_CLOCKS:
        acks.append(await host.send(Kind.RUN, clocks.to_bytes(4, "little")))
    await host.expect(*acks)


async def _play_changes(host: Host, chip: ChipConfig, samples: np.ndarray) -> None:
    """Play samples as changes from tick to tick, in frames of up to 20 ticks."""
    await host.carry_out(Kind.RESTART, b"\x01")
    coder, at = ChangeCoder(chip.readout), 0
    while at < len(samples):
        count = host.rng.choice([1, 2, 20])
        for part in coder.feed(samples[at : at + count]):
            await host.carry_out(part.kind, part.payload)
        at += count
    await _run(host, [])


async def _leave(host: Host, name: str, clocks: int) -> None:
    """Check the counters, and save the responses for comparison with the model."""
    await host.status(time_low=clocks, time_high=0)
    events = [[one.time, one.address] for one in host.data if isinstance(one, Event)]
    classes = [[c.time, c.winner, c.overrun, list(c.evidence), c.sure] for c in host.data if isinstance(c, Class)]
    Path(name).write_text(json.dumps({"events": events, "classes": classes}))


async def _no_room(host: Host) -> None:
    """Fill the input memory during a long run, and check which frames are rejected."""
    await host.hello()
    run = await host.send(Kind.RUN, (70_000).to_bytes(4, "little"))
    status = await host.send(Kind.STATUS)
    kept = (await host.send(0x55, bytes(MAX_PAYLOAD))).sequence
    due = host.sequence
    await host.put(Frame(0x55, due, bytes(MAX_PAYLOAD)).encode())
    await host.put(Frame(Kind.STATUS, due + 1, b"").encode())  # follows from it
    host.refused += 3
    while not any(isinstance(one, Refused) and one.sequence == kept for one in host.said):
        await host.quiet()
    words = [one for one in host.said if isinstance(one, Words)]
    wanted = [Refused(due, due, 3), Refused(due + 1, due, 2), run, *words, status, Refused(kept, kept, 4)]
    if len(words) != 1 or host.said != wanted:
        raise Mismatch(f"without room the board says {host.said}; it must say {wanted}")
    host.said.clear()
    await host.status()


# -- a receiver --------------------------------------------------------------------------------------


async def foreign(host: Host) -> None:
    """Send events of another chip at all rates, across a full memory, a session and a reset."""
    rng, most = host.rng, (1 << ADDRESS_BITS) - 1
    await host.hello()
    await host.carry_out(Kind.RESTART)
    slow = [(rng.randrange(200, 4000), rng.choice([0, most, rng.randrange(most)])) for _ in range(60)]
    bursts = {
        "slow": [*slow, (70_000, 5), (300, most)],
        "quick": [(rng.randrange(1, 30), rng.randrange(most)) for _ in range(100)],
        "too many": [(1, rng.randrange(most)) for _ in range(700)],
        "after them": [(1, rng.randrange(most)) for _ in range(40)],
    }
    for name, events in bursts.items():
        await _sent(host, events, lossless=name != "too many")
    if sum(map(len, bursts.values())) != host.counted["events"] + host.counted["lost"]:
        raise Mismatch(f"of {sum(map(len, bursts.values()))} events the board tells of {host.counted}")
    await host.status()
    for pause in (1, 2, 3, 4, 5, 6, 300):  # REQ is high over a session, and over a reset
        await host.hello()
        host.dut.aer_addr.value = pause
        await Timer(1, "ns")
        host.dut.aer_req.value = 1
        await Timer(pause * CLOCK_NS, "ns")
        if pause % 2:
            await host.reset(3)
        await host.hello()
        host.dut.aer_req.value = 0
        await host.quiet()
        addresses = [one.address for one in host.data if isinstance(one, Event)]
        if addresses != [pause] * len(addresses) or len(addresses) > 1:
            raise Mismatch(f"a REQ that is high becomes {addresses}")
        await host.status()


async def _sent(host: Host, events: list[tuple[int, int]], lossless: bool) -> None:
    """Send events as (clocks to wait, address), and compare the records with them."""
    host.data = []
    dut, times = host.dut, []
    for wait, address in events:
        await Timer(wait * CLOCK_NS * 1000 + host.rng.randrange(20_000), "ps")
        off = address & OFF_FLAG and not address & BOTH_FLAG and host.rng.random() < 0.5
        request = dut.aer_req_off if off else dut.aer_req
        dut.aer_addr.value = address & ~OFF_FLAG if off else address
        await Timer(1, "ns")
        request.value = 1
        times.append(int(get_sim_time("ps")) / (1000 * CLOCK_NS))
        for value in (1, 0):
            while int(dut.aer_ack.value) != value:
                await Timer(3_700, "ps")
            request.value = 0
    await host.quiet()
    found = [one for one in host.data if isinstance(one, Event)]
    if not 0 < len(found) <= len(events) or (lossless and len(found) != len(events)):
        raise Mismatch(f"of {len(events)} events {len(found)} came")
    wanted = iter(zip(times, (address for _, address in events), strict=True))
    # In their order; those between them were lost.
    late = [next((one.time - time for time, address in wanted if address == one.address), None) for one in found]
    if None in late or (lossless and max(late) - min(late) > 2):  # type: ignore[type-var, operator]
        raise Mismatch(f"events came as {found}")
