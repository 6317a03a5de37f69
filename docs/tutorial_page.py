"""Run the cells of docs/tutorial.py, and write docs/tutorial.md with their output and pictures.

Run ``python docs/tutorial_page.py`` in the repository root. The program does nothing if the page was made from the
current source, unless you give ``--again``. The notebook of the site is made from the same source.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jupytext
import matplotlib

HERE = Path(__file__).parent
SOURCE = HERE / "tutorial.py"
PAGE = HERE / "tutorial.md"
PICTURES = HERE / "figures" / "tutorial"


def mark() -> str:
    """Return the last line of a page that was made from the current source."""
    return f"<!-- made from tutorial.py, SHA-256 {hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]} -->\n"


def cells() -> Iterator[tuple[bool, str]]:
    """Yield the cells of the tutorial: code flag and text."""
    for cell in jupytext.read(SOURCE).cells:
        yield cell.cell_type == "code", cell.source


def run(pictures: Path) -> str:
    """Run all cells, write their pictures into a folder, and return the page, which links to ``figures/tutorial``."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    pictures.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {"__name__": "tutorial"}
    parts = []
    count = 0
    found = list(cells())
    for number, (code, text) in enumerate(found, 1):
        print(f"tutorial: cell {number} of {len(found)}", file=sys.stderr, flush=True)
        if not code:
            parts.append(text)
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(text, str(SOURCE), "exec"), names)
        parts.append(f"```python\n{text}\n```")
        if printed.getvalue():
            parts.append(f"```text\n{printed.getvalue().rstrip()}\n```")
        for figure in plt.get_fignums():
            count += 1
            plt.figure(figure).savefig(pictures / f"{count}.png", dpi=110, metadata={"Software": None})
            parts.append(f"![Picture {count} of the tutorial](figures/tutorial/{count}.png)")
        plt.close("all")
    return "\n\n".join(parts) + "\n\n" + mark()


if __name__ == "__main__":
    if PAGE.exists() and PAGE.read_text().endswith(mark()) and "--again" not in sys.argv:
        print("tutorial: unchanged", file=sys.stderr)
    else:
        PAGE.write_text(run(PICTURES))
