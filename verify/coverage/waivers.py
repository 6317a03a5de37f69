"""Waivers for uncovered constructs (``waivers.toml``), each with its reason."""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.verify.coverage.constructs import Construct

Patterns = str | tuple[str, ...]
"""One text or several alternative texts, in which ``*`` stands for any characters; an empty tuple fits every text."""


@dataclass(frozen=True)
class Waiver:
    """Reason why certain constructs are not covered."""

    kind: Patterns  # ``line``, ``branch``, ``toggle``, ``condition`` or ``point``
    module: Patterns
    reason: str
    what: Patterns = ()  # a toggle, ``fall[2]:1->0``; the terms and result of a condition, ``(x[2]==0) => 1``
    source: Patterns = ()  # line of the Verilog

    def explains(self, construct: Construct) -> bool:
        """Return True if the waiver applies to a construct."""
        return all(
            _fits(getattr(self, name), getattr(construct, name)) for name in ("kind", "module", "what", "source")
        )


def _fits(wanted: Patterns, text: str) -> bool:
    """Return True if a text matches a pattern."""
    patterns = (wanted,) if isinstance(wanted, str) else wanted
    regexes = [re.escape(pattern).replace(r"\*", ".*") for pattern in patterns]
    return not regexes or any(re.fullmatch(regex, text) for regex in regexes)


def waivers() -> list[Waiver]:
    """Return the waivers of the project."""
    listed: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("waivers.toml").read_text())["waiver"]
    for entry in listed:
        entry |= {name: tuple(value) for name, value in entry.items() if isinstance(value, list)}
    return [Waiver(**entry) for entry in listed]
