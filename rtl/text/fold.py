"""Make Verilog readable: substitute Yosys' intermediate wires into the expressions that use them."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from eskin.rtl.text import expression
from eskin.rtl.text.expression import Node, UnknownTextError, Wire

MADE_UP = re.compile(r"\b_\d+_\b")
"""Names that Yosys made up; no signal in the source has them."""

PART = "part"
"""Remaining wires of Yosys are named ``<signal that they are part of>_part``, with a number from the second on."""

DECLARATION = re.compile(r"^  (?:(?:input|output) )?(?:wire|reg) (signed )?(?:\[(\d+):0\] )?(\w+);$")
DRIVEN = re.compile(r"^(  assign |    (?:else )?(?:if \((.*)\) )?)(\w+)((?:\[[\d:]+\])?)( <?= )(.*);$")
"""An assignment, or the line of a register, perhaps with its condition."""
PORT = re.compile(r"^(    \.\w+\()(.*)(\),?)$")
WORD = re.compile(r"(?<![\w$'.])[A-Za-z_]\w*")

LONGEST = 100
"""Characters of a line; longer lines are broken behind an operator."""

BREAKS = tuple(f"{operator} " for operator in ("|", "&", "^", "?", ":", "+", "-", "<=", ","))

MAX_NAMES = 4
"""Most names in an expression that replaces its wire wherever the wire is used."""


@dataclass
class Line:
    """A line of Verilog and its expressions."""

    text: str
    """The text with a zero character in the place of every expression."""
    trees: list[tuple[Node, int]] = field(default_factory=list)
    """The expressions, each with the width of what takes it; 0 where it keeps its own."""
    target: str = ""
    """The wire that the line assigns, else empty."""
    bits: str = ""
    """The range of the target, if the line does not assign all of it."""

    @property
    def whole_target(self) -> str:
        """Wire assigned as a whole by the line, or an empty text."""
        return "" if self.bits else self.target

    @property
    def words(self) -> list[str]:
        """Names used in the line, including repetitions."""
        if self.trees:
            return [name for tree, _ in self.trees for name in expression.names(tree)]
        return [] if DECLARATION.match(self.text) else WORD.findall(self.text)


def fold(module: str) -> str:
    """Return the text of a module without wires that only hold intermediate results.

    A wire that Yosys made up is replaced by its expression where the rules of Verilog on widths and signs give the
    same value there, and where it is used once, or is one operator on names.
    """
    module = _narrowed(module)
    wires = {
        found[3]: Wire(int(found[2] or 0) + 1, bool(found[1]))
        for found in map(DECLARATION.match, module.splitlines())
        if found
    }
    lines = _in_order([_parse(text, wires) for text in module.splitlines()])
    text = _renamed("\n".join(_Folder(lines, wires).lines()))
    return "".join(broken(line) + "\n" for line in _with_ports(_declared(text.splitlines())))


def _with_ports(lines: list[str]) -> list[str]:
    """Return the lines of a module with the declarations of its ports in the list of its ports."""
    start = next(number for number, line in enumerate(lines) if line.startswith("module "))
    end = next(number for number, line in enumerate(lines) if line.endswith(");"))  # Yosys breaks a long list
    name, _, names = "".join(lines[start : end + 1]).removesuffix(");").partition("(")
    ports = [line for line in lines if line.startswith(("  input", "  output"))]
    declared = {line.removesuffix(";").rpartition(" ")[2]: line.removesuffix(";") for line in ports}
    listed = ",\n".join(declared[port] for port in names.split(", ")).splitlines()
    return [*lines[:start], f"{name}(", *listed, ");", *(line for line in lines[end + 1 :] if line not in ports)]


def _declared(lines: list[str]) -> list[str]:
    """Return lines reordered so that every declaration precedes its uses.

    Verilator and Yosys take both orders; the language, and slang, do not.
    """
    uses: dict[str, int] = {}
    early: list[tuple[float, int]] = []
    for number, line in enumerate(lines):
        found = None if line.startswith(("  input", "  output")) else DECLARATION.match(line)
        for name in [] if found else WORD.findall(line):
            uses.setdefault(name, number)
        early.append((uses.get(found[3], number + 0.5) - 0.5 if found else number, number))
    return [lines[number] for _, number in sorted(early)]


def broken(line: str) -> str:
    """Return a line, wrapped after operators and commas if it is too long."""
    indent = " " * (len(line) - len(line.lstrip()))
    rows, unit = [indent], ""
    words = line.split()
    for number, word in enumerate(words, 1):
        unit += word + " "
        if number < len(words) and not unit.endswith(BREAKS):
            continue
        if len(rows[-1]) + len(unit) - 1 > LONGEST and rows[-1] != indent:
            rows.append(indent + "    ")
        rows[-1] += unit
        unit = ""
    return "\n".join(row.rstrip() for row in rows)


def _narrowed(module: str) -> str:
    """Return a module in which wires created by Yosys have only the bits that are used."""
    for name in dict.fromkeys(MADE_UP.findall(module)):
        driven = re.compile(rf"^  assign {name}\[(?:\d+:)?(\d+)\] = .*;\n", re.MULTILINE)
        used = driven.sub("", re.sub(rf"^  assign {name}\b", "  assign", module, flags=re.MULTILINE))
        _, *parts = re.findall(rf"\b{name}\b((?:\[[\d:]+\])?)", used)
        if not parts:  # a constant that nothing takes
            module = re.sub(rf"^  wire .*\b{name};\n", "", driven.sub("", module), flags=re.MULTILINE)
        if parts == [""]:  # an output of an instance that nothing takes
            unused = rf"^    (\.\w+)\({name}\)"
            if re.search(unused, module, re.MULTILINE):
                module = re.sub(rf"^  wire .*\b{name};\n", "", module, flags=re.MULTILINE)
                module = re.sub(unused, r"    \1()", module, flags=re.MULTILINE)
        if not parts or "" in parts:
            continue
        high = max(int(re.findall(r"\d+", part)[0]) for part in parts)
        bits = f"[{high}:0] " if high else ""
        module = driven.sub(lambda found, high=high: "" if int(found[1]) > high else found[0], module)  # type: ignore[misc]
        module = re.sub(rf"^  wire \[\d+:0\] {name};", f"  wire {bits}{name};", module, flags=re.MULTILINE)
        module = module.replace(f"{name}[{high}:0]" if high else f"{name}[0]", name)
    return module


def _parse(text: str, wires: dict[str, Wire]) -> Line:
    """Return a line with its parsed expressions; without expressions if parsing fails."""

    def parsed(text: str) -> Node:
        tree = expression.read(text)
        expression.width(tree, wires)  # every name is known
        return tree

    try:
        found = DRIVEN.match(text)
        if found and (found[1] == "  assign ") == (found[5] == " = "):
            head, condition, target, bits, operator, value = found.groups()
            trees = [(parsed(value), expression.width(parsed(target + bits), wires))]
            if condition:
                trees.insert(0, (parsed(condition), 0))
                head = head.replace(f"({condition})", "(\0)", 1)
            return Line(f"{head}{target}{bits}{operator}\0;", trees, target, bits)
        if found := PORT.match(text):
            return Line(f"{found[1]}\0{found[3]}", [(parsed(found[2]), 0)])
    except (UnknownTextError, KeyError):
        pass
    return Line(text)


def _in_order(lines: list[Line]) -> list[Line]:
    """Return lines with the assignments to parts of a wire grouped, lowest bits first."""
    first: dict[str, int] = {}

    def place(numbered: tuple[int, Line]) -> tuple[int, int]:
        number, line = numbered
        if not (line.bits and line.text.startswith("  assign")):
            return number, 0
        return first.setdefault(line.target, number), int(re.findall(r"\d+", line.bits)[-1])

    return [line for _, line in sorted(enumerate(lines), key=place)]


class _Folder:
    """The lines of a module, and the intermediate wires that can be substituted."""

    def __init__(self, lines: list[Line], wires: dict[str, Wire]) -> None:
        self.given = lines
        self.wires = wires
        uses = Counter(word for line in lines for word in line.words)
        self.steps: dict[str, Node] = {}
        for line in lines:
            name = line.whole_target
            if MADE_UP.fullmatch(name) and line.trees and line.text.startswith("  assign") and not wires[name].signed:
                self.steps[name] = line.trees[0][0]
        for name in list(self.steps):
            if uses[name] > 1 and self._names(self.steps[name]) > MAX_NAMES:
                del self.steps[name]
        self.joined = _Joined([line for line in lines if line.bits and line.trees], wires)

    def lines(self) -> Iterator[str]:
        """Yield the remaining lines, simplified for readers."""
        lines = [
            replace(line, trees=[(self._folded(tree, size, whole=size > 0), size) for tree, size in line.trees])
            for line in self.given
        ]
        definitions = {line.target: line for line in lines if line.whole_target in self.steps}
        kept: set[str] = set()
        needed = [line for line in lines if line.whole_target not in self.steps]
        while needed:
            found = (definitions.keys() & needed.pop().words) - kept
            kept |= found
            needed += [definitions[name] for name in found]
        gone = self.steps.keys() - kept
        for line in lines:
            declared = DECLARATION.match(line.text)
            if line.whole_target in gone or (declared and declared[3] in gone):
                continue
            head, *tails = line.text.split("\0")
            words = (
                expression.write(self.joined.named(expression.plain(tree, self.wires), line.target))
                for tree, _ in line.trees
            )
            yield head + "".join(word + tail for word, tail in zip(words, tails, strict=True))

    def _names(self, tree: Node) -> float:
        """Return the number of names in a logic expression after substitution; infinite for arithmetic."""
        if tree.kind == "name" and tree.text in self.steps:
            return self._names(self.steps[tree.text])
        if tree.kind in ("name", "slice"):
            return math.inf if MADE_UP.fullmatch(tree.text) else 1
        compares_with_number = tree.text in expression.COMPARISONS and tree.parts[1].kind == "number"
        logic = tree.kind in ("unary", "join") or tree.text in expression.BITWISE or compares_with_number
        if tree.kind != "number" and (not logic or tree.text in ("-", "+")):
            return math.inf
        return sum(map(self._names, tree.parts))

    def _folded(self, node: Node, size: int, *, whole: bool) -> Node:
        """Return an expression with intermediate wires substituted.

        Its surroundings extend the expression to ``size`` bits, or not if 0. ``whole``: it is all that is assigned.
        """
        if node.kind == "name" and node.text in self.steps and self._fits(node.text, size, whole=whole):
            return self._folded(self.steps[node.text], size, whole=whole)
        around = expression.contexts(node, size, self.wires)
        parts = (self._folded(part, bits, whole=False) for part, bits in zip(node.parts, around, strict=True))
        return replace(node, parts=tuple(parts))

    def _fits(self, name: str, size: int, *, whole: bool) -> bool:
        """Return True if a wire can be substituted without changing the value of the expression."""
        tree, bits = self.steps[name], self.wires[name].width
        if whole:
            return size == bits
        if expression.width(tree, self.wires) != bits:
            return False
        if size == 0:
            return True
        return not expression.signed(tree, self.wires) and (size == bits or expression.extends_by_zeros(tree))


class _Joined:
    """Wires made of bits of other wires, as names for concatenations; ``parts`` are the lines that assign them."""

    def __init__(self, parts: list[Line], wires: dict[str, Wire]) -> None:
        self.wires = wires
        self.bits: dict[str, list[Bit]] = {}
        for line in parts:
            tree = line.trees[0][0]
            bits = _bits_of(tree, wires)
            if bits is None:
                continue
            low = int(re.findall(r"\d+", line.bits)[-1])
            own = self.bits.setdefault(line.target, [(line.target, i) for i in range(wires[line.target].width)])
            own[low : low + len(bits)] = bits

    def named(self, node: Node, target: str) -> Node:
        """Return an expression in which a concatenation of bits is replaced by the name of its wire."""
        node = replace(node, parts=tuple(self.named(part, target) for part in node.parts))
        bits = _bits_of(node, self.wires) if node.kind == "join" else None
        if bits is None:
            return node
        for name, own in self.bits.items():
            if name == target or not any(part.text == name for part in node.parts):
                continue
            for low in range(len(own) - len(bits) + 1):
                if own[low : low + len(bits)] == bits:
                    whole = len(bits) == self.wires[name].width
                    return Node("name", name) if whole else Node("slice", name, (), low + len(bits) - 1, low)
        return node


Bit = tuple[str, int]
"""A wire and the number of a bit in it; a constant bit has no name."""


def _bits_of(node: Node, wires: dict[str, Wire]) -> list[Bit] | None:
    """Return the bits of an expression, lowest first, if it consists only of wire bits and constants."""
    if node.kind == "name":
        return [(node.text, i) for i in range(wires[node.text].width)]
    if node.kind == "slice":
        return [(node.text, i) for i in range(node.low, node.high + 1)]
    if node.kind == "number" and (found := re.fullmatch(r"(\d+)'h([0-9a-f]+)", node.text)):
        return [("", int(found[2], 16) >> i & 1) for i in range(int(found[1]))]
    if node.kind != "join":
        return None
    bits: list[Bit] = []
    for part in reversed(node.parts):
        some = _bits_of(part, wires)
        if some is None:
            return None
        bits += some
    return bits


def _renamed(module: str) -> str:
    """Return a module in which signal names replace the remaining names from Yosys."""
    user: dict[str, str] = {}
    for line in module.splitlines():
        target = re.match(r"\s+(?:assign |(?:else )?(?:if \(.*\) )?)(\w+)(?:\[[\d:]+\])? <?= ", line)
        for name in MADE_UP.findall(line.partition("= ")[2] if target else line):
            if target and name != target[1]:
                user.setdefault(name, target[1])
            if target and "(" in line.partition(" <= ")[0]:
                user.setdefault(name, target[1])
    taken = set(WORD.findall(module))
    plain: dict[str, str] = {}
    for name in dict.fromkeys(MADE_UP.findall(module)):
        base, seen = name, {name}
        while MADE_UP.fullmatch(base) and user.get(base) not in (None, *seen):
            base = user[base]
            seen.add(base)
        base = "logic" if MADE_UP.fullmatch(base) else base
        candidate, number = f"{base}_{PART}", 1
        while candidate in taken:
            number += 1
            candidate = f"{base}_{PART}_{number}"
        taken.add(candidate)
        plain[name] = candidate
    return MADE_UP.sub(lambda found: plain[found[0]], module)
