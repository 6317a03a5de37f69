"""Run the cells of docs/tutorial.md, and write their output and pictures into the page.

Run ``python docs/tutorial_page.py`` in the repository root. The program does nothing if neither text nor cells have
changed since its last run, unless you give ``--again``. The notebook of the site is made from the same page.
"""

import contextlib
import hashlib
import io
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PAGE = HERE / "tutorial.md"
PICTURES = HERE / "figures" / "tutorial"

CELL = re.compile(r"^```python\n(.*?)^```\n\n", re.MULTILINE | re.DOTALL)
MADE = re.compile(r"^```text\n(?s:.*?)^```\n\n|^!\[Picture .*\n\n|^<!-- SHA-256 .*\n", re.MULTILINE)
"""Everything that this program writes into the page: outputs, pictures, and the mark in the last line."""


def source() -> str:
    """Return the page without what this program writes."""
    return MADE.sub("", PAGE.read_text())


def mark() -> str:
    """Return the last line of a page whose outputs belong to its cells."""
    return f"<!-- SHA-256 of text and cells: {hashlib.sha256(source().encode()).hexdigest()[:16]} -->\n"


def run(pictures: Path) -> str:
    """Run all cells, write their pictures into a folder, and return the page, which links to ``figures/tutorial``."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    pictures.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {"__name__": "tutorial"}
    page, *rest = CELL.split(source())
    cells = list(zip(rest[::2], rest[1::2], strict=True))
    count = 0
    for number, (cell, text) in enumerate(cells, 1):
        print(f"tutorial: cell {number} of {len(cells)}", file=sys.stderr, flush=True)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(cell, str(PAGE), "exec"), names)
        page += f"```python\n{cell}```\n\n"
        if printed.getvalue():
            page += f"```text\n{printed.getvalue().rstrip()}\n```\n\n"
        for figure in plt.get_fignums():
            count += 1
            plt.figure(figure).savefig(pictures / f"{count}.png", dpi=110, metadata={"Software": None})
            page += f"![Picture {count} of the tutorial](figures/tutorial/{count}.png)\n\n"
        plt.close("all")
        page += text
    return page + mark()


def main(*options: str) -> None:
    """Write the page anew if its text or cells have changed, or with ``--again``."""
    if PAGE.read_text().endswith(mark()) and "--again" not in options:
        print("tutorial: unchanged", file=sys.stderr)
    else:
        PAGE.write_text(run(PICTURES))


if __name__ == "__main__":
    main(*sys.argv[1:])
