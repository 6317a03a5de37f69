"""Calls of encoder functions from Numba loops, selected by the type of the rule.

A loop that calls them is compiled anew for every encoder, without a branch between encoders, and can be cached.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.extending import overload, register_jitable

from eskin.model import decay, window
from eskin.model.encoders import encoder as common
from eskin.model.encoders.encoder import Encoder
from eskin.model.encoders.registry import ENCODERS

BY_RULE: dict[type[Any], Encoder] = {encoder.Rule: encoder for encoder in ENCODERS}


def _of(rule: Any) -> Encoder:
    """Return the encoder for a rule type, as a Numba type."""
    return BY_RULE[rule.instance_class]


def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
    """Call ``Encoder.compare``."""
    return BY_RULE[type(rule)].compare(rule, taxel)


def reach(rule: Any, taxel: Any) -> Any:
    """Call ``Encoder.reach``."""
    return BY_RULE[type(rule)].reach(rule, taxel)


def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
    """Call ``Encoder.move``."""
    return BY_RULE[type(rule)].move(rule, taxel, on, off, tick, leaks)


def clear(rule: Any, taxel: Any) -> None:
    """Call ``Encoder.clear``."""
    BY_RULE[type(rule)].clear(rule, taxel)


def told(rule: Any, now: Any) -> Any:
    """Call ``Encoder.told``."""
    return BY_RULE[type(rule)].told(rule, now)


def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
    """Call ``Encoder.ticks``."""
    BY_RULE[type(rule)].ticks(rule, x, state, phase, tick, counts, late, timed)


def decode(rule: Any, counts: Any, late: Any, phase: Any, ends: Any, u: Any, reference: Any) -> None:
    """Call ``Encoder.decode``."""
    BY_RULE[type(rule)].decode(rule, counts, late, phase, ends, u, reference)


# Not strict: the functions of an encoder have type hints, which Numba would take for another signature.
overload(compare, strict=False, inline="always")(lambda rule, taxel: _of(rule).compare)
overload(reach, strict=False, inline="always")(lambda rule, taxel: _of(rule).reach)
overload(move, strict=False, inline="always")(lambda rule, taxel, on, off, tick, leaks: _of(rule).move)
overload(clear, strict=False, inline="always")(lambda rule, taxel: _of(rule).clear)
overload(told, strict=False, inline="always")(lambda rule, now: _of(rule).told)
overload(ticks, strict=False, inline="always")(lambda rule, x, state, phase, tick, counts, late, timed: _of(rule).ticks)
overload(decode, strict=False, inline="always")(lambda rule, counts, late, phase, ends, u, reference: _of(rule).decode)

MODULES: tuple[ModuleType, ...] = (common, decay, window, *(sys.modules[type(e).__module__] for e in ENCODERS))
"""Modules whose functions the encoders may call."""
for _module in MODULES:
    for _, _helper in inspect.getmembers(_module, inspect.isfunction):
        if _helper.__module__ == _module.__name__:
            register_jitable(_helper)


def sources() -> Iterator[Path]:
    """Yield the source files that determine a compiled loop, and the folder of the encoders."""
    folder = Path(__file__).parent
    yield from (folder, Path(__file__), *(Path(str(module.__file__)) for module in MODULES))
