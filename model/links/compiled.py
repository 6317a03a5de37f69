"""Calls of link functions from Numba loops, selected by the type of the rule (``eskin.model.encoders.compiled``)."""

import sys
from collections.abc import Iterator
from pathlib import Path

from eskin.model.encoders.compiled import by_rule
from eskin.model.links.link import Link
from eskin.model.links.registry import LINKS

ready, advance, rests = (by_rule(LINKS, name) for name in ("ready", "advance", "rests"))


def sources() -> Iterator[Path]:
    """Yield the source files that determine a compiled loop, and the folder of the links."""
    modules = {kind.__module__ for link in LINKS for kind in type(link).__mro__ if issubclass(kind, Link)}
    yield from (Path(__file__).parent, Path(__file__), *(Path(str(sys.modules[name].__file__)) for name in modules))
