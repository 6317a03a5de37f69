"""Bugs that are planted into the RTL, one at a time, to see the properties fail."""

from __future__ import annotations

import importlib
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType


@dataclass(frozen=True)
class Mutant:
    """One edit of one file of ``rtl/``.

    Parameters
    ----------
    name : str
        What is wrong, in a few words.
    file : str
        Name of the file without its suffix.
    old, new : str
        Text that stands there once, and what takes its place.
    fails : tuple of str
        Properties that fail by it; there may be more.
    """

    name: str
    file: str
    old: str
    new: str
    fails: tuple[str, ...] = ()

    def source(self) -> str:
        """Return the text of the file with the bug.

        Raises
        ------
        ValueError
            If the text to be replaced does not stand there exactly once: the RTL has moved on.
        """
        path = Path(str(importlib.import_module(f"rtl.{self.file}").__file__))
        text = path.read_text()
        if text.count(self.old) != 1:
            raise ValueError(f"mutant {self.name!r}: {self.old!r} stands {text.count(self.old)} times in {path.name}")
        return text.replace(self.old, self.new)


def mutants(block: str) -> list[Mutant]:
    """Return the bugs that the properties of a block are to notice: ``planted/BLOCK.toml``."""
    listed = tomllib.loads((Path(__file__).parent / "planted" / f"{block}.toml").read_text())["mutant"]
    return [Mutant(**{**entry, "fails": tuple(entry["fails"])}) for entry in listed]


@contextmanager
def planted(mutant: Mutant) -> Iterator[None]:
    """Let all modules use the functions and classes of a file with a bug in it, until the block ends."""
    module = importlib.import_module(f"rtl.{mutant.file}")
    changed = ModuleType(module.__name__)
    exec(compile(mutant.source(), f"{mutant.file} with {mutant.name}", "exec"), vars(changed))
    own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
    users = [user for name, user in sys.modules.items() if name.startswith("rtl.")]
    found = [(user, name, value) for user in users for name, value in own.items() if vars(user).get(name) is value]
    for user, name, _ in found:
        setattr(user, name, getattr(changed, name))
    try:
        yield
    finally:
        for user, name, value in found:
            setattr(user, name, value)
