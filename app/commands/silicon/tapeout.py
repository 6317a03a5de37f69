"""The command tapeout (docs/guide/tapeout.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from eskin.app.options import opt, out_folder, with_config
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig


@with_config
def tapeout(
    config: ReadoutConfig,
    given: frozenset[str],
    shuttle: Annotated[str, opt("tt-ihp, tt-sky (Tiny Tapeout) or wafer-gf180 (wafer.space)")],
    author: Annotated[str, opt("NAME", "name for the shuttle's files")],
    lib: Annotated[Path | None, opt("TYP.lib", "cell library of the shuttle's process, to find the size")] = None,
    size: Annotated[str | None, opt("WxH", "tiles or slot [smallest that the cells of --lib fit into]")] = None,
    top: Annotated[str, opt("tt_um_NAME", "name of the top module")] = "tt_um_eskin_readout",
    title: Annotated[str, opt("TEXT", "title of the project")] = "Spiking e-skin readout",
    out: Annotated[Path, out_folder("folder of the project")] = Path("out/tapeout"),
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
    filled = "" if cells is None else f", {cells.area_um2:,.0f} um2 of cells fill {cells.area_um2 / width / height:.0%}"
    print(
        f"{shuttle}: {readout.rows} x {readout.columns} taxels in {chip.size} ({width:g} x {height:g} um){filled} "
        f"(at most {DENSITY:.0%}), clock {readout.clock_hz / 1e6:g} MHz; test: make -C {out}/test"
    )
