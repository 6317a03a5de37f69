"""What a campaign has found out on its way, kept line by line: a stopped one asks nothing twice."""

from __future__ import annotations

from pathlib import Path

from model.files import keep_line, kept_lines

FACTS = "facts.jsonl"
"""Their file in the folder of a campaign."""


class Facts:
    """Answers by their questions, in a file of JSON lines.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._known: dict[str, str] = dict(kept_lines(path))

    def get(self, question: str) -> str | None:
        """Return an answer, None if there is none."""
        return self._known.get(question)

    def of(self, beginning: str) -> dict[str, str]:
        """Return the answers that are not empty of questions with a beginning, without it."""
        found = {question: answer for question, answer in self._known.items() if question.startswith(beginning)}
        return {question.removeprefix(beginning): answer for question, answer in found.items() if answer}

    def add(self, question: str, answer: str) -> None:
        """Keep an answer."""
        self._known[question] = answer
        keep_line(self.path, [question, answer])
