"""Play a moving random texture on a chip with random weights, and compare it with the models."""

import random
from pathlib import Path
from typing import Any

import numpy as np

from eskin.cocotb_tests.bench.textures import random_scan
from eskin.cocotb_tests.blocks.classifier import random_network
from eskin.cocotb_tests.runner.process import play_runs
from eskin.cocotb_tests.runner.simulator import Simulator, build
from eskin.cocotb_tests.touch.plan import Part, result_of
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights


def play(
    chip: ChipConfig, program: Simulator, folder: Path, network: IntegerWeights | None = None, text: str = ""
) -> dict[str, Any]:
    """Play a texture that moves and stops on a chip in its harness, and return the result.

    The chip plays the texture twice: every clock, and only the clocks in which it is awake. ``text`` is Verilog to
    simulate instead of the chip's own.
    """
    if network is None:
        names = tuple(f"class {n}" for n in range(chip.classifier.classes))
        network = IntegerWeights(random_network(chip.classifier, random.Random(5)), names)
    network.save(folder / "network.npz")
    samples = random_scan(chip.readout, 60, np.random.default_rng(2))
    samples = np.concatenate([samples, np.repeat(samples[-1:], 30, axis=0)])
    runs = dict.fromkeys(("noise", "skipped"), samples)
    part = Part(folder / "network.npz", runs, {name: {} for name in runs}, ["skipped"], "again")
    play_runs(build(chip, program, text=text), part.runs(chip, folder), folder)
    return result_of(folder / "noise.npz")
