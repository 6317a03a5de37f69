"""Read the events of an AEDAT 4 file in a process of its own: the library crashes or hangs on some damaged files."""

import sys
from pathlib import Path

import numpy as np

from eskin.base.files import write_arrays

NO_STREAM = 3
"""Exit code for a file without a stream of events."""

FIELDS = ("timestamp", "x", "y", "polarity")


def main() -> None:
    """Write rows, columns and events of the file in the first argument to the .npz in the second."""
    import dv_processing as dv

    source = dv.io.MonoCameraRecording(sys.argv[1])
    if not source.isEventStreamAvailable():
        sys.exit(NO_STREAM)
    columns, rows = source.getEventResolution()
    batches = []
    while source.isRunning() and (batch := source.getNextEventBatch()) is not None:
        batches.append(batch.numpy())
    found = np.concatenate(batches) if batches else np.empty(0, [(name, "<i8") for name in FIELDS])
    write_arrays(Path(sys.argv[2]), {"size": np.array([rows, columns])} | {name: found[name] for name in FIELDS})


if __name__ == "__main__":
    main()
