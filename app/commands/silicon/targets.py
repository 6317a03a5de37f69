"""The commands layout, fpga and tapeout (docs/results/layout.md, docs/guide/board.md, docs/guide/tapeout.md)."""

import functools
import sys
from pathlib import Path
from shutil import which
from typing import cast

from eskin.app.commands import common
from eskin.app.options import LOGIC, command, opt, out_folder, with_config
from eskin.base.errors import InputError
from eskin.base.files import origin
from eskin.base.workers.engine import open_pool
from eskin.board.bitstream.boards import BOARDS
from eskin.board.sensor import PartName, SensorConfig
from eskin.model.config import ReadoutConfig


@command("Hardware", needs="asic", variables="ROWS=2 COLUMNS=2")
@with_config(fields=LOGIC)
def layout(
    config: ReadoutConfig,
    name: str = opt("", "name of the run and its folder [from the configuration]"),
    compare: bool = opt(True, "also compare the netlist of the layout with the synthesised one"),
    workers: int = opt(1, "N", "amounts of free area that are tried at the same time", min=1),
    out: Path = out_folder(Path("out/layout"), "parent folder of the run"),
) -> None:
    """Place and route a readout for SkyWater 130 nm and check the layout; exit code 1 if a check fails.

    OUT/NAME gets GDS, DEF, a picture and report.json. Needs KLayout and the packages that make layout installs.
    """
    from eskin.flow.layout import report, run
    from eskin.flow.layout.environment import Crashed

    common.check_name(name)
    with common.failing_on(Crashed), open_pool(workers, None) as pool:
        found = run.run(config, name, out, compare, pool, functools.partial(print, flush=True))
    print(report.write(found, out, report.command_of(config, compare)))
    common.conclude(found.problems, found.closing_line())


@command(
    "Hardware",
    needs="fpga",
    idle={
        "--alone": "--board --baud --adc --settle",
        "no --alone": "--own --stack --early",
        "--receiver": "--adc",
        "no --adc": "--settle",
    },
)
def fpga(
    board: str = opt("ulx3s", "|".join(BOARDS), "board; ulx3s has 85 k LUTs"),
    weights: Path | None = opt(None, "integer network of the chip [network of the embedded textures, fold 0]"),
    receiver: bool = opt(False, "--receiver", "build the receiver of another chip's AER"),
    alone: int | None = opt(
        None, "BITS", "build only the classifier 128-256-6 with weights of BITS, on an ECP5-25", min=2, max=8
    ),
    own: bool = opt(False, "--own", "with --alone: each neuron has a threshold and a leak of its own"),
    stack: bool = opt(False, "--stack", "with --alone: the neurons are two recurrent layers of 128"),
    early: bool = opt(False, "--early", "with --alone: with an early decision"),
    adc: str | None = opt(None, "PART", "read a skin at the board: mcp3008, mcp3208 or ads7953"),
    settle: float = opt(5e-6, "SECONDS", "from a row's drive to its first column"),
    baud: int = opt(2_000_000, "bits per second of the serial line"),
    out: Path = out_folder(Path("out/fpga"), "parent folder for the files of the board"),
) -> None:
    """Build the bitstream for a board, and report resources and clock; exit code 1 below the clock of the board.

    OUT/BOARD gets the bitstream, eskin_board.*, and report.json. The same design gives the same bytes.
    """
    from eskin.board.bitstream import report
    from eskin.board.bitstream.build import build, build_classifier, design_of
    from eskin.board.config import SerialConfig

    if sum((receiver, weights is not None, alone is not None)) > 1:
        raise InputError("--weights, --receiver and --alone each choose a design; give one of them")
    if alone is not None:
        classifier = report.plain_classifier(alone, own, stack, early)
        name, built = (
            f"classifier-{alone}b{'-own' * own}{'-stack' * stack}{'-early' * early}",
            build_classifier(classifier),
        )
        said = {"design": "classifier"} | origin(
            common.make_line("fpga", ALONE=alone, OWN=own, STACK=stack, EARLY=early)
        )
        aims = report.classifier_aims(built, classifier)
    else:
        sensor = SensorConfig(part=cast(PartName, adc), settle_s=settle) if adc else None
        config = design_of(weights, receiver, board, baud, sensor)
        name, built = board, build(config, board)
        chosen = {"BOARD": board, "WEIGHTS": weights and weights.name, "RECEIVER": receiver}
        line = {"BAUD": baud != SerialConfig.baud and baud, "ADC": adc, "SETTLE": adc and f"{settle:g}"}
        said = {"design": config.design, "identity": f"{config.identity:08x}"}
        said |= origin(common.make_line("fpga", **chosen, **line))
        aims = [report.clock_aim(built)]
    print(report.write(out, name, built, said, aims))
    for aim in aims:
        print(aim)
    common.conclude((), report.closing_line(name, built), failed=not aims[0].met)


@command("Hardware")
@with_config
def tapeout(
    config: ReadoutConfig,
    given: frozenset[str],
    shuttle: str = opt(..., "tt-ihp, tt-sky (Tiny Tapeout) or wafer-gf180 (wafer.space)"),
    author: str = opt(..., "NAME", "name for the shuttle's files"),
    lib: Path | None = opt(None, "TYP.lib", "cell library of the shuttle's process, to find the size"),
    size: str | None = opt(None, "WxH", "tiles or slot [smallest that the cells of --lib fit into]"),
    top: str = opt("tt_um_eskin_readout", "tt_um_NAME", "name of the top module"),
    title: str = opt("Spiking e-skin readout", "TEXT", "title of the project"),
    out: Path = out_folder(Path("out/tapeout"), "folder of the project"),
) -> None:
    """Write the project folder of a readout for a shuttle: sources, pins, test, documentation, flow settings.

    The readout gets SPI registers, a loader of samples and a four-phase link. With --lib its netlist lies beside the
    test, for make GATES=yes.
    """
    from eskin.flow.liberty.library import read
    from eskin.flow.tapeout.folder import plan
    from eskin.flow.tapeout.pins import readout_for
    from eskin.flow.tapeout.shuttles import DENSITY, SHUTTLES

    if shuttle not in SHUTTLES:
        raise InputError(f"--shuttle must be one of {', '.join(SHUTTLES)}, not {shuttle!r}")
    kind = SHUTTLES[shuttle]
    readout = readout_for(config, given, kind)
    library = None if lib is None else read(lib)
    chip, cells = plan(readout, kind, library, size, top, author, title)
    for path in chip.write(out, cells):
        print(path)
    width, height = kind.sizes[chip.size]
    test = f"make -C {out}/test"
    if which("cocotb-config") is None:
        test = f'PATH="{Path(sys.executable).parent}:$PATH" {test}'
    filled = ", unchecked whether the cells fit: add --lib TYP.lib"
    if cells is not None:
        filled = f", {cells.area_um2:,.0f} um2 of cells fill {cells.area_um2 / width / height:.0%}"
    print(
        f"{shuttle}: {readout.rows} x {readout.columns} taxels in {chip.size} ({width:g} x {height:g} um){filled} "
        f"(at most {DENSITY:.0%}), clock {readout.clock_hz / 1e6:g} MHz; test: {test}"
    )
