"""Registry of all hardware encoders."""

from eskin.base.errors import InputError
from eskin.model.encoders import registry as model
from eskin.rtl.encoders import cw_lcs, lcs, nlcs, nlcs_bipolar
from eskin.rtl.encoders.encoder import Build

ENCODERS: dict[str, Build] = {
    "lcs": lcs.build,
    "cw-lcs": cw_lcs.build,
    "nlcs": nlcs.build,
    "nlcs-bipolar": nlcs_bipolar.build,
}


def named(name: str) -> Build:
    """Return the hardware of the encoder of a given name."""
    if model.named(name).name not in ENCODERS:
        raise InputError(f"the encoder {name} has no hardware in rtl/encoders")
    return ENCODERS[name]
