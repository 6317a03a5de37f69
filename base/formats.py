"""File formats of the project; each file contains the name of its format."""

from typing import Any, NamedTuple

from eskin.base.errors import InputError


class Format(NamedTuple):
    """A file format with name and version."""

    name: str
    """Value of ``format`` in the file."""
    noun: str
    """Name of the format for a user."""
    made: str
    """How a user gets a file of this format."""
    version: int = 1

    def check(self, header: Any) -> None:
        """Check that the header of a file names this format and a known version.

        The message of the InputError continues the name of the file and a colon. A header that is not of this project
        raises KeyError.
        """
        if not isinstance(header, dict) or (found := KINDS.get(str(header.get("format")))) is None:
            raise KeyError("format")
        if found != self:
            raise InputError(f"it is {found.noun} instead of {self.noun}; {self.made}")
        version = header.get("format_version")
        if type(version) is not int or version != self.version:  # 1.0 and true equal 1
            raise InputError(f"it has format version {version!r}; this program reads version {self.version}")


EVENTS = Format("spiking-eskin-readout events", "an event file", "make one with eskin encode")
NETWORK = Format("spiking-eskin-readout network", "a NIR graph", "make one with eskin export")
WEIGHTS = Format("spiking-eskin-readout weights", "a float network", "make one with eskin train")
INTEGER = Format(
    "spiking-eskin-readout integer network",
    "an integer network",
    "make one with eskin quantise WEIGHTS.npz -o INTEGER.npz",
)
KINDS = {kind.name: kind for kind in (EVENTS, NETWORK, WEIGHTS, INTEGER)}
