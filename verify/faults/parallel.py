"""Simulate a gate-level design with 64 runs per word, with different inputs and bit flips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.verify.faults.bench import DUT
from eskin.verify.faults.gate_design import Gates

WORDS = 16
"""Words of a net that are computed together: 1,024 runs, and the nets of a small array stay in the cache."""
LANES = 64 * WORDS

Flips = list[tuple[int, str]]
"""Clock and flop of the bit flip of each run."""


def simulate(
    gates: Gates, inputs: dict[str, NDArray[np.uint8]], upsets: NDArray[np.int64]
) -> dict[str, NDArray[np.int64]]:
    """Simulate ``LANES`` runs in parallel; return every output port as a number, shape (clocks, runs).

    ``inputs`` has the bits of every input port but the clock, lowest first: shape (clocks, bits) for all runs alike, or
    (clocks, bits, LANES). ``upsets``, shape (upsets, 3), has clock, flop and run in rising order of clocks: the flop's
    value is turned just before that clock.
    """
    clocks = len(next(iter(inputs.values())))
    rows, nets = [], []
    for name, bits in gates.inputs.items():
        if name == "clk":
            continue
        given = inputs[name]
        assert given.shape[1] == len(bits), f"{name} has {len(bits)} bits, not {given.shape[1]}"
        nets += bits
        rows.append(_packed(given))
    driven = np.concatenate(rows, axis=1)
    seen = [bit for bits in gates.outputs.values() for bit in bits]
    recorded = np.zeros((clocks, len(seen), WORDS), np.uint64)
    _run(
        gates.gates,
        gates.next,
        gates.first_flop,
        (np.array(nets, np.int64), driven),
        upsets,
        (np.array(seen, np.int64), recorded),
    )
    found, start = {}, 0
    for name, bits in gates.outputs.items():
        values = np.zeros((clocks, LANES), np.int64)
        for place in range(len(bits)):
            values |= _unpacked(recorded[:, start + place]).astype(np.int64) << place
        found[name], start = values, start + len(bits)
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
        outputs = simulate(gates, driven, turned)
        named = [(clock, gates.flops[flop].removeprefix(f"{DUT}.")) for clock, flop in part]
        yield named, {name: values[:, : len(part) + 1] for name, values in outputs.items()}


def last_clock(happens: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the last clock with activity in each run, or -1."""
    return np.where(happens.any(axis=0), len(happens) - 1 - happens[::-1].argmax(axis=0), -1)


def _packed(bits: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Pack the bits of the runs into words of 64 runs each; return shape (clocks, bits, WORDS)."""
    if bits.ndim == 2:
        return np.where(bits[:, :, None] != 0, ~np.uint64(0), np.uint64(0)).repeat(WORDS, axis=2)
    return np.packbits(bits, axis=2, bitorder="little").view("<u8")


def _unpacked(words: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Unpack words of 64 runs each into one bit for each run; return shape (clocks, LANES)."""
    return np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=1, bitorder="little")


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
