"""What a campaign has found out on its way, kept line by line: a stopped one asks nothing twice."""

from __future__ import annotations

import json
from pathlib import Path


class Facts:
    """Answers by their questions, in a file of JSON lines.

    Parameters
    ----------
    path : Path
        A line that was cut off is left out.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known: dict[str, str] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                question, answer = json.loads(line)
            except ValueError:
                continue
            self._known[question] = answer

    def get(self, question: str) -> str | None:
        """Return an answer, None if there is none."""
        return self._known.get(question)

    def add(self, question: str, answer: str) -> None:
        """Keep an answer."""
        self._known[question] = answer
        with self.path.open("a") as file:
            file.write(json.dumps([question, answer]) + "\n")
