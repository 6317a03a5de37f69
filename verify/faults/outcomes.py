"""Outcome of a bit flip: changed events, duration, and recovery of the readout."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig
from eskin.model.readout import simulate as simulate_model
from eskin.rtl.readout import Readout
from eskin.verify.faults.bench import bench_gates, inside
from eskin.verify.faults.gates import Flips, last_clock, upset_runs
from eskin.verify.faults.scenario import RESET, Course, codes_of, course, events_of

TAXEL = re.compile(r"row_(\d+)\.taxel_(\d+)\.")
PLACES = (
    (r"(sequencer|packer)\.", "frame_readout"),
    (TAXEL.pattern + r"window\.", "window"),
    (TAXEL.pattern, "taxel"),
    (r"classifier\.(inputs|recurrent|neurons|parameters)\.memory", "weights"),
    *((rf"{block}\.", block) for block in ("arbiter", "link", "fields", "decay_ticks", "merge", "relay", "classifier")),
    *((rf"host\.{block}\.", block) for block in ("spi", "registers", "pattern")),
    (r"host\.", "host"),
    (r"ticks\.", "settable_ticks"),
)
"""Patterns for the names of flops, each with its block; all other flops belong to the readout."""
CLASSES = ("nothing", "own events", "others moved", "others changed", "until written", "never recovers")
"""Classes of effects, from the smallest to the largest. No event differs; events of the flop's own taxel differ; events
of other taxels differ only in time, or also in number or address. The effect lasts until a host writes the settings
again, or the readout does not answer the last swing correctly."""
NOTHING, OWN, MOVED, CHANGED, WRITTEN, NEVER = CLASSES


@dataclass(frozen=True)
class Upset:
    """One bit flip and its outcome."""

    flop: str
    clock: int
    outcome: str  # one of ``CLASSES``
    # from the upset to the last clock in which events of its own taxel, or of others, differ; -1 if none does
    own_clocks: int = -1
    other_clocks: int = -1
    # sample ticks from the upset to the last that others answer by other events; -1 where they never do
    ticks: int = -1
    # events of others that are missing, and that are too many; a wrong address is both. Under load they count what
    # other taxels did later or earlier, too
    lost: int = 0
    added: int = 0
    # whether what was turned is a setting, or a transfer of one: then it may stay until it is written anew
    may_stay: bool = False
    # steps by which the signals of other taxels are wrong for good where a receiver adds events up; -1 for encoders
    # whose reference depends on the way there
    off: int = -1

    @property
    def block(self) -> str:
        """Block that contains the flop."""
        return next((block for pattern, block in PLACES if re.match(pattern, self.flop)), "readout")


class UnlikeModel(AssertionError):
    """Raised if the run without bit flips differs from the model."""


def classify_effects(
    part: Flips, effects: dict[str, NDArray[Any]], place: str = "", /, **fields: NDArray[Any]
) -> Iterator[Upset]:
    """Yield the outcome of each bit flip: the first effect that its run has, or ``NOTHING``.

    ``effects`` has the runs with each effect, from the largest effect on. ``fields`` has other fields of the outcomes
    by run, and ``place`` is put before the names of the flops.
    """
    for lane, (clock, flop) in enumerate(part):
        outcome = next((name for name, runs in effects.items() if runs[lane]), NOTHING)
        yield Upset(place + flop, clock, outcome, **{name: values[lane].item() for name, values in fields.items()})


def since(part: Flips, last: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the clocks from each bit flip to the last clock in which its run differs; -1 if none does."""
    return np.maximum(last - [clock for clock, _ in part], -1)


def upsets(config: ReadoutConfig, calm: bool, slow: int, stride: int, flops: str) -> Iterator[Upset]:
    """Flip every flop of a readout in every clock of a window, one per run; yield the outcomes.

    ``stride`` is the number of clocks from one upset to the next, and ``flops`` a pattern of the names of the flops.
    UnlikeModel is raised if the run without upsets does not give the events of the golden model.
    """
    gates, played = bench_gates(Readout(config), slow), course(config, calm, slow)
    expected = simulate_model(config, played.stimulus)
    clocks = range(RESET, played.last, stride)
    for part, outputs in upset_runs(gates, played.inputs, clocks, inside(gates, flops)):
        codes = codes_of(config, outputs, played.inputs["event_ready"])
        found = events_of(config, codes[:, 0])
        if not len(expected) or not np.array_equal(found[: len(expected)], expected):
            raise UnlikeModel(f"{config.encoding}, {config.link}: the gates do not give the model's events")
        yield from _judged(config, played, calm, codes, part)


