"""Registry of all hardware encoders."""

from __future__ import annotations

from eskin.base.errors import InputError
from eskin.model.encoders import registry as model
from eskin.rtl.encoders.cw_lcs import CwLcs
from eskin.rtl.encoders.encoder import Encoder
from eskin.rtl.encoders.lcs import Lcs
from eskin.rtl.encoders.nlcs import Nlcs
from eskin.rtl.encoders.nlcs_bipolar import NlcsBipolar

ENCODERS: tuple[Encoder, ...] = (Lcs(), CwLcs(), Nlcs(), NlcsBipolar())


def named(name: str) -> Encoder:
    """Return the hardware of the encoder of a given name."""
    for encoder in ENCODERS:
        if encoder.name == model.named(name).name:
            return encoder
    raise InputError(f"the encoder {name} has no hardware in rtl/encoders")
