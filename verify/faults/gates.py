"""A design as gates and flops, simulated with 64 runs per word, with different inputs and bit flips."""

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.rtl import yosys

DUT = "dut"
"""Instance of the block under test."""

# Flattened last: then a flop's name says in which block it is.
TO_GATES = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc; opt_clean; memory_map; async2sync; opt -full; techmap; "
    "opt -fast; simplemap; dffunmap; simplemap; opt_clean; flatten -noscopeinfo; setattr -unset init w:*; opt_expr; "
    "opt_clean; write_json gates.json"
)
PATH = re.compile(r"\\(\w+)\.")
KINDS = {"$_AND_": 0, "$_OR_": 1, "$_XOR_": 2, "$_XNOR_": 3, "$_NOT_": 4, "$_MUX_": 5, "$_BUF_": 6}
PINS = "ABS"
ZERO, ONE = 0, 1
"""Numbers of the nets with the constants 0 and 1, which are the first two nets."""

LANES = 64 * 16
"""Runs that are computed together, 64 in a word: then the nets of a small array stay in the cache."""

Flips = list[tuple[int, str]]
"""Clock and flop of the bit flip of each run."""


@dataclass(frozen=True)
class Gates:
    """Gate-level design with one clock; nets are numbered constants, inputs, flops and gates."""

    # nets of the ports, lowest bit first
    inputs: dict[str, list[int]]
    outputs: dict[str, list[int]]
    flops: list[str]  # names, each with its place in the hierarchy: ``row_0.taxel_1.pending``, with ``[bit]`` in a word
    first_flop: int  # net of the first flop; they follow each other
    next: NDArray[np.int32]  # nets that the flops take at a rising edge, shape (flops,)
    gates: NDArray[np.int32]  # kind and inputs, shape (gates, 4); their outputs are the last nets, in this order


def gates_of(rtlil: str, top: str) -> Gates:
    """Return the gate-level design for RTLIL."""
    module = json.loads(yosys.run(TO_GATES.format(top=top), rtlil, "gates.json"))["modules"][top]
    net_of: dict[Any, int] = {"0": ZERO, "1": ONE, "x": ZERO}
    ports = module["ports"]
    for port in ports.values():
        if port["direction"] == "input":
            for bit in port["bits"]:
                net_of[bit] = len(net_of) - 1  # "x" has no net of its own
    first_flop = len(net_of) - 1
    drivers: dict[int, tuple[int, list[Any]]] = {}
    after: list[Any] = []
    states: list[int] = []
    places: dict[int, str] = {}
    for name, cell in module["cells"].items():
        pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
        if cell["type"] == "$_DFF_P_":
            states.append(pins["Q"])
            after.append(pins["D"])
            places[pins["Q"]] = "".join(f"{part}." for part in PATH.findall(name))
        elif cell["type"] in KINDS:
            drivers[pins["Y"]] = KINDS[cell["type"]], [pins[pin] for pin in PINS if pin in pins]
        else:
            raise AssertionError(f"cell {cell['type']} of {top} is not supported")
    names = _names(module, places)
    order = sorted(range(len(states)), key=lambda place: _natural(names[states[place]]))
    for place in order:
        net_of[states[place]] = len(net_of) - 1
    sorter = TopologicalSorter({out: [bit for bit in given if bit in drivers] for out, (_, given) in drivers.items()})
    rows = []
    for out in sorter.static_order():
        kind, given = drivers[out]
        rows.append([kind, *(net_of[bit] for bit in given), *[ZERO] * (3 - len(given))])
        net_of[out] = len(net_of) - 1
    directed: dict[str, dict[str, list[int]]] = {"input": {}, "output": {}}
    for name, port in ports.items():
        directed[port["direction"]][name] = [net_of[bit] for bit in port["bits"]]
    return Gates(
        inputs=directed["input"],
        outputs=directed["output"],
        flops=[names[states[place]] for place in order],
        first_flop=first_flop,
        next=np.array([net_of[after[place]] for place in order], np.int32),
        gates=np.array(rows, np.int32).reshape(-1, 4),
    )


def _names(module: dict[str, Any], places: dict[int, str]) -> dict[int, str]:
    """Return the name of every flop from its block and wire."""
    found: dict[int, tuple[int, str]] = {}
    for name, net in module["netnames"].items():
        for number, bit in enumerate(net["bits"]):
            place = places.get(bit)
            if place is not None and not net["hide_name"] and "$" not in name and name.startswith(place):
                said = f"{name}[{number}]" if len(net["bits"]) > 1 else name
                found[bit] = min(found.get(bit, (99, "")), (name.count("."), said))
    return {bit: found[bit][1] if bit in found else f"{place}flop {bit}" for bit, place in places.items()}


