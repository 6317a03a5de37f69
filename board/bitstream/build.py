"""Run synthesis, place and route, and bitstream generation with open tools."""

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.packages import missing
from eskin.board.bitstream.boards import ECP5, Family, find_board
from eskin.board.bitstream.on_board import OnBoard
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.sensor import SensorConfig
from eskin.board.session import board_of
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.rtl import yosys
from eskin.rtl.verilog import top_block, verilog

NAME = "eskin_board"
SEED = 1  # seed of place and route; an equal seed gives equal bytes

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
    family: Family = ECP5

    @property
    def luts(self) -> int:
        """Number of LUTs used, including carry chains and distributed memory."""
        return sum(self.used.get(kind, 0) for kind in self.family.lut)

    @property
    def blocks(self) -> int:
        """Number of block RAMs used."""
        return self.used.get(self.family.block, 0)

    @property
    def memory_kilobytes(self) -> float:
        """Capacity in kilobytes of the block RAMs used."""
        return self.blocks * self.family.block_kilobytes


def design_of(
    weights: Path | None,
    receiver: bool,
    board: str = "ulx3s",
    baud: int = SerialConfig.baud,
    sensor: SensorConfig | None = None,
) -> BoardConfig:
    """Return the design to build: the AER receiver, or readout and classifier with the weights of a network."""
    serial = SerialConfig(clock_hz=find_board(board).clock_hz, baud=baud)
    if receiver:
        return BoardConfig(chip=None, serial=serial)
    return replace(board_of(IntegerWeights.load(weights or NETWORK)), serial=serial, sensor=sensor)


def build(config: BoardConfig, board: str) -> Built:
    """Build the bitstream of a design for a board; return bitstream and resources.

    Raises InputError if the board is unknown, or the design does not fit.
    """
    chosen = find_board(board)
    platform, family = chosen.open(), chosen.family
    plan = platform.prepare(OnBoard(config, chosen), NAME, synth_opts=list(family.synthesis))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan.extract(str(folder))
        files = {name: text.encode() if isinstance(text, str) else text for name, text in plan.files.items()}
        netlist = family.netlist.format(name=NAME)
        (folder / f"{NAME}.json").write_text(_synthesise(f"script {NAME}.ys", files, netlist))
        place_and_route(folder, family, [*family.device(platform), *family.route.format(name=NAME).split()])
        _run(family.packer, family.pack.format(name=NAME).split(), folder)
        bitstream = NAME + family.bitstream
        return read_report(folder, {bitstream: (folder / bitstream).read_bytes()}, family, chosen.clock_hz)


def build_classifier(config: ClassifierConfig) -> Built:
    """Return the resources of the classifier alone in an ECP5-25, speed grade 6."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        top = top_block(config).module_name
        script = f"read_verilog {NAME}.v; synth_ecp5 -nodsp {' '.join(ECP5.synthesis)} -top {top} -json {NAME}.json"
        (folder / f"{NAME}.json").write_text(_synthesise(script, {f"{NAME}.v": verilog(config).encode()}))
        device = ["--25k", "--package", "CABGA381", "--speed", "6", "--freq", "50", "--out-of-context"]
        place_and_route(folder, ECP5, device)
        return read_report(folder, {}, ECP5)


def _synthesise(script: str, files: dict[str, bytes], netlist: str = f"{NAME}.json") -> str:
    """Return the netlist that a Yosys script writes."""
    try:
        return yosys.run(script, "", netlist, files)
    except yosys.YosysError as error:
        raise BuildFailed(f"yosys failed: {error.reason}") from None


def place_and_route(folder: Path, family: Family, options: list[str]) -> None:
    """Run nextpnr on the netlist in a folder."""
    words = ["--quiet", "--seed", str(SEED), "--timing-allow-fail", "--report", "report.json", "--log", "route.log"]
    _run(family.nextpnr, [*words, "--json", f"{NAME}.json", *options], folder)


def read_report(folder: Path, files: dict[str, bytes], family: Family, aim_hz: float = 50e6) -> Built:
    """Return the results that nextpnr reported in a folder."""
    said: dict[str, Any] = json.loads((folder / "report.json").read_text())
    clocks = [clock for clock in said["fmax"].values() if clock["constraint"] >= aim_hz / 1e6 - 1e-3]
    slowest = min(clocks, key=lambda clock: clock["achieved"])
    cells = {name: one for name, one in said["utilization"].items() if one["used"]}
    used, available = ({name: one[key] for name, one in cells.items()} for key in ("used", "available"))
    return Built(used, available, 1e6 * slowest["achieved"], aim_hz, files, family)


def _run(program: str, words: list[str], folder: Path) -> None:
    """Run a program of a Python package, MODULE.FUNCTION, in a folder.

    Raises InputError if its package is not installed or the design does not fit the FPGA, and else BuildFailed.
    """
    module, _, function = program.rpartition(".")
    command = [sys.executable, "-c", f"import {module}; {module}.{function}()", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return
    said = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
    if "ModuleNotFoundError" in said[-1]:
        raise InputError(missing(module.partition(".")[0]))
    errors = [line for line in said if line.startswith("ERROR")] or said[-1:]
    if any(words in line for line in errors for words in ("Unable to find", "Unable to place", "placed")):
        raise InputError(
            f"the design does not fit this board: {errors[0].removeprefix('ERROR: ')}; choose a larger board"
        )
    raise BuildFailed(f"{module} failed: {errors[0]}")
