"""Measure the size of events or frames after lossless compression with the standard library.

The streams of several scans are concatenated, as if an array scanned without pause. The smallest result of zlib, bz2
and LZMA counts. It is what standard coders reach, not a bound: a coder designed for the signal does better.
"""

import bz2
import lzma
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eskin.model.address_events import taxel_of
from eskin.model.events.recording import Recording
from eskin.snn.data.bins import counted_from
from eskin.snn.data.frame_steps import FrameSteps


def coded_bits(words: NDArray[np.unsignedinteger]) -> int:
    """Return the compressed size in bits of a stream of words, after grouping bytes of equal weight."""
    planes = words.astype(f"<u{words.dtype.itemsize}").view(np.uint8).reshape(len(words), words.dtype.itemsize).T
    stream = planes.tobytes()
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9}]
    sizes = [
        len(zlib.compress(stream, 9)),
        len(bz2.compress(stream, 9)),
        len(lzma.compress(stream, lzma.FORMAT_RAW, filters=filters)),
    ]
    return 8 * min(sizes)


def events_bps(recordings: Sequence[Recording], start_s: float | None = None) -> dict[str, float]:
    """Return the compressed bits per second of the counted events of recordings.

    ``addresses``: polarity and address of every event in the order sent; like the words on an AER link they have no
    time stamps. ``events``: these, and the sample ticks since the event before.
    """
    addresses, ticks = [], []
    for recording in recordings:
        config = recording.config
        events = recording.events[recording.events["t"] >= counted_from(recording, start_s)]
        off = np.where(events["p"], 0, config.taxels) if config.has_polarity else 0
        addresses.append((taxel_of(events, config) + off).astype(np.uint16))
        ticks.append(np.diff(events["t"].astype(np.int64) // config.clocks_per_sample, prepend=0).astype(np.uint32))
    seconds = sum(recording.duration_s for recording in recordings)
    bits = coded_bits(np.concatenate(addresses))
    return {"addresses": bits / seconds, "events": (bits + coded_bits(np.concatenate(ticks))) / seconds}


def frames_bps(codes: Sequence[NDArray[np.int32]], frames: FrameSteps) -> dict[str, float]:
    """Return the compressed bits per second of the frames of scans.

    ``samples``: the words as sent. ``differences``: to the previous frame, modulo 2**bits, with small values of either
    sign as small words.

    - ``codes``: shape (frames, taxels).
    """
    mask = 2**frames.bits - 1
    kind = np.min_scalar_type(mask)
    samples = [(scan & mask).astype(kind).ravel() for scan in codes]
    changes = []
    for scan in codes:
        change = ((np.diff(scan, axis=0, prepend=0) + mask // 2 + 1) & mask) - mask // 2 - 1
        changes.append(((change << 1 ^ change >> 31) & mask).astype(kind).ravel())
    seconds = sum(map(len, codes)) / frames.rate_hz
    forms = {"samples": samples, "differences": changes}
    return {name: coded_bits(np.concatenate(words)) / seconds for name, words in forms.items()}
