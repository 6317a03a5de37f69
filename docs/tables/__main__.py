"""Regenerate the tables in README and pages with cog, or check them: ``python -m docs.tables [--check]``."""

import sys

from cogapp import Cog

from docs.tables.write import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main(options: list[str], pages: list[str] | None = None) -> int:
    """Run cog, and return its exit code: 0 for success, 5 if ``--check`` finds an outdated page."""
    prologue = ["-P", "-p", "from docs.tables import *", "--verbosity=1"]
    return Cog().main(["cog", *(options or ["-r"]), *prologue, *(pages or map(str, PAGES))])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
