"""Waivers for uncovered constructs (``waivers.toml``), with proofs for the waivers that need them."""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.rtl import yosys
from eskin.verify.coverage.constructs import Construct, extended, modules

READ = (
    "read_verilog -sv design.v; hierarchy -top {module}; proc; memory; "
    "setattr -mod -unset keep_hierarchy; flatten; async2sync; opt_clean; "
)
PROVE = "sat -tempinduct -timeout 20 -maxsteps 3 -seq 1 -set-at 1 rst 1 {claims} {module}"
SUCCESS = "Induction step proven: SUCCESS!"


Names = str | tuple[str, ...]
"""One name or several alternative names; an empty tuple fits every name."""


@dataclass(frozen=True)
class Waiver:
    """Reason why certain constructs are not covered."""

    kind: Names  # ``line``, ``branch``, ``toggle`` or ``condition``
    reason: str
    module: Names = ()
    # signal of a toggle, also with its bit, ``fall[2]``, or its range, ``fall[3:0]``; signal or term of a condition,
    # ``remains[2]==1``; signal that a branch assigns. ``*`` stands for any characters
    signal: Names = ()
    operator: Names = ()  # edge of a toggle (``1->0``), result of a condition (``=> 0``), branch (``cond_else``)
    # whether it is proved of every construct by induction, in its module alone and for any inputs, that it is never
    # reached: a toggle's bit never changes, a condition never comes
    proof: bool = False

    def explains(self, construct: Construct) -> bool:
        """Return True if the waiver applies to a construct."""
        wanted = (self.kind, self.module, self.signal, self.operator)
        names = ({construct.kind}, {construct.module}, construct.signals, {construct.operator})
        return all(map(_fits, wanted, names))


def _fits(wanted: Names, names: Iterable[str]) -> bool:
    """Return True if a name matches a pattern."""
    patterns = (wanted,) if isinstance(wanted, str) else wanted
    regexes = [re.escape(pattern).replace(r"\*", ".*") for pattern in patterns]
    return not regexes or any(re.fullmatch(regex, name) for regex in regexes for name in names)


def waivers() -> list[Waiver]:
    """Return the waivers of the project."""
    listed: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("waivers.toml").read_text())["waiver"]
    for entry in listed:
        entry |= {name: tuple(value) for name, value in entry.items() if isinstance(value, list)}
    return [Waiver(**entry) for entry in listed]


def claim(construct: Construct, once: bool, verilog: str = "") -> str:
    """Return an expression that is never true if a construct is unreachable.

    The construct is a toggle, a condition, or a branch of a choice. ``once`` says that the bit of a toggle has become
    1, as a bit that is always 1 does at the beginning. A condition counts only where its statement in ``verilog`` is
    executed.
    """
    if construct.kind == "toggle":
        bit = construct.what.partition(":")[0]
        return f"~{bit}" if once else bit
    lines = next((m.lines for m in modules(verilog) if (m.name, m.digest) == (construct.module, construct.text)), ())
    if construct.kind == "branch":
        return chosen(lines[construct.line - 1], construct.column, construct.what == "cond_else")
    terms = construct.what.partition(" => ")[0]
    terms = re.sub(r"(\w+)\[\d+:(\d+)\]\[(\d+)\]", lambda m: f"{m[1]}[{int(m[2]) + int(m[3])}]", terms)
    terms = re.sub(r"(\([^()]*\))\[(\d+)\]", r"((\1 >> \2) & 1'b1)", terms)
    return " && ".join([terms, *guards(lines, construct.line, construct.column)])


def chosen(line: str, column: int, other: bool) -> str:
    """Return the condition under which the only ``?:`` of an assignment takes the value at a column.

    Where it is not that simple the expression says that it may come at any time.
    """
    condition = line[: max(line.rfind(" ? ", 0, column), 0)].partition(" = ")[2].strip()
    simple = condition and "?" not in condition and condition.count("(") == condition.count(")")
    return (f"!({condition})" if other else condition) if simple else "1'b1"


def guards(lines: Sequence[str], line: int, column: int) -> list[str]:
    """Return the condition of a statement in an always block, from its ``if`` and ``else if``.

    ``line`` and ``column`` of the module's lines count from 1 on.
    """
    first = next((n for n in range(line, 0, -1) if lines and lines[n - 1].startswith("  always @")), 0)
    if not first or any(";" in text for text in lines[first : line - 1] if not text.lstrip().startswith("if (")):
        return []
    before = "\n".join([*lines[first : line - 1], lines[line - 1][: column - 1]])
    found: list[str] = []
    for start in re.finditer(r"\bif \(", before):
        depth, end = 1, start.end()
        while end < len(before) and depth:
            depth += {"(": 1, ")": -1}.get(before[end], 0)
            end += 1
        if found:  # else
            found[-1] = f"!{found[-1]}"
        if depth:  # the place is within the condition itself
            return found
        found.append(f"({before[start.end() : end - 1]})")
    return [re.sub(r"\s+", " ", guard) for guard in found]


def unproved(verilog: str, module: str, claims: Mapping[Construct, str]) -> list[Construct]:
    """Return the constructs of a module that are not proved unreachable."""
    if not claims:
        return []
    wires = [f"  (* keep *) wire never_{number} = |({text});\n" for number, text in enumerate(claims.values())]
    text = extended(verilog, {module: "".join(wires)})
    every = [f"-prove never_{number} 0" for number in range(len(claims))]
    if _proved(module, [" ".join(every)], text):
        return []
    alone = _proved(module, every, text)
    return [construct for number, construct in enumerate(claims) if number not in alone]


def _proved(module: str, claims: list[str], verilog: str) -> set[int]:
    """Return the indices of the claims that are proved."""
    proofs = [PROVE.format(module=module, claims=claim) for claim in claims]
    marked = "; ".join(f"log proof {number}; {proof}" for number, proof in enumerate(proofs))
    log = yosys.run(READ.format(module=module) + marked, "", "yosys.log", {"design.v": verilog.encode()})
    parts = re.split(r"^proof (\d+)$", log, flags=re.MULTILINE)[1:]
    return {int(number) for number, said in zip(parts[::2], parts[1::2], strict=True) if SUCCESS in said}
