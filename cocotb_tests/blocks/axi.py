"""Compare a readout behind AXI with the golden models, with cocotbext-axi as manager and as sink."""

import itertools
import json
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from eskin.cocotb_tests.bench.block import JOB, Simulator, Sink, job
from eskin.cocotb_tests.bench.host import walk, words_for
from eskin.cocotb_tests.blocks.host import inputs_of, whatever
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.bus.axi_lite import ACCESS_CLOCKS, BUS_ADDRESS_BITS
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.words import packed
from eskin.model.registers.description import registers

PERIOD = 24
"""Clocks of a sample tick."""
WATCHED = ("event_ready", "tready", "tvalid", "tdata", "tlast", "sck", "cs_n", "mosi", "miso")
"""Signals that a run records in every clock."""

Access = dict[str, Any]
"""An access of the host: register address, word, response, and the clocks of its beginning and end."""


# -- in the simulator --------------------------------------------------------------------------------


def pauses(name: str, rng: random.Random) -> Iterator[bool]:
    """Yield whether a side of a handshake pauses, clock by clock, without end."""
    sink = Sink(name, rng)
    while True:
        yield not sink.ready()


def protection(rng: random.Random) -> Any:
    """Return a value of ``AWPROT`` or ``ARPROT``, which has no effect."""
    from cocotbext.axi import AxiProt

    return AxiProt(rng.randrange(8))


class Host:
    """A processor that reads and writes registers over cocotbext-axi."""

    def __init__(self, dut: Any, config: BusConfig, rng: random.Random, clocks: int) -> None:
        from cocotbext.axi import AxiLiteBus, AxiLiteMaster

        self.config, self.rng, self.clock, self.clocks = config.readout, rng, 0, clocks
        bus = AxiLiteBus.from_prefix(dut, "s_axi")
        self.master = AxiLiteMaster(bus, dut.aclk, dut.aresetn, reset_active_level=False)
        write, read = self.master.write_if, self.master.read_if
        for channel in (write.aw_channel, write.w_channel, write.b_channel, read.ar_channel, read.r_channel):
            channel.set_pause_generator(pauses("random", rng))
        write.log.setLevel("WARNING")
        read.log.setLevel("WARNING")
        self.done: list[Access] = []

    async def write(self, address: int, word: int, bytes_written: int = 4) -> None:
        """Write the lowest bytes of a word, or 3 bytes from the second on."""
        begin, first = self.clock, bytes_written == 3
        said = await self.master.write(
            address + first, word.to_bytes(4, "little")[:bytes_written], prot=protection(self.rng)
        )
        self._note("write", address, word, begin, response=int(said.resp), whole=bytes_written == 4)

    async def read(self, address: int) -> None:
        """Read a word."""
        begin = self.clock
        said = await self.master.read(address, 4, prot=protection(self.rng))
        self._note("read", address, int.from_bytes(said.data, "little"), begin, response=int(said.resp))

    def _note(self, kind: str, address: int, word: int, begin: int, **more: Any) -> None:
        self.done.append({"kind": kind, "address": address, "word": word, "begin": begin, "end": self.clock, **more})

    async def work(self) -> None:
        """Write and read registers until the end of the run."""
        found = registers(self.config)
        writable = [register for register in found if register.writable and register.name not in ("control", "test")]
        (events,) = (register.address for register in found if register.name == "events")
        holes = [address for address in range(0, 1 << BUS_ADDRESS_BITS, 4) if address not in {r.address for r in found}]
        await self.read(found[0].address)  # in the first clock after the reset
        for register in itertools.cycle(writable):
            if self.clock > self.clocks - 7 * ACCESS_CLOCKS:
                break
            await self.write(register.address, self.rng.choice(words_for(register, self.rng, 0)))
            await self.read(register.address)
            refused = cocotb.start_soon(self.write(register.address, 0, self.rng.choice([1, 2, 3])))
            await self.read(events)
            await refused
            await self.write(self.rng.choice([register.address, self.rng.choice(holes)]), self.rng.getrandbits(32))
            await self.read(self.rng.choice([register.address, register.address, self.rng.choice(holes)]))


