"""Registry of the hardware of all links."""

from eskin.base.errors import InputError
from eskin.model.links import registry as model
from eskin.rtl.links.four_phase import DUAL, FOUR_PHASE
from eskin.rtl.links.link import Hardware
from eskin.rtl.links.stream import STREAM

LINKS: dict[str, Hardware] = {"stream": STREAM, "four_phase": FOUR_PHASE, "four_phase_dual": DUAL}


def named(name: str) -> Hardware:
    """Return the hardware of the link of a given name."""
    if model.named(name).name not in LINKS:
        raise InputError(f"the link {name} has no hardware in rtl/links")
    return LINKS[name]