def _judged(
    config: ReadoutConfig, played: Course, calm: bool, codes: NDArray[np.int16], part: Flips
) -> Iterator[Upset]:
    """Return the outcomes of runs by comparison with run 0, which has no bit flip."""
    places = [TAXEL.match(flop) for _, flop in part]
    own = np.array([int(at[1]) * config.columns + int(at[2]) if at else -9 for at in places])  # -9: of no taxel
    good, runs = codes[:, :1], codes[:, 1:]
    differs = runs != good
    of_own = (_taxel(runs) == own) | (_taxel(good) == own)
    of_others = ((runs >= 0) & (_taxel(runs) != own)) | ((good >= 0) & (_taxel(good) != own))
    own_last, other_last = last_clock(differs & of_own), last_clock(differs & of_others)
    until = played.last if calm else None  # during the swings, a taxel waits for other taxels
    more = counted(config, runs[:until]) - counted(config, good[:until])
    others = np.where(np.arange(len(more))[:, None] >> 1 == own, 0, more)
    answers = _answers(config, runs, played) != _answers(config, good, played)
    odd = (answers & (np.arange(len(more))[:, None, None] >> 1 != own)).any(axis=0)
    tick = np.searchsorted(played.ticks, [clock for clock, _ in part], side="right") - 1
    ticks = np.where(odd.any(axis=0), last_clock(odd) - tick, -1)
    answer = counted(config, good[played.answer :])
    assert answer.reshape(config.taxels, 2).sum(axis=1).all(), "the last swing is not answered by every taxel"
    lasting = np.abs(counted(config, runs[played.answer :]) - answer)
    never = lasting.max(axis=0) > slack(config)
    net = counted(config, runs) - counted(config, good)
    wrong = np.abs(net[1::2] - net[::2])
    kept = np.all(played.stimulus.enable, axis=0, keepdims=True).T  # a mask resets a reference
    counts = kept & (np.arange(config.taxels)[:, None] != own)
    adds_up = config.has_polarity and not config.encoder.leaks and not config.closes  # by one fixed step per event
    off = (wrong * counts).sum(axis=0) if adds_up else np.full(len(part), -1)
    lost, added = missing(others), missing(-others)
    effects = {NEVER: never, CHANGED: lost + added > 0, MOVED: other_last >= 0, OWN: own_last >= 0}
    times = {"own_clocks": since(part, own_last), "other_clocks": since(part, other_last), "ticks": ticks}
    yield from classify_effects(part, effects, **times, lost=lost, added=added, off=off)


def missing(more: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of missing events of each run, from the differences of its counts, shape (events, runs)."""
    return np.asarray(-more.clip(max=0).sum(axis=0))


def _answers(config: ReadoutConfig, codes: NDArray[np.int16], played: Course) -> NDArray[np.int64]:
    """Return the events after each sample tick by taxel and polarity, shape (2 * taxels, ticks, runs)."""
    codes = codes[: played.last]
    return np.stack([np.add.reduceat(codes == kind, played.ticks, axis=0) for kind in range(2 * config.taxels)])


def slack(config: ReadoutConfig) -> int:
    """Return the number of events by which two valid responses of a taxel may differ.

    The reference of LCS comes to the same level from everywhere. That of CW-LCS need not: it is on the way of the
    signal, but a closing step, or less than a code, beside. So is that of N-LCS, whose leak may have another phase.
    """
    return int(config.encoder.late)


def _taxel(codes: NDArray[np.int16]) -> NDArray[np.int16]:
    return np.where(codes >= 0, codes >> 1, -1)


def counted(config: ReadoutConfig, codes: NDArray[np.int16]) -> NDArray[np.int64]:
    """Return the number of events of each taxel and polarity, shape (2 * taxels, runs)."""
    return np.stack([(codes == kind).sum(axis=0) for kind in range(2 * config.taxels)])
