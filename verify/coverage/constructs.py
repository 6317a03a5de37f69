"""Read Verilator's coverage counts: lines, branches, conditions, toggles and points of every module."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from eskin.base.files import digest
from eskin.verify.coverage.points.render import MACROS

KINDS = {"v_line": "line", "v_branch": "branch", "v_expr": "condition", "v_toggle": "toggle", "v_user": "point"}
MODULE = re.compile(r"^module (\w+)\s*\(.*?^(?=endmodule$)", re.MULTILINE | re.DOTALL)
FILE = re.compile(r'^`line 1 "(.*)" 0\n', re.MULTILINE)
FIELD = re.compile(r"\x01([^\x02]+)\x02([^\x01]*)")
COUNT = re.compile(r"^C '(.*)' (\d+)$", re.MULTILINE)


@dataclass(frozen=True, order=True)
class Construct:
    """A coverable construct in a module: a line, a branch, a condition, a toggle or a point."""

    kind: str  # ``line``, ``branch``, ``condition``, ``toggle`` or ``point``
    file: str  # module and digest of its text, ``eskin_link.8f2a.v``: designs with the same text share its constructs
    line: int
    column: int
    what: str  # which of the place's constructs: ``elsif``, ``cond_else``, ``sample[3]:0->1``
    source: str  # the line of the text

    @property
    def module(self) -> str:
        """Name of the module."""
        return self.file.partition(".")[0]

    @property
    def said(self) -> str:
        """Description of the construct for a report."""
        return f"{self.kind} {self.module}:{self.line} {self.what}  | {self.source}"


def named(verilog: str, points: Mapping[str, str]) -> str:
    """Return a Verilog text with points, in which Verilator counts every module as a file of its own.

    ``points`` are cover statements by module (``points.render``), which count as a file too. A file is named after its
    text, so equal modules of different designs have equal constructs.
    """
    if missing := points.keys() - {match[1] for match in MODULE.finditer(verilog)}:
        raise ValueError(f"the Verilog has no module {', '.join(missing)}")

    def file(text: str, module: str, suffix: str) -> str:
        return f'`line 1 "{module}.{digest(text)}.{suffix}" 0\n{text}'

    def module(match: re.Match[str]) -> str:
        own = points.get(match[1], "")
        return file(match[0], match[1], "v") + (file(own, match[1], "sv") if own else "")

    return MACROS + MODULE.sub(module, verilog)


def files(verilog: str) -> dict[str, list[str]]:
    """Return the lines of the files in a text of ``named``."""
    parts = FILE.split(verilog)[1:]
    return {name: text.split("\n") for name, text in zip(parts[::2], parts[1::2], strict=True)}


def read(counts: str, verilog: str) -> Counter[Construct]:
    """Return the number of times that each construct in a text of ``named`` was covered.

    ``counts`` is Verilator's ``coverage.dat``: lines ``C 'key' count``, whose key has names and values set off by the
    characters 1 and 2. Other files, as the harness, are left out.
    """
    texts = files(verilog)
    found: Counter[Construct] = Counter()
    for key, count in COUNT.findall(counts):
        fields = dict(FIELD.findall(key))
        if lines := texts.get(fields["f"]):
            kind, line = KINDS[fields["page"].partition("/")[0]], int(fields["l"])
            place = fields["f"], line, int(fields["n"])
            found[Construct(kind, *place, fields["o"], lines[line - 1].strip())] += int(count)
    return found
