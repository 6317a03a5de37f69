"""Read Verilator's coverage counts: lines, branches and toggles of every module, and added points."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

KINDS = {"v_line": "line", "v_branch": "branch", "v_expr": "condition", "v_toggle": "toggle", "v_user": "point"}
MODULE = re.compile(r"^module (\w+)\s*\(.*?^endmodule$", re.MULTILINE | re.DOTALL)
POINT = re.compile(r"^ {2}(point_\w+): cover property .*\n", re.MULTILINE)
FIELD = re.compile(r"\x01([^\x02]+)\x02([^\x01]*)")
TERM = re.compile(r"\w+(?:\[\d+\])?==\d")
ASSIGNED = re.compile(r"(\w+)(?:\[[^]]*\])? (?:<=|=) ")
COUNT = re.compile(r"^C '(.*)' (\d+)$", re.MULTILINE)


@dataclass(frozen=True, order=True)
class Construct:
    """A coverable construct in a module: a line, a branch, a condition, a toggle or a point."""

    kind: str  # ``line``, ``branch``, ``condition``, ``toggle`` or ``point``
    module: str
    text: str  # digest of the module's text: designs in which it is the same share its constructs
    # within the module, from 1 on
    line: int
    column: int
    what: str  # which of the place's constructs: ``elsif``, ``cond_else``, ``sample[3]:0->1``
    source: str  # the line of the text

    @property
    def signals(self) -> set[str]:
        """Names of the signals in the construct."""
        if self.kind == "toggle":
            bit = self.what.partition(":")[0]
            name = bit.partition("[")[0]
            declared = re.search(rf"(\[\d+:\d+\]) {name}\b", self.source)
            return {bit, name, f"{name}{declared[1] if declared else ''}"}
        if self.kind == "condition":
            terms = TERM.findall(self.what)
            return {*terms, *(re.split(r"\[|==", term)[0] for term in terms)}
        assigned = ASSIGNED.search(self.source)
        return {assigned[1]} if assigned else set()

    @property
    def operator(self) -> str:
        """Edge of a toggle, ``0->1``; result of a condition, ``=> 0``; else Verilator's name of the construct."""
        if self.kind == "toggle":
            return self.what.rpartition(":")[2]
        return f"=> {self.what.rpartition(' => ')[2]}" if self.kind == "condition" else self.what

    @property
    def said(self) -> str:
        """Description of the construct for a report."""
        return f"{self.kind} {self.module}:{self.line} {self.what}  | {self.source}"


@dataclass(frozen=True)
class Module:
    """A Verilog module: name, first line, digest and lines."""

    name: str
    first: int
    digest: str
    lines: tuple[str, ...]


def modules(verilog: str) -> list[Module]:
    """Return the modules of a Verilog text."""
    found = []
    for match in MODULE.finditer(verilog):
        first = verilog.count("\n", 0, match.start()) + 1
        own = hashlib.sha256(POINT.sub("", match[0]).encode()).hexdigest()[:12]
        found.append(Module(match[1], first, own, tuple(match[0].split("\n"))))
    return found


def read(counts: str, verilog: str, file: str) -> Counter[Construct]:
    """Return the number of times that each construct of a Verilog text was covered.

    ``counts`` is Verilator's ``coverage.dat``: lines ``C 'key' count``, whose key has names and values set off by the
    characters 1 and 2. What belongs to another file than ``file`` is left out.
    """
    lines = {module.first + n: (module, line) for module in modules(verilog) for n, line in enumerate(module.lines)}
    found: Counter[Construct] = Counter()
    for key, count in COUNT.findall(counts):
        fields = dict(FIELD.findall(key))
        if Path(fields["f"]).name != file:
            continue
        kind = KINDS[fields["page"].partition("/")[0]]
        number = int(fields["l"])
        module, source = lines[number]
        place = number - module.first + 1, int(fields["n"])
        found[Construct(kind, module.name, module.digest, *place, fields["o"], source.strip())] += int(count)
    return found


def with_points(verilog: str, points: Iterable[tuple[str, str, str]]) -> str:
    """Return a Verilog text with cover statements added at the end of its modules.

    A point is (module, label, expression). The expression, over names of the module in Verilog, holds at a rising edge
    of the clock where the point is reached.
    """
    put: dict[str, str] = {}
    for module, label, expression in points:
        put[module] = put.get(module, "") + f"  point_{label}: cover property (@(posedge clk) {expression});\n"
    return extended(verilog, put)


def extended(verilog: str, put: Mapping[str, str]) -> str:
    """Return a Verilog text with more lines at the end of its modules, by module."""
    if missing := put.keys() - {match[1] for match in MODULE.finditer(verilog)}:
        raise ValueError(f"the Verilog has no module {', '.join(missing)}")
    return MODULE.sub(lambda m: m[0].removesuffix("endmodule") + put.get(m[1], "") + "endmodule", verilog)
