"""``python -m docs.tables``: write the README and the pages anew with cog, or compare (``--check``)."""

from __future__ import annotations

import sys

from cogapp import Cog

from docs.tables.write import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main(options: list[str], pages: list[str] | None = None) -> int:
    """Run cog, and return its exit code: 0 if all is well, 5 if ``--check`` finds a page that would change."""
    prologue = ["-P", "-p", "from docs.tables import *", "--verbosity=1"]
    return Cog().main(["cog", *(options or ["-r"]), *prologue, *(pages or map(str, PAGES))])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
