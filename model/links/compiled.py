"""Calls of link functions from Numba loops, selected by the type of the rule (``eskin.model.encoders.compiled``)."""

import sys
from collections.abc import Iterator
from pathlib import Path

from eskin.model.encoders.compiled import by_rule
from eskin.model.links.registry import LINKS

ready, advance, rests = (by_rule(LINKS, name) for name in ("ready", "advance", "rests"))


def sources() -> Iterator[Path]:
    """Yield the source files that determine a compiled loop."""
    yield from (Path(__file__), *(Path(str(sys.modules[type(link).__module__].__file__)) for link in LINKS))
