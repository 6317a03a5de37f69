"""Readouts that have power equations: LCS, N-LCS and frames."""

from typing import Literal, TypeVar, get_args

from eskin.base.errors import InputError
from eskin.model.encoders import registry

Readout = Literal["nlcs", "lcs", "frame"]
"""Readouts in the order of Fig. 6."""

READOUTS: tuple[Readout, ...] = get_args(Readout)
SPIKING = tuple(readout for readout in READOUTS if readout != "frame")
"""The encoders with published equations and event rates."""

READOUT_NAMES: dict[str, str] = {name: registry.named(name).title for name in SPIKING} | {"frame": "frame"}

EQUATIONS: dict[str, Readout] = {"lcs": "lcs", "cw-lcs": "lcs", "nlcs": "nlcs"}
"""Readout with the power equations of each encoder.

CW-LCS has the equations of LCS, at the event rate of CW-LCS; they ignore the closing window.
"""

T = TypeVar("T")


def published(readout: str, *, lcs: T, nlcs: T) -> T:
    """Return the given value for a readout with published equations: ``lcs`` or ``nlcs``.

    Raises InputError if the encoder has no published equations.
    """
    if readout not in SPIKING:
        raise InputError(f"the power model has equations of {' and '.join(SPIKING)} only, not of {readout}")
    return lcs if readout == "lcs" else nlcs


def equations_of(encoding: str) -> Readout:
    """Return the readout with the power equations of an encoder.

    Raises InputError if the encoder has none.
    """
    if encoding not in EQUATIONS:
        raise InputError(f"the power model has equations of {', '.join(EQUATIONS)} only, not of {encoding}")
    return EQUATIONS[encoding]
