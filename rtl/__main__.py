"""``python -m rtl``: Verilog of the readout for a CMOS flow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from model.cli import make_app, run, with_config
from model.config import ReadoutConfig
from model.errors import InputError

app = make_app("RTL of the spiking e-skin readout, and of the frame-based one.")

READOUTS = ("spiking", "frame")


@app.command()
@with_config
def verilog(
    config: ReadoutConfig,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder to write to, made if need be")],
    readout: Annotated[str, typer.Option(metavar="|".join(READOUTS), help="which readout")] = "spiking",
    word_bits: Annotated[int | None, typer.Option(metavar="N", help="frame: bits of an output word [16]")] = None,
    settle_clocks: Annotated[
        int | None, typer.Option(metavar="N", help="frame: clocks for the multiplexer to settle [1]")
    ] = None,
    conversion_clocks: Annotated[
        int | None, typer.Option(metavar="N", help="frame: clocks of a conversion, for the clock rate [resolution + 1]")
    ] = None,
) -> None:
    """Write eskin_readout.v or eskin_frame_readout.v, .sdc, .json (configuration and ports) and .core (FuseSoC)."""
    from model.frame_config import FrameConfig
    from rtl.verilog import Config, write

    if readout not in READOUTS:
        raise InputError(f"--readout must be one of {', '.join(READOUTS)}, not {readout!r}")
    asked = {"word_bits": word_bits, "settle_clocks": settle_clocks, "conversion_clocks": conversion_clocks}
    own = {name: value for name, value in asked.items() if value is not None}
    if own and readout != "frame":
        raise InputError(f"--{next(iter(own)).replace('_', '-')} belongs to the frame readout; add --readout frame")
    chosen: Config = FrameConfig(readout=config, **own) if readout == "frame" else config
    for path in write(chosen, out):
        print(path)


def main() -> None:
    """Run the command line of the RTL."""
    run(app, "python -m rtl")


if __name__ == "__main__":
    main()