def _natural(name: str) -> tuple[Any, ...]:
    """Return a sort key that orders numbers in names by value."""
    parts = name.replace("[", ".[.").replace("]", "").replace("_", "._.").split(".")
    return tuple((part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts)


def simulate(
    gates: Gates, inputs: dict[str, NDArray[np.uint8]], upsets: NDArray[np.int64], runs: int = LANES
) -> dict[str, NDArray[np.int64]]:
    """Simulate up to ``LANES`` runs in parallel; return every output port as a number, shape (clocks, runs).

    ``inputs`` has the bits of every input port but the clock, lowest first: shape (clocks, bits) for all runs alike, or
    (clocks, bits, LANES). ``upsets``, shape (upsets, 3), has clock, flop and run in rising order of clocks: the flop's
    value is turned just before that clock.
    """
    words = -(-runs // 64)
    rows, nets = [], []
    for name, bits in gates.inputs.items():
        if name != "clk":
            assert inputs[name].shape[1] == len(bits), f"{name} has {len(bits)} bits, not {inputs[name].shape[1]}"
            nets += bits
            rows.append(_packed(inputs[name], words))
    driven = np.concatenate(rows, axis=1)
    seen = [bit for bits in gates.outputs.values() for bit in bits]
    recorded = np.zeros((len(driven), len(seen), words), np.uint64)
    given = (np.array(nets, np.int64), driven)
    _run(gates.gates, gates.next, gates.first_flop, given, upsets, (np.array(seen, np.int64), recorded))
    found, start = {}, 0
    for name, bits in gates.outputs.items():
        found[name] = np.zeros((len(driven), runs), np.int64)
        for place in range(len(bits)):
            packed = np.ascontiguousarray(recorded[:, start + place]).view(np.uint8)
            found[name] |= np.unpackbits(packed, axis=1, count=runs, bitorder="little").astype(np.int64) << place
        start += len(bits)
    return found


def upset_runs(
    gates: Gates, inputs: dict[str, NDArray[np.uint8]], clocks: Iterable[int], flops: Iterable[int]
) -> Iterator[tuple[Flips, dict[str, NDArray[np.int64]]]]:
    """Simulate a bit flip of each given flop in each given clock, one per run; run 0 has no bit flip.

    Yield clock and name of the flop for the runs 1, 2, ..., and the outputs, each of shape (clocks, runs).
    """
    flops = list(flops)
    todo = [(clock, flop) for clock in clocks for flop in flops]
    driven = {name: bits for name, bits in inputs.items() if name in gates.inputs}
    for start in range(0, len(todo), LANES - 1):
        part = todo[start : start + LANES - 1]
        turned = np.array([(clock, flop, lane) for lane, (clock, flop) in enumerate(part, 1)], np.int64)
        named = [(clock, gates.flops[flop].removeprefix(f"{DUT}.")) for clock, flop in part]
        yield named, simulate(gates, driven, turned, len(part) + 1)


def last_clock(happens: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the last clock with activity in each run, or -1."""
    return np.where(happens.any(axis=0), len(happens) - 1 - happens[::-1].argmax(axis=0), -1)


def _packed(bits: NDArray[np.uint8], words: int) -> NDArray[np.uint64]:
    """Pack the bits of the runs into words of 64 runs each; return shape (clocks, bits, words)."""
    if bits.ndim == 2:
        return np.where(bits[:, :, None] != 0, ~np.uint64(0), np.uint64(0)).repeat(words, axis=2)
    return np.packbits(bits, axis=2, bitorder="little").view("<u8")


@njit(cache=True, nogil=True)
def _run(gates, after, first_flop, driven, upsets, seen):  # type: ignore[no-untyped-def]
    """Simulate all clocks and record the outputs."""
    inputs, given = driven
    outputs, recorded = seen
    flops, words = len(after), recorded.shape[2]
    first_gate = first_flop + flops
    nets = np.zeros((first_gate + len(gates), words), np.uint64)
    held = np.zeros((flops, words), np.uint64)
    one = np.uint64(1)
    nets[1] = ~np.uint64(0)
    upset = 0
    for t in range(len(given)):
        while upset < len(upsets) and upsets[upset, 0] == t:
            lane = upsets[upset, 2]
            nets[first_flop + upsets[upset, 1], lane // 64] ^= one << np.uint64(lane % 64)
            upset += 1
        for i in range(len(inputs)):  # word by word: rows assigned whole take Numba seconds to compile
            for w in range(words):
                nets[inputs[i], w] = given[t, i, w]
        for g in range(len(gates)):
            kind, a, b, c = gates[g, 0], nets[gates[g, 1]], nets[gates[g, 2]], nets[gates[g, 3]]
            out = nets[first_gate + g]
            for w in range(words):
                if kind == 0:
                    out[w] = a[w] & b[w]
                elif kind == 1:
                    out[w] = a[w] | b[w]
                elif kind == 2:
                    out[w] = a[w] ^ b[w]
                elif kind == 3:
                    out[w] = ~(a[w] ^ b[w])
                elif kind == 4:
                    out[w] = ~a[w]
                elif kind == 5:
                    out[w] = (a[w] & ~c[w]) | (b[w] & c[w])
                else:
                    out[w] = a[w]
        for i in range(len(outputs)):
            for w in range(words):
                recorded[t, i, w] = nets[outputs[i], w]
        for f in range(flops):
            for w in range(words):
                held[f, w] = nets[after[f], w]
        for f in range(flops):
            for w in range(words):
                nets[first_flop + f, w] = held[f, w]
