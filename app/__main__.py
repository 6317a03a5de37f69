"""The command ``eskin``: one program for model, RTL, co-simulation, classifier, flow and checks."""

import sys

from eskin.app.catalogue import overview
from eskin.app.leave import leave_quietly


def main() -> None:
    """Run the command line; the list of commands is printed without importing other packages."""
    if sys.argv[1:] in ([], ["-h"], ["--help"]):
        leave_quietly(lambda: print(overview()))
    from eskin.app.cli import app, run

    run(app, "eskin")


if __name__ == "__main__":
    main()