@cocotb.test()
async def record(dut: Any) -> None:
    """Play a prepared run, and write what was seen at the pins in every clock, at the sink and by the host."""
    from cocotbext.axi import AxiStreamBus, AxiStreamSink

    config, rng = job(BusConfig.from_dict)
    with np.load("played.npz") as stored:
        played = {name: stored[name].tolist() for name in stored.files}
    sample = getattr(dut, "sample", None)
    dut.aclk.value = 0
    bus = AxiStreamBus.from_prefix(dut, "m_axis")
    sink = AxiStreamSink(bus, dut.aclk, dut.aresetn, reset_active_level=False, byte_lanes=1)
    sink.log.setLevel("WARNING")  # messages take most of the time
    sink.set_pause_generator(pauses(played["sink"], rng))
    clocks = len(played["enable"])
    host = Host(dut, config, rng, clocks) if config.readout.registers != "none" else None
    names = {name: f"m_axis_{name}" if name.startswith("t") else f"lite_spi_{name}" for name in WATCHED[1:]}
    pins = {name: getattr(dut, name, None) for name in ({"event_ready": "readout_event_ready"} | names).values()}
    dut.aresetn.value = 0
    for pin in (sample, dut.sample_valid):
        if pin is not None:
            pin.value = 0
    Clock(dut.aclk, 10, "ns").start(start_high=False)
    for _ in range(3):
        await FallingEdge(dut.aclk)
    dut.aresetn.value = 1
    working = cocotb.start_soon(host.work()) if host else None
    samples = dict(zip(played["sample_clock"], played["samples"], strict=True))
    seen = []
    for clock in range(clocks):
        dut.taxel_enable.value = int(played["enable"][clock], 2)
        dut.sample_valid.value = int(clock in samples)
        if sample is not None and clock in samples:
            sample.value = packed(samples[clock], config.readout.sample_bits)
        for side, name in enumerate(("above", "below")):
            if "decisions" in played and (pin := getattr(dut, name, None)) is not None:
                pin.value = int(played["decisions"][side][clock], 2)
        seen.append([0 if pin is None else int(pin.value) for pin in pins.values()])
        if host:
            host.clock = clock
        await FallingEdge(dut.aclk)
    assert working is None or working.done()
    dut.aresetn.value = 0
    await FallingEdge(dut.aclk)
    frames = []
    while not sink.empty():
        frames.append([int(word) for word in sink.recv_nowait(compact=False).tdata])
    found = {"seen": seen, "frames": frames, "host": host.done if host else []}
    Path("seen.json").write_text(json.dumps(found))


# -- outside -----------------------------------------------------------------------------------------


