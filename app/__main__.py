"""The command ``eskin``: one program for model, RTL, co-simulation, classifier, flow and checks."""

import os
import sys

from eskin.app.leave import leave_quietly

UNHEARD = ("MPLBACKEND", "NUMBA_DISABLE_JIT")
"""Variables of libraries that would break the program: figures are files, and kernels need the compiler."""


def main() -> None:
    """Run the command line; the list of commands is printed without importing other packages."""
    if sys.argv[1:] in ([], ["-h"], ["--help"]):
        leave_quietly(_overview)
    for name in UNHEARD:
        os.environ.pop(name, None)
    leave_quietly(_run)


def _overview() -> None:
    from eskin.app.catalogue import overview  # here, so that Ctrl-C is quiet from the start

    print(overview())


def _run() -> None:
    from eskin.app.cli import app, run

    run(app, "eskin")


if __name__ == "__main__":
    main()
