"""Simulate a board's Verilog with coverage counters, and compare its records with the models."""

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from amaranth.back import rtlil
from numpy.typing import NDArray

from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.gateware.top import TOP, Board
from eskin.board.records import classes_of, hello_values
from eskin.board.session import weight_frames
from eskin.cocotb_tests.bench.chip import network_of
from eskin.cocotb_tests.runner import simulator
from eskin.model.classifier.chip import channels_of, simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys
from eskin.rtl.verilog import YOSYS_SCRIPT
from eskin.verify.coverage.boards.host import JOB, RUN_CLOCKS
from eskin.verify.coverage.constructs import named
from eskin.verify.coverage.points.render import points


def text(config: BoardConfig) -> str:
    """Return the Verilog of a board, without initial values.

    That of ``eskin.board.gateware.top`` is for tools, and has a wire for every gate. Names that SystemVerilog keeps for
    itself become others.
    """
    script = YOSYS_SCRIPT.format(top=TOP)
    whole = yosys.tidy(yosys.run(script, rtlil.convert(Board(config), name=TOP, emit_src=False), "readout.v"))
    return re.sub(r"\b(time|byte|bit|sequence)\b", r"\1_", whole)


def small_board(design: str) -> BoardConfig:
    """Return a ``player`` or ``receiver`` board with a fast serial line and small memories."""
    serial = SerialConfig(baud=12_500_000, buffer_bytes=512, idle_bits=64, records=128)
    readout = ReadoutConfig(rows=2, columns=3, sample_bits=8, resolution=5, clocks_per_sample=64)
    fields = {"inputs": 12, "hidden": 6, "classes": 3, "lanes": 2, "bin_s": 0.0002}
    fields |= {"threshold": 60, "floor": -200, "out_threshold": 40, "out_floor": -200, "margin": 2}
    chip = ChipConfig(readout=readout, classifier=ClassifierConfig.from_dict(fields))
    return BoardConfig(chip=chip if design == "player" else None, serial=serial)


def board(config: BoardConfig, folder: Path) -> None:
    """Simulate all test scripts on a board, and compare events and classes with the models."""
    whole = named(text(config), points(config))
    shape = config.chip or small_board("player").chip
    assert shape is not None
    program = simulator.build(shape, "verilator", top=TOP, text=whole)
    job: dict[str, Any] = {"chip": None, "serial": asdict(config.serial), "seed": 5}
    scans: dict[str, NDArray[np.int16]] = {}
    if config.chip:
        network, scans = network_of(config.chip), scans_of(config.chip)
        paths = {"weights": folder / "weights.json", "scans": folder / "scans.npz"}
        images = weight_frames(IntegerWeights(network, ("a", "b", "c"), {}), hello_values(config)["word_bytes"])
        paths["weights"].write_text(json.dumps([list(one) for one in images]))
        np.savez(paths["scans"], **scans)  # type: ignore[arg-type]
        job |= {"chip": config.chip.to_dict(), **{name: str(path) for name, path in paths.items()}}
    (folder / "job.json").write_text(json.dumps(job))
    program.test("eskin.verify.coverage.boards.script", folder, None, {JOB: str(folder / "job.json")})
    for name, samples in scans.items():
        assert config.chip is not None
        for played in (name, f"{name}-short"):
            hold(config.chip, network, samples, json.loads((folder / f"{played}.json").read_text()), played)


def scans_of(chip: ChipConfig) -> dict[str, NDArray[np.int16]]:
    """Return test samples, shape (ticks, taxels): random walk, noise, square wave of all taxels, and rest."""
    rng, taxels, high = np.random.default_rng(2), chip.readout.taxels, chip.readout.full_scale
    walk = np.cumsum(rng.integers(-high // 8, high // 8 + 1, (60, taxels)), axis=0).clip(-high, high - 1)
    square = np.where(np.arange(40) // 4 % 2, high - 1, -high)[:, None].repeat(taxels, axis=1)
    scans = {"walk": walk, "noise": rng.integers(-high, high, (40, taxels)), "square": square, "rest": 0 * walk}
    return {name: scan.astype(np.int16) for name, scan in scans.items()}


def hold(
    chip: ChipConfig, network: IntegerNetwork, samples: NDArray[np.int16], left: dict[str, Any], name: str
) -> None:
    """Compare the records of a scan with the models of readout and classifier."""
    clocks = len(samples) * chip.readout.clocks_per_sample + sum(RUN_CLOCKS)
    model = simulate_chip(chip, network, samples, clocks)
    channels = channels_of(chip, model.events)
    events = [[int(t), int(channel)] for t, channel in zip(model.events["t"], channels, strict=True)]
    classes = [
        [one.time, one.winner, one.overrun, list(one.evidence), one.sure]
        for one in classes_of(model.classifier, clocks)
    ]
    for what, wanted in (("events", events), ("classes", classes)):
        if left[what] != wanted:
            raise AssertionError(f"{name}: {what} differ: model {wanted}, board {left[what]}")
