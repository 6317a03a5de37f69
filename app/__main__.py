"""The command ``eskin``: one program for model, RTL, co-simulation, classifier, flow and checks."""

from __future__ import annotations

from eskin.app.cli import AllCommands, make_app, run

app = make_app("Spiking readout for electronic skin: model, RTL, co-simulation, classifier.", AllCommands)


def main() -> None:
    """Run the command line."""
    run(app, "eskin")


if __name__ == "__main__":
    main()
