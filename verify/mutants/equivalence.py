"""Prove mutated modules equivalent to the original."""

import json
import re
import time
from collections.abc import Mapping
from pathlib import Path

from eskin.verify.proofs.engine import CONVERGED, ask

PORT = re.compile(r"^  wire (?:width (\d+) )?(?:signed )?(input|output) \d+ +(?:signed )?\\(\S+)$", re.MULTILINE)

CELL = re.compile(r"^  cell \\(eskin_\w+) ", re.MULTILINE)

DIFFERS = re.compile(r"Output\s+0 was asserted in frame")
"""Message of a difference, from bounded search or proof."""

PROVE_S = 30

GUARDS = {
    "eskin_arbiter": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_readout": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_merge": {f"event_{name}": "event_valid" for name in ("tile", "row", "col", "polarity")},
    "eskin_relay": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_taxel": {"polarity": "request"},
    "eskin_row": {"column_polarity": "column_request"},
    "eskin_pattern": {"column_polarity": "row_request", "column_request": "row_request"},
    "eskin_frame_sequencer": dict.fromkeys(("sample_code", "sample_first", "sample_last"), "sample_valid"),
    "eskin_frame_packer": dict.fromkeys(("word_data", "word_sync"), "word_valid"),
    "eskin_frame_readout": dict.fromkeys(("word_data", "word_sync"), "word_valid"),
    "eskin_spi": {"write_data": "write"},
    "eskin_classifier": {
        f"{kind}_{name}": f"{kind}_valid" for kind in ("hidden", "output") for name in ("index", "potential", "spike")
    },
}
"""Outputs that are valid only while another output is not 0, by module."""

TO_GATES = (
    "read_rtlil readout.il; read_verilog miter.v; hierarchy -check -top miter; proc; flatten; opt_clean; "
    "memory_map; async2sync; formalff -clk2ff -ff2anyinit; setundef -init -zero; setundef -undriven -zero; opt -full; "
    "techmap; opt -fast; simplemap; dffunmap; aigmap; opt_clean; "
    "write_aiger -I -zinit -no-startoffset miter.aig; design -reset; "
)


def ports_of(rtlil: str) -> list[tuple[int, str, str]]:
    """Return width, direction and name of every port of a module."""
    return [(int(bits or 1), way, name) for bits, way, name in PORT.findall(rtlil)]


def miter(module: str, ports: list[tuple[int, str, str]]) -> str:
    """Return a Verilog miter of two modules, with one output that is high if they differ."""
    guards = GUARDS.get(module, {})
    lines = [f"  input [{bits - 1}:0] {name};" for bits, way, name in ports if way == "input"]
    differences, wires = ["1'b0"], {"gold": [], "gate": []}  # type: tuple[list[str], dict[str, list[str]]]
    outputs = {name for _, way, name in ports if way == "output"}
    for bits, way, name in ports:
        for side, wired in wires.items():
            wired.append(f".{name}({name if way == 'input' else f'{side}_{name}'})")
        if way == "output":
            lines += [f"  wire [{bits - 1}:0] gold_{name}, gate_{name};"]
            meant = f"(|gold_{guards[name]}) & " if guards.get(name) in outputs else ""
            differences.append(f"({meant}(gold_{name} != gate_{name}))")
    lines += [f"  {side}_{module} {side}({', '.join(wired)});" for side, wired in wires.items()]
    named = ", ".join([name for _, way, name in ports if way == "input"] + ["bad"])
    body = "\n".join(lines)
    return f"module miter({named});\n  output bad;\n{body}\n  assign bad = {' | '.join(differences)};\nendmodule\n"


def same(module: str, original: Mapping[str, str], mutated: Mapping[str, str]) -> bool | None:
    """Return whether a module behaves equally in two designs after any reset; None if undecided.

    A design is the RTLIL of its modules, by name. The proof takes ``PROVE_S`` seconds at most.
    """
    texts = [
        re.sub(r"^(module|  cell) \\eskin_", rf"\1 \\{side}_eskin_", "\n".join(modules.values()), flags=re.MULTILINE)
        for side, modules in (("gold", original), ("gate", mutated))
    ]
    ports = ports_of(original[module])
    if sorted(ports) != sorted(ports_of(mutated[module])):
        return False
    if not any(way == "output" for _, way, _ in ports):
        raise ValueError(f"{module} has no output to compare")
    commands = ["read_aiger miter.aig", "strash", "bmc3 -a -F 12 -T 10"]
    commands += ["read_aiger miter.aig", "strash", "scorr -C 10000", "dc2", f"pdr -a -T {PROVE_S}"]
    said = ask(TO_GATES, "\n".join(texts), commands, {"miter.v": miter(module, ports).encode()})
    if DIFFERS.search(said):
        return False
    return True if CONVERGED.search(said) else None


def within(module: str, modules: Mapping[str, str]) -> dict[str, str]:
    """Return the RTLIL of a module and its submodules, by name."""
    found: dict[str, str] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        if name not in found:
            found[name] = modules[name]
            todo += CELL.findall(modules[name])
    return found


def difference(original: Path, mutated: Path, limit_s: float) -> str:
    """Return a sentence about the first module that is not proved equal within a time; empty if all are.

    Each file has designs as JSON: the RTLIL of their modules by configuration and name.
    """
    end = time.monotonic() + limit_s
    sides: list[dict[str, dict[str, str]]] = [json.loads(path.read_text()) for path in (original, mutated)]
    proved: set[tuple[str, ...]] = set()
    for config, before in sides[0].items():
        after = sides[1][config]
        if before.keys() != after.keys():
            return f"other modules in {config}"
        for module in (name for name in before if before[name] != after[name]):
            pair = within(module, before), within(module, after)
            if (key := (*pair[0].values(), *pair[1].values())) in proved:
                continue
            if time.monotonic() >= end:
                return "not compared in time"
            if not (answer := same(module, *pair)):
                return f"{module} {'differs' if answer is False else 'is not proved to be the same'} in {config}"
            proved.add(key)
    return ""
