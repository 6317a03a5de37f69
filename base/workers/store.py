"""Store the results of tasks beside the result of a run: a stopped run continues, and other runs use them too."""

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from eskin.base.files import digest
from eskin.base.outputs import check_file, is_stream


def store_of(out: Path) -> Path:
    """Return the path of the store of a run that writes to ``out``."""
    return out.with_name(f".{out.name}.store")


class Store:
    """Results by name, which JSON can hold. Without a file nothing is stored.

    A name contains configuration and data, and ``code`` is a digest of the computation: results of other code are
    computed again. Every result is a line of the file, so that runs at the same time can share it, and damaged lines
    are left out.
    """

    def __init__(self, out: Path | None, code: str) -> None:
        if out:
            check_file(out)
        self.path, self.code = store_of(out) if out and not is_stream(out) else None, code
        self._results: dict[str, Any] = {}
        self._end = 0  # bytes of the file that were read

    def __contains__(self, name: str) -> bool:
        self._read()
        return name in self._results

    def __getitem__(self, name: str) -> Any:
        return self._results[name]

    def of(self, name: str, make: Callable[[], Any]) -> Any:
        """Return a result by name, or compute and store it."""
        return self[name] if name in self else self.add(name, make())

    def add(self, name: str, result: Any) -> Any:
        """Store a result under a name and return it."""
        self._results[name] = result
        if self.path:
            entry = {"name": name, "code": self.code, "result": result}
            with self.path.open("ab") as file:  # the first line end completes a line that a crash has cut
                file.write(f"\n{json.dumps({'seal': digest(entry)} | entry)}\n".encode())
        return result

    def _read(self) -> None:
        """Read the lines that this run or others have written since the last time."""
        if self.path is None or not self.path.exists() or self.path.stat().st_size == self._end:
            return
        with self.path.open("rb") as file:
            file.seek(self._end)
            lines, end, _ = file.read().rpartition(b"\n")
        self._end += len(lines) + len(end)
        for line in lines.splitlines():
            with contextlib.suppress(ValueError, RecursionError):
                entry = json.loads(line)
                if isinstance(entry, dict) and entry.pop("seal", "") == digest(entry) and entry["code"] == self.code:
                    self._results[entry["name"]] = entry["result"]
