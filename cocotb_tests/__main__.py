"""``python -m cocotb_tests``: RTL against model, on scenarios and on whole datasets."""

from __future__ import annotations

from model.cli.app import leave_without, make_app, run

try:
    from cocotb_tests.commands.replay import replay
    from cocotb_tests.commands.sim import sim
    from cocotb_tests.commands.soak import soak
    from cocotb_tests.commands.touch import touch
except ModuleNotFoundError as error:
    if __name__ != "__main__":
        raise
    leave_without(error)

app = make_app("Co-simulation of the spiking e-skin readout: RTL against golden model.")
app.command()(sim)
app.command()(replay)
app.command()(touch)
app.command()(soak)


def main() -> None:
    """Run the command line of the co-simulation."""
    run(app, "python -m cocotb_tests")


if __name__ == "__main__":
    main()
