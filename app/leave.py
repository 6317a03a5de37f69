"""Exit the process quietly after an interrupt or a closed pipe."""

import os
import sys
from collections.abc import Callable
from typing import NoReturn

EXIT_INTERRUPTED = 128 + 2  # SIGINT, as a shell reports it
EXIT_BROKEN_PIPE = 128 + 13  # SIGPIPE


def leave_quietly(work: Callable[[], int | None]) -> NoReturn:
    """Run a function and exit with its return code, or 0 for None; 130 for Ctrl-C, 141 for a closed pipe."""
    try:
        code = work()
        sys.stdout.flush()
    except KeyboardInterrupt:
        code = EXIT_INTERRUPTED
    except BrokenPipeError:
        # The interpreter flushes once more at its end, and would complain then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = EXIT_BROKEN_PIPE
    sys.exit(code or 0)
