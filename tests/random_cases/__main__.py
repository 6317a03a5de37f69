"""Search for a difference between RTL and model: ``python -m tests.random_cases EXAMPLES [SEED]``.

``CASE`` plays one.
"""

import secrets
import sys
import time

from eskin.base.errors import InputError
from tests.random_cases.case import Case, search

USAGE = "usage: python -m tests.random_cases EXAMPLES [SEED], or python -m tests.random_cases CASE, a line of JSON"


def main(words: list[str]) -> str | int:
    """Return an error message, or 0."""
    if words and words[0].startswith("{") and len(words) == 1:
        return Case.from_json(words[0]).difference() or _said("RTL and model agree")
    if not 1 <= len(words) <= 2 or not all(word.isdecimal() for word in words) or int(words[0]) < 1:
        raise InputError(USAGE)
    seed = int(words[1]) if len(words) == 2 else secrets.randbelow(10**6)
    begun = time.monotonic()
    found = search(int(words[0]), seed)
    rate = found.examples / (time.monotonic() - begun)
    print(f"seed {seed}: {found.examples:,} cases, {rate:.0f} a second")
    return found.told if found.case else _said("RTL and model agree in all of them")


def _said(text: str) -> int:
    print(text)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except InputError as wrong:
        print(f"error: {wrong}", file=sys.stderr)
        sys.exit(2)
