"""Calls of encoder functions from Numba loops, selected by the type of the rule.

A loop that calls them is compiled anew for every encoder, without a branch between encoders, and can be cached.
"""

import inspect
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.extending import overload, register_jitable

from eskin.model import decay, window
from eskin.model.encoders import encoder as common
from eskin.model.encoders.registry import ENCODERS


def by_rule(objects: Iterable[Any], name: str) -> Any:
    """Return a function that calls the function ``name`` of the object whose rule is its first argument."""
    found = {one.Rule: one for one in objects}

    def call(rule: Any, *arguments: Any) -> Any:
        return getattr(found[type(rule)], name)(rule, *arguments)

    # Not strict: the functions of an encoder have type hints, which Numba would take for another signature.
    overload(call, strict=False, inline="always")(lambda rule, *_: getattr(found[rule.instance_class], name))
    return call


compare, reach, move, clear, ticks = (
    by_rule(ENCODERS, name) for name in ("compare", "reach", "move", "clear", "ticks")
)


def with_settings(rule: Any, now: Any) -> Any:
    """Return the rule of an encoder, changed by the settings of a host."""
    return _changed(type(rule))(rule, now)


def _changed(kind: Any) -> Any:
    def changed(rule: Any, now: Any) -> Any:
        step_log2 = rule.step_log2 + now.coarser
        steps = 1 << step_log2, 1 << step_log2 - rule.levels_log2
        return kind(*steps, now.window_period, now.leak_shift, now.leak_period, *rule[5:])

    return changed


overload(with_settings, strict=False, inline="always")(lambda rule, _: _changed(rule.instance_class))

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
