"""Titles, colours and markers of the readouts in all figures."""

from typing import NamedTuple

from eskin.base.figures.style import PALETTE
from eskin.model.encoders import registry

FRAME = "frame"  # name of the frame readout, in points and data


class Look(NamedTuple):
    """Title, colour and marker of a readout in figures."""

    title: str
    colour: str
    marker: str


LOOKS = {encoder.name: Look(encoder.title, encoder.colour, encoder.marker) for encoder in registry.ENCODERS} | {
    FRAME: Look("frames", PALETTE["black"], "s")
}
"""Look of each readout, by name."""


def look(readout: str) -> Look:
    """Return title, colour and marker of a readout.

    Raise InputError if it is neither an encoder nor frames.
    """
    return LOOKS[FRAME] if readout == FRAME else LOOKS[registry.named(readout).name]
