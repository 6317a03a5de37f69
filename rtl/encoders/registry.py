"""The hardware of all encoders."""

from __future__ import annotations

from base.errors import InputError
from model.encoders import registry as model
from rtl.encoders.cw_lcs import CwLcs
from rtl.encoders.encoder import Encoder
from rtl.encoders.lcs import Lcs
from rtl.encoders.nlcs import Nlcs
from rtl.encoders.nlcs_bipolar import NlcsBipolar

ENCODERS: tuple[Encoder, ...] = (Lcs(), CwLcs(), Nlcs(), NlcsBipolar())


def named(name: str) -> Encoder:
    """Return the hardware of the encoder of a name.

    Raises
    ------
    InputError
        If no encoder has that name, or the one that has it has no hardware.
    """
    for encoder in ENCODERS:
        if encoder.name == model.named(name).name:
            return encoder
    raise InputError(f"the encoder {name} has no hardware in rtl/encoders")
