"""Registry of all links."""

from eskin.base.errors import InputError
from eskin.model.links.four_phase import FourPhase
from eskin.model.links.four_phase_dual import FourPhaseDual
from eskin.model.links.link import Link
from eskin.model.links.stream import Stream

LINKS: tuple[Link, ...] = (Stream(), FourPhase(), FourPhaseDual())
"""All links, in the order of commands and tables."""

NAMES = tuple(link.name for link in LINKS)


def named(name: str) -> Link:
    """Return the link of a given name.

    Examples
    --------
    >>> named("four_phase").clocks_per_event
    7
    >>> named("uart")
    Traceback (most recent call last):
    eskin.base.errors.InputError: there is no link 'uart'; the links are stream, four_phase, four_phase_dual
    """
    for link in LINKS:
        if link.name == name:
            return link
    raise InputError(f"there is no link {name!r}; the links are {', '.join(NAMES)}")
