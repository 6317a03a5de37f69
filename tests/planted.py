"""Plant a bug in the RTL source for a test."""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from eskin.rtl.encoders.registry import ENCODERS
from eskin.rtl.links.registry import LINKS


@contextmanager
def planted(file: str, *edits: tuple[str, str]) -> Iterator[None]:
    """Replace functions and classes in all RTL modules by those of an edited file such as "tiles.merge".

    Each edit is a text that stands in the file once, and the text that takes its place.
    """
    module = importlib.import_module(f"eskin.rtl.{file}")
    text = Path(str(module.__file__)).read_text()
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in rtl.{file}: the RTL has moved on"
        text = text.replace(old, new)
    changed = ModuleType(module.__name__)
    exec(compile(text, f"rtl.{file} with a bug", "exec"), vars(changed))
    own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
    users = [user for name, user in sys.modules.items() if name.startswith("eskin.rtl.")]
    found = [(user, name, value) for user in users for name, value in own.items() if vars(user).get(name) is value]
    replaced: list[tuple[Any, str, Any, Any]] = [
        (user, name, value, getattr(changed, name)) for user, name, value in found
    ]
    listed = {name: build for name, build in ENCODERS.items() if build in own.values()}
    blocks = {name: link.block.__name__ for name, link in LINKS.items() if link.block and link.block in own.values()}
    linked = {name: LINKS[name] for name in blocks}
    for user, name, _, new in replaced:
        setattr(user, name, new)
    ENCODERS.update({name: getattr(changed, build.__name__) for name, build in listed.items()})
    LINKS.update({name: linked[name]._replace(block=getattr(changed, block)) for name, block in blocks.items()})
    try:
        yield
    finally:
        ENCODERS.update(listed)
        LINKS.update(linked)
        for user, name, value, _ in replaced:
            setattr(user, name, value)
