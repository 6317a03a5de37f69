"""``python -m model``: encode, decode and compare event recordings.

A command is a function in a module that imports numba, scipy and matplotlib only inside functions, so that
``--help`` and errors come at once. To add one: import it here and register it below.
"""

from __future__ import annotations

from model.cli.app import make_app, run
from model.commands.board import listen, load, play, rescue
from model.commands.compare import compare
from model.commands.encode import decode, encode
from model.commands.event_rates import event_rates
from model.commands.explore import explore
from model.commands.frames import frames
from model.commands.power import fig6, fig7, power, sensitivity
from model.commands.rates import rates
from model.commands.report import report
from model.commands.study import study

app = make_app("Golden model of the spiking e-skin readout.")

for command in (
    encode,
    decode,
    compare,
    rates,
    event_rates,
    power,
    fig6,
    fig7,
    sensitivity,
    explore,
    frames,
    study,
    report,
    play,
    listen,
    load,
    rescue,
):
    app.command()(command)


def main() -> None:
    """Run the command line of the model."""
    run(app, "python -m model")


if __name__ == "__main__":
    main()
