"""Compiled loops of ``eskin.model.taxel``, and the taxel functions of ``eskin.model.readout``.

The loops serve every encoder; ``eskin.model.encoders`` contains the rules.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from eskin.base.files import forget_stale_kernels
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import compiled

forget_stale_kernels(Path(__file__), compiled.sources())

# -- one taxel in one clock --------------------------------------------------------------------------


def taxel_dtype(config: ReadoutConfig) -> np.dtype[np.void]:
    """Return the NumPy type of a taxel record: sample x, reference u, encoder state.

    u is in 2**-fraction_bits codes. ``given`` is the comparators' decision in this clock: 1 for above and 2 for below,
    or -1 to decide by x.
    """
    return np.dtype([(name, np.int64) for name in ("x", "u", *config.encoder.state, "given")])


class Parameters(NamedTuple):
    """The configuration as a tuple for the compiled loops.

    ``reset``, ``top`` and ``bottom`` are the reference after reset and the ends of the scale in 2**-fraction_bits
    codes. ``rule`` is the rule of the encoder, with a host's settings.
    """

    leaks: bool
    per_sample: bool
    digital: bool
    columns: int
    reset: int
    top: int
    bottom: int
    rule: Any

    @classmethod
    def of(cls, config: ReadoutConfig) -> Parameters:
        """Return the loop parameters of a configuration."""
        encoder = config.encoder
        bits = encoder.fraction_bits(config)
        return cls(
            leaks=encoder.leaks,
            per_sample=config.decide_every == "sample",
            digital=config.lookup("frontend", digital=True, analog=False),
            columns=config.columns,
            reset=config.reference_reset << bits,
            top=(config.full_scale << bits) - 1,
            bottom=-config.full_scale << bits,
            rule=encoder.rule(config),
        )


@njit(inline="always")
def decide(p: Any, taxel: Any, looks: bool, tick: bool, leaks: bool) -> tuple[bool, bool, bool]:
    """Compute one decision of a taxel; return ON, OFF, and whether a threshold moved without an event.

    ``looks``: the answers of the comparators count in this clock. ``tick`` and ``leaks`` are true in the clock of a
    sample tick, and of a leak of this taxel.
    """
    on, off = steps(p, taxel) if looks else (False, False)
    moved = compiled.move(p.rule, taxel, on, off, tick, leaks)
    return on, off, moved


@njit(inline="always")
def steps(p: Any, taxel: Any) -> tuple[bool, bool]:
    """Return whether a taxel steps up, and whether it steps down, limited by the full scale."""
    above, below = compiled.compare(p.rule, taxel)
    if taxel.given >= 0:
        above, below = taxel.given & 1 != 0, taxel.given == 2  # if both are given, above counts
    reach = compiled.reach(p.rule, taxel)
    return above and taxel.u + reach <= p.top, below and taxel.u - reach >= p.bottom


@njit(inline="always")
def reset(p: Any, taxel: Any) -> None:
    """Reset a taxel, except the sample of an analog front end."""
    taxel.u = p.reset
    compiled.clear(p.rule, taxel)
    if p.digital:
        taxel.x = 0


# -- all taxels, tick by tick ------------------------------------------------------------------------
# Samples and counts are (ticks, taxels). The inner loops of the encoders have no branches and stay in the type of the
# state (a bare Numba expression would widen to 64 bits), so that they run on vectors. Thresholds are multiples of the
# encoder's grid g: x >= a g and floor(x / g) >= a are the same.


BLOCK_SAMPLES = 2**16


@njit(cache=True, nogil=True)
def magnitude_bits(x: Any) -> Any:
    """Return the OR of x over an array, or of -x - 1 for negative x, to check that all codes fit W bits."""
    code = x.dtype.type
    sign = code(8 * x.itemsize - 1)
    seen = code(0)
    for i in range(x.size):
        seen = code(seen | code(x[i] ^ np.right_shift(x[i], sign)))
    return seen


@njit(cache=True, nogil=True)
def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> Any:
    """Write the event counts of every tick (``Encoder.ticks``); return ``magnitude_bits`` of the samples.

    The samples are taken in blocks, which stay in the cache between the check and the encoder.
    """
    seen = x.dtype.type(0)
    block = max(1, BLOCK_SAMPLES // max(1, x.shape[1]))
    for start in range(0, x.shape[0], block):
        part, stop = x[start : start + block], start + block
        seen |= magnitude_bits(part.reshape(-1))
        compiled.ticks(rule, part, state, phase, tick + start, counts[start:stop], late[start:stop], timed)
    return seen


@njit(cache=True, nogil=True)
def magnitudes(counts: Any) -> Any:
    """Return the sum of |counts| over the ticks, int32 of shape (taxels,)."""
    totals = np.zeros(counts.shape[1], np.int32)
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            totals[j] = np.int32(totals[j] + np.int32(abs(counts[i, j])))
    return totals


@njit(cache=True, nogil=True)
def decode(p: Any, taxels: Any, counts: Any, late: Any, phase: Any, unit: float, reference: Any) -> None:
    """Write the reference at the end of every tick, in codes, by the moves that the encoder made.

    An event that would move the reference off the scale only opens a window. ``taxels`` are in their state after reset,
    with references in units of ``unit`` codes.
    """
    for i in range(counts.shape[0]):
        now = i % p.rule.leak_period
        for j in range(counts.shape[1]):
            n = np.int64(counts[i, j])
            first = -1 if n == 0 or late[i, j] else 0  # -1: the first decision of the tick is no event
            for number in range(first, abs(n)):
                reach, tick = compiled.reach(p.rule, taxels[j]), number == first
                on = number >= 0 and n > 0 and taxels[j].u + reach <= p.top
                off = number >= 0 and n < 0 and taxels[j].u - reach >= p.bottom
                compiled.move(p.rule, taxels[j], on, off, tick, tick and p.leaks and phase[j] == now)
                if number >= 0 and not on and not off:
                    compiled.clear(p.rule, taxels[j])
            reference[i, j] = taxels[j].u * unit
