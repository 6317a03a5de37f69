"""The encoders as torch data transforms, an alternative to ``snntorch.spikegen.delta``."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.taxel import encode
from eskin.skin.textures.scan import quantise


@dataclass(frozen=True)
class LevelCrossing:
    """Transform from signals to events, bit-exact but without contention.

    A callable without state, so that it can be pickled, shared by the workers of a ``DataLoader`` and put into a
    ``torchvision`` ``Compose``. No gradient flows through it.

    Raise InputError if channels of polarity are wanted of N-LCS, which has no OFF events, or without them.

    Examples
    --------
    At N = 3 an event is a crossing of 1/16 of full scale:

    >>> import torch
    >>> encode = LevelCrossing(ReadoutConfig(rows=1, columns=1, resolution=3))
    >>> encode(torch.tensor([[0.0], [0.13], [0.13], [-0.01]])).flatten().tolist()
    [0.0, 2.0, 0.0, -2.0]
    >>> LevelCrossing(encode.config, polarity=True)(torch.tensor([[0.0], [0.13]])).shape
    torch.Size([2, 2, 1])
    """

    config: ReadoutConfig
    """Encoder and its parameters. With ``decide_every="sample"`` a taxel sends at most one event per sample, and the
    values are -1, 0 and 1; with ``"clock"`` they are counts, since several levels may be crossed in one sample."""
    off_spike: bool = True
    """OFF events count; else they are left out, as in ``spikegen.delta``."""
    polarity: bool = False
    """ON and OFF in channels of their own, shape (time, 2, ...), ON first as in the network's channels; else OFF events
    are negative, in the shape of the signals."""

    def __post_init__(self) -> None:
        if self.polarity and not self.config.has_polarity:
            raise InputError(f"encoding {self.config.encoding} has no OFF events; leave polarity out")
        if self.polarity and not self.off_spike:
            raise InputError("polarity needs OFF events; leave off_spike at True")

    def __call__(self, data: Tensor | NDArray[Any]) -> Tensor:
        """Return the event counts of each sample.

        Raise InputError if the data are not floating-point, have no time dimension, hold NaN or do not fit the array.

        The shape is (time, ...) or (time, 2, ...); type and device are those of the data.

        ``data``: floating-point, shape (time, ...), in full scales: the range is -1.0 to 1.0, what is outside
        saturates. It is rounded half to even to codes of ``config.sample_bits`` bits. The reference starts at
        ``config.reference_reset``. Where the reference leaks, which depends on the row, the last dimensions are
        (..., rows, columns) or (..., taxels).
        """
        tensor = torch.as_tensor(data)
        if not tensor.is_floating_point():
            raise InputError(
                f"signals must be floating-point numbers in full scales, not {tensor.dtype}; divide them by their range"
            )
        if tensor.ndim < 1:
            raise InputError("signals must have the shape (time, ...), not a single number")
        codes, _ = quantise(tensor.detach().cpu().double().numpy(), self.config.sample_bits)
        events = torch.from_numpy(self._encode(codes)).to(tensor)
        if self.polarity:
            return torch.stack((events.clamp_min(0), (-events).clamp_min(0)), 1)
        return events if self.off_spike else events.clamp_min(0)

    def _encode(self, codes: NDArray[np.int32]) -> NDArray[Any]:
        """Return the signed event counts of codes, in the shape of the codes (time, ...)."""
        if not codes.size:
            return np.zeros(codes.shape, np.int16)
        flat = codes.reshape(len(codes), -1)
        if not self.config.encoder.leaks and self.config.receptive_fields == "own":
            return encode(self.config, flat).reshape(codes.shape)
        taxels, fields = self.config.taxels, "" if self.config.receptive_fields == "own" else " with receptive fields"
        last = codes.shape[1:]
        if not (last[-1:] == (taxels,) or last[-2:] == (self.config.rows, self.config.columns)):
            raise InputError(
                f"{self.config.encoding}{fields} takes signals of shape (time, ..., {self.config.rows}, "
                f"{self.config.columns}) or (time, ..., {taxels}), not {codes.shape}; change rows and columns of the "
                f"configuration"
            )
        arrays = [encode(self.config, flat[:, at : at + taxels]) for at in range(0, flat.shape[1], taxels)]
        return np.concatenate(arrays, 1).reshape(codes.shape)