def prepare(config: BusConfig, folder: Path, seed: int, sink: str, clocks: int) -> Any:
    """Write the inputs of a run into a folder; return them as a stimulus with a sink that is always ready."""
    from eskin.model.readout import Stimulus

    readout, draw = config.readout, np.random.default_rng(seed)
    ticks = clocks // PERIOD
    samples = walk(readout, ticks, draw)
    samples[-ticks // 8 :] = samples[-ticks // 8]  # the last events leave
    changes = np.sort(draw.choice(np.arange(1, clocks), 6, replace=False))
    analog = whatever(readout, clocks, draw) if readout.frontend == "analog" else None
    if analog is not None:
        analog[-clocks // 8 :] = 0
    stimulus = Stimulus(
        samples=samples,
        sample_clock=np.arange(ticks, dtype=np.int64) * PERIOD + 3,
        clocks=clocks,
        enable_clock=np.array([0, *changes], np.int64),
        enable=draw.random((len(changes) + 1, readout.taxels)) < 0.9,
        decisions=analog,
    )
    np.savez(folder / "played.npz", sink=np.array(sink), **inputs_of(stimulus))
    return stimulus


def compare(config: BusConfig, stimulus: Any, found: dict[str, Any]) -> Counter[str]:
    """Compare a recorded run with the golden models of readout, stream and registers; return counts of what happened.

    The model of the readout gets the recorded ``event_ready`` and SPI pins. The model of the stream gets its events,
    and must give the recorded ``event_ready`` and all levels of the stream.
    """
    import dataclasses

    from eskin.model.bus.axi_stream import AxiStream, Event
    from eskin.model.host import play
    from eskin.model.readout import simulate
    from eskin.model.registers.spi import Pins

    seen = {name: np.array(column) for name, column in zip(WATCHED, zip(*found["seen"], strict=True), strict=True)}
    stimulus = dataclasses.replace(stimulus, ready=seen["event_ready"].astype(np.uint8))
    if config.readout.registers == "none":
        events = simulate(config.readout, stimulus)
    else:
        pins = [Pins(*map(int, levels)) for levels in zip(*(seen[n] for n in ("sck", "cs_n", "mosi")), strict=True)]
        played = play(config.readout, stimulus, pins)
        events = played.events
        assert (played.miso == seen["miso"]).all()
    polarity = events["p"] * config.readout.has_polarity
    columns = (events["x"].tolist(), events["y"].tolist(), polarity.tolist())
    taken = {t: Event(*event) for t, *event in zip(events["t"].tolist(), *columns, strict=True)}
    stream, frames, counts = AxiStream(config), [[]], Counter(events=len(taken))  # type: ignore[var-annotated]
    for clock in range(stimulus.clocks):
        tready, offered = bool(seen["tready"][clock]), stream.offered
        at = f"clock {clock}: {stream.held}, {offered}"
        assert stream.ready(tready) == seen["event_ready"][clock], at
        assert (offered is not None) == seen["tvalid"][clock], at
        if offered is not None:
            assert (offered.data, offered.last) == (seen["tdata"][clock], seen["tlast"][clock]), at
            counts["stalls"] += not tready
            if tready:
                frames[-1].append(offered.data)
                if offered.last:
                    frames.append([])
        # While the stream is not ready, the next event cannot move it.
        stream.clock(taken.get(clock), tready)
    assert frames[:-1] == found["frames"]
    counts["sent"], counts["frames"] = sum(map(len, frames)), len(found["frames"])
    counts["longest"] = max(map(len, frames))
    return counts + _accesses(config, events, found["host"])


def _accesses(config: BusConfig, events: Any, done: list[Access]) -> Counter[str]:
    """Compare the accesses of the host with the model of the register file."""
    from eskin.model.bus.axi_lite import OKAY, SLVERR
    from eskin.model.registers.file import RegisterFile, Write

    counts: Counter[str] = Counter()
    if not done:
        return counts
    file = RegisterFile(config.readout)
    names = {address: register.name for address, register in file.at.items()}
    for access in done:
        address, word = access["address"], access["word"]
        assert not access.get("whole", True) or access["end"] - access["begin"] >= ACCESS_CLOCKS, access
        if access["kind"] == "write":
            assert access["response"] == (OKAY if access["whole"] else SLVERR), access
            if access["whole"]:
                before = file.read(address)
                file.clock(Write(address, word))
                counts["changed"] += file.read(address) != before
            counts["refused"] += not access["whole"]
        else:
            assert access["response"] == OKAY, access
            if names.get(address) == "events":
                least, most = (int((events["t"] < access[name]).sum()) for name in ("begin", "end"))
                assert least <= word <= most, access
                counts["counted"] += word > 0
            else:
                assert word == file.read(address), access
                counts["read"] += 1
    return counts


def run(
    config: BusConfig, folder: Path, seed: int, sink: str, clocks: int, simulator: Simulator = "icarus"
) -> Counter[str]:
    """Play and compare a run; return the counts of what happened."""
    stimulus = prepare(config, folder, seed, sink, clocks)
    env = {JOB: json.dumps({"config": config.to_dict(), "seed": seed})}
    build(config, simulator, top="eskin_axi").test(__name__, folder, "record", env)
    return compare(config, stimulus, json.loads((folder / "seen.json").read_text()))
