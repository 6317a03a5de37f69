"""Measure how many ticks per second the board's player takes from the real host program, in co-simulation.

``eskin play`` sends samples to the simulated gateware over a serial line, bit by bit. The network is the embedded one,
with a readout of 6 bits. The time runs from the reset of the chip (``RESTART``) to the last sample or event on the
line, whichever is later, in the time of the simulation. The host program compares all events and classes with the
model.
"""

import copy
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
import typer
from cocotb.clock import Clock
from cocotb.triggers import Timer
from cocotb.utils import get_sim_time
from measure import JOB, MEASURED, RESULTS, JsonFile, in_simulator, write

from eskin.board.bitstream.build import NETWORK
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.gateware.top import TOP, verilog
from eskin.board.records import Event, RecordReader
from eskin.board.serial_frames import Frame, FrameReader, Kind
from eskin.board.session import chip_of
from eskin.cocotb_tests.bench import line as serial
from eskin.cocotb_tests.runner.simulator import Build, build
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig

BAUD, RESOLUTION = 3_000_000, 6
CASES: dict[str, tuple[int, list[str]]] = {
    "`brick-03`": (1500, ["--only", "brick/brick-03"]),
    "`grass-04`": (600, ["--only", "grass/grass-04"]),
    "`brick-03`, `--raw`": (100, ["--only", "brick/brick-03", "--raw"]),
    "worst case: all taxels jump over the full scale in every tick": (100, ["--samples", "jumps.npy"]),
    "all taxels step to and fro in every tick": (200, ["--samples", "steps.npy"]),
}
"""Number of ticks and options of ``eskin play``, for each case."""


@cocotb.test()
async def play(dut: Any) -> None:
    """Start the host program, and record each byte on both lines with its time in ps."""
    command = json.loads(os.environ[JOB])
    serial.MAX_SECONDS = 3600
    dut.rx.value, dut.rst.value = 1, 1
    Clock(dut.clk, serial.CLOCK_NS, "ns").start()
    await Timer(5 * serial.CLOCK_NS, "ns")
    dut.rst.value = 0
    sent: list[tuple[int, int]] = []
    returned: list[tuple[int, int]] = []

    def recorded(bytes_of: list[tuple[int, int]]) -> serial.Spoil:
        def record(_: int, byte: int) -> int:
            bytes_of.append((int(get_sim_time("ps")), byte))
            return byte

        return record

    wire = serial.Line(dut, BAUD, recorded(sent), recorded(returned))
    with subprocess.Popen([*command, "--port", wire.port], stdout=subprocess.PIPE, text=True) as host:
        await wire.run(host)
        said, _ = host.communicate()
    if host.returncode:
        raise AssertionError(f"the host program failed: {said}")
    MEASURED.write_text(json.dumps([sent, returned]))


def signals(readout: ReadoutConfig, folder: Path) -> None:
    """Write the samples of both artificial cases."""
    second = np.arange(max(ticks for ticks, _ in CASES.values()))[:, None] % 2
    ends = np.where(second, readout.full_scale - 1, -readout.full_scale)
    for name, codes in (("jumps", ends), ("steps", second * readout.step)):
        np.save(folder / f"{name}.npy", codes.repeat(readout.taxels, axis=1).astype(np.int16))


def frames(sent: list[tuple[int, int]]) -> Iterator[tuple[int, Frame]]:
    """Yield the frames of a line with the time of their last byte, in ps."""
    reader = FrameReader()
    for at, byte in sent:
        for frame in reader.feed(bytes([byte])):
            if not isinstance(frame, Frame):
                raise AssertionError(f"a frame arrived damaged: {frame}")
            yield at, frame


def measured(program: Build, chip: ChipConfig, name: str, folder: Path) -> dict[str, Any]:
    """Return ticks per second and bytes per tick of one case."""
    ticks, options = CASES[name]
    command = [sys.executable, "-m", "eskin", "play", str(folder / "network.npz"), "--baud", str(BAUD)]
    command += ["--limit", str(ticks), "--patience", "600", "--out", str(folder / "played.npz")]
    command += [str(folder / word) if word.endswith(".npy") else word for word in options]
    sent, returned = in_simulator(program, "player", "play", command)
    begun = last_sample = last_event = 0
    for at, frame in frames(sent):
        if frame.kind == Kind.RESTART:
            begun = at
        elif frame.kind in (Kind.CHANGES, Kind.SAMPLES):
            last_sample = at
    records = RecordReader(chip.classifier.classes, chip.classifier.inputs)
    for at, frame in frames(returned):
        if any(isinstance(record, Event) for record in records.feed(frame.payload)):
            last_event = at
    end = max(last_sample, last_event)
    return {
        "samples": name,
        "ticks": ticks,
        "ticks_per_second": ticks / (1e-12 * (end - begun)),
        "bytes_to_board": sum(begun < at <= last_sample for at, _ in sent) / ticks,
        "bytes_to_host": sum(begun < at <= end for at, _ in returned) / ticks,
    }


def main(out: JsonFile = RESULTS / "player.json") -> None:
    """Measure all cases, print ticks per second, and write JSON."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given = IntegerWeights.load(NETWORK)
        notes = copy.deepcopy(given.notes)
        notes["training"]["readout"]["resolution"] = RESOLUTION
        weights = IntegerWeights(given.network, given.class_names, notes)
        weights.save(folder / "network.npz")
        chip = chip_of(weights)
        text = verilog(BoardConfig(chip=chip, serial=SerialConfig(baud=BAUD)))
        program = build(chip, "verilator", top=TOP, text=text)
        signals(chip.readout, folder)
        results = []
        for case in CASES:
            results.append(measured(program, chip, case, folder))
            print(results[-1], flush=True)
    settings = {"baud": BAUD, "resolution": RESOLUTION, "taxels": chip.readout.taxels}
    write(out, "player", "", settings | {"results": results})


if __name__ == "__main__":
    typer.run(main)
