"""``python -m rtl``: Verilog of the readout for a CMOS flow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from model.cli import make_app, run, with_config
from model.config import ReadoutConfig

app = make_app("RTL of the spiking e-skin readout.")


@app.command()
@with_config
def verilog(
    config: ReadoutConfig,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder to write to, made if need be")],
) -> None:
    """Write eskin_readout.v, .sdc, .json (configuration and ports) and .core (FuseSoC)."""
    from rtl.verilog import write

    for path in write(config, out):
        print(path)


def main() -> None:
    """Run the command line of the RTL."""
    run(app, "python -m rtl")


if __name__ == "__main__":
    main()
