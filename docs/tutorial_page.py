"""Write docs/tutorial.md from docs/tutorial.py: every cell is run, and what it prints and draws stands below it.

``python docs/tutorial_page.py`` from the top of the project. The notebook of the site is made from the same source.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jupytext
import matplotlib

HERE = Path(__file__).parent
SOURCE = HERE / "tutorial.py"
PAGE = HERE / "tutorial.md"
PICTURES = HERE / "figures" / "tutorial"


def cells() -> Iterator[tuple[bool, str]]:
    """Yield the cells: whether each is code, and its text."""
    for cell in jupytext.read(SOURCE).cells:
        yield cell.cell_type == "code", cell.source


def run(pictures: Path) -> str:
    """Run all cells in one namespace, write their pictures into a folder, and return the text of the page.

    Parameters
    ----------
    pictures : Path
        Folder, made if need be. The page names them by their place in the documents all the same.
    """
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    pictures.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {"__name__": "tutorial"}
    parts = []
    count = 0
    for code, text in cells():
        if not code:
            parts.append(text)
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(text, str(SOURCE), "exec"), names)
        parts.append(f"```python\n{text}\n```")
        if printed.getvalue():
            parts.append(f"```text\n{printed.getvalue().rstrip()}\n```")
        for number in plt.get_fignums():
            count += 1
            plt.figure(number).savefig(pictures / f"{count}.png", dpi=110, metadata={"Software": None})
            parts.append(f"![Picture {count} of the tutorial](figures/tutorial/{count}.png)")
        plt.close("all")
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(run(PICTURES))
