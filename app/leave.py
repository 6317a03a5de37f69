"""Exit the process quietly after an interrupt or a closed pipe."""

import errno
import io
import os
import sys
from collections.abc import Callable
from typing import NoReturn

EXIT_INPUT_ERROR = 2
EXIT_INTERRUPTED = 128 + 2  # SIGINT, as a shell reports it
EXIT_BROKEN_PIPE = 128 + 13  # SIGPIPE


def leave_quietly(work: Callable[[], int | None]) -> NoReturn:
    """Run a function and exit with its return code, or 0 for None; 130 for Ctrl-C, 141 for a closed pipe.

    A full disk behind the output is one sentence. A closed output is none: a file must not get its number. A terminal
    that lacks a character shows its code.
    """
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115  # open until the end
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = work()
        sys.stdout.flush()
    except KeyboardInterrupt:
        code = EXIT_INTERRUPTED
    except BrokenPipeError:
        _flush_no_more()
        code = EXIT_BROKEN_PIPE
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        _flush_no_more()
        print("error: cannot write the output: No space left on device", file=sys.stderr)
        code = EXIT_INPUT_ERROR
    sys.exit(code or 0)


def _flush_no_more() -> None:
    """Discard what is left of the output, which the interpreter would flush at its end, and complain."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
