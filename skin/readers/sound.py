"""Read sound files, as contact microphones and vibration recorders write them."""

import io
import warnings
from pathlib import Path

import numpy as np

from eskin.base.errors import InputError
from eskin.skin.readers.frame import Frame, frame_of


def read_wav(path: Path, data: bytes) -> Frame:
    """Return the channels of a .wav file; its integers are codes of its own number of bits."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks that are no sound
            rate, samples = wavfile.read(io.BytesIO(data))
    except Exception:  # the reader raises many types, depending on what is damaged
        raise InputError(f"{path} is damaged or not a .wav file of plain samples; save it as PCM") from None
    if samples.dtype == np.uint8:
        samples = samples.astype(np.int16) - 128
    kind = samples.dtype
    if kind.kind == "i":
        samples = samples / float(-int(np.iinfo(kind).min) if kind != np.int16 or samples.min() < -128 else 2**15)
    channels = samples if samples.ndim == 2 else samples[:, None]
    return frame_of(path, channels, float(rate)).noting("the channels are read in full scale of their own bits")
