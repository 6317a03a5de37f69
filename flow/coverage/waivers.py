"""What no run reaches, each with the reason: patterns in ``waivers.toml``, and the proofs that some of them ask for."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from flow.coverage.constructs import MODULE, Construct
from model.errors import InputError
from rtl import yosys

FILE = Path(__file__).with_name("waivers.toml")
READ = "read_verilog -sv design.v; hierarchy -top {module}; proc; memory; flatten; async2sync; opt_clean; "
PROVE = "sat -tempinduct -maxsteps {steps} -seq 1 -set-at 1 rst 1 {claims} {module}"
STEPS = 3
SUCCESS = "Induction step proven: SUCCESS!"


@dataclass(frozen=True)
class Waiver:
    """A reason why constructs are not reached.

    Attributes
    ----------
    pattern : str
        Regular expression of the whole ``KIND MODULE WHAT`` of a construct.
    reason : str
    proof : bool
        Whether it is proved of every construct by induction, in its module alone and for any inputs, that it is never
        reached: a toggle's bit never changes, a condition never comes.
    source : str
        Regular expression of something within the construct's line, to tell it from others.
    """

    pattern: str
    reason: str
    proof: bool = False
    source: str = ""

    def explains(self, construct: Construct) -> bool:
        """Return whether it speaks of a construct."""
        text = f"{construct.kind} {construct.module} {construct.what}"
        return re.fullmatch(self.pattern, text) is not None and re.search(self.source, construct.source) is not None


def waivers(text: str | None = None) -> list[Waiver]:
    """Return the waivers of a file's text, by default those of the project.

    Raises
    ------
    InputError
        If one is not whole.
    """
    listed = tomllib.loads(FILE.read_text() if text is None else text).get("waiver", [])
    try:
        found = [Waiver(**entry) for entry in listed]
    except TypeError as wrong:
        raise InputError(f"a waiver has pattern, reason, and perhaps proof and source: {wrong}") from None
    for waiver in found:
        if not waiver.reason.strip():
            raise InputError(f"the waiver of {waiver.pattern!r} gives no reason; say why it is not reached")
    return found


def explained(
    unreached: Iterable[Construct], listed: Iterable[Waiver]
) -> tuple[dict[Construct, Waiver], list[Construct], list[Waiver]]:
    """Return what is explained and by what, what is not, and the waivers that explain nothing."""
    found: dict[Construct, Waiver] = {}
    rest = []
    listed = list(listed)
    for construct in unreached:
        waiver = next((one for one in listed if one.explains(construct)), None)
        if waiver is None:
            rest.append(construct)
        else:
            found[construct] = waiver
    return found, rest, [waiver for waiver in listed if waiver not in found.values()]


def claim(construct: Construct, once: bool) -> str:
    """Return an expression that is never true if a construct can never be reached.

    Parameters
    ----------
    construct : Construct
        A toggle or a condition.
    once : bool
        Of a toggle: whether its bit has become 1, as a bit that is always 1 does at the beginning of a simulation.
    """
    if construct.kind == "toggle":
        bit = construct.what.partition(":")[0]
        return f"~{bit}" if once else bit
    terms = construct.what.partition(" => ")[0]
    return re.sub(r"(\([^()]*\))\[(\d+)\]", r"((\1 >> \2) & 1'b1)", terms)


def unproved(verilog: str, module: str, claims: Mapping[Construct, str]) -> list[Construct]:
    """Return those constructs whose claims are not proved for a module with any inputs, from a reset on."""
    if not claims:
        return []
    numbered = list(claims.items())
    wires = [f"  (* keep *) wire never_{number} = |({text});\n" for number, (_, text) in enumerate(numbered)]

    def with_claims(match: re.Match[str]) -> str:
        if match[1] != module:
            return match[0]
        return match[0].removesuffix("endmodule") + "".join(wires) + "endmodule"

    text = {"design.v": MODULE.sub(with_claims, verilog).encode()}
    every = [f"-prove never_{number} 0" for number in range(len(numbered))]
    together = PROVE.format(steps=STEPS, module=module, claims=" ".join(every))
    if len(_proved(module, [together], text)) == 1:
        return []
    alone = _proved(module, [PROVE.format(steps=STEPS, module=module, claims=one) for one in every], text)
    return [construct for number, (construct, _) in enumerate(numbered) if number not in alone]


def _proved(module: str, commands: list[str], text: dict[str, bytes]) -> set[int]:
    """Return the numbers of the proofs that succeed."""
    marked = "; ".join(f"log proof {number}; {command}" for number, command in enumerate(commands))
    log = yosys.run(READ.format(module=module) + marked, "", "yosys.log", text)
    parts = re.split(r"^proof (\d+)$", log, flags=re.MULTILINE)[1:]
    return {int(number) for number, said in zip(parts[::2], parts[1::2], strict=True) if SUCCESS in said}
