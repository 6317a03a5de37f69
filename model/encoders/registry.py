"""Registry of all encoders."""

from eskin.base.errors import InputError
from eskin.model.encoders.cw_lcs import CwLcs
from eskin.model.encoders.encoder import Encoder
from eskin.model.encoders.lcs import Lcs
from eskin.model.encoders.nlcs import Nlcs
from eskin.model.encoders.nlcs_bipolar import NlcsBipolar

ENCODERS: tuple[Encoder, ...] = (Lcs(), CwLcs(), Nlcs(), NlcsBipolar())
"""All encoders, in the order of commands, tables and figures."""

NAMES = tuple(encoder.name for encoder in ENCODERS)


def named(name: str) -> Encoder:
    """Return the encoder of a given name.

    Examples
    --------
    >>> named("nlcs").title
    'N-LCS'
    >>> named("pcm")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    eskin.base.errors.InputError: there is no encoder 'pcm'; the encoders are lcs, cw-lcs, nlcs, ...
    """
    for encoder in ENCODERS:
        if encoder.name == name:
            return encoder
    raise InputError(f"there is no encoder {name!r}; the encoders are {', '.join(NAMES)}")


def check(encoders: tuple[Encoder, ...]) -> None:
    """Check that names, titles, codes, colours, markers and rule types of encoders are unique.

    Two rule classes of one name would even share the compiled loops that Numba caches.
    """
    for what in ("name", "title", "code", "colour", "marker", "Rule"):
        values = [getattr(encoder, what) for encoder in encoders]
        values = [value.__name__ if isinstance(value, type) else value for value in values]
        if twice := sorted({value for value in values if values.count(value) > 1}):
            raise ValueError(f"two encoders have the {what} {twice[0]!r}; use different ones")


check(ENCODERS)
