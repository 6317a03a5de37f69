"""What comes of an upset: by what its events differ, how long, and whether the readout is itself again."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flow.faults.bench import DUT, bench_gates
from flow.faults.course import Course, codes_of, course, events_of
from flow.faults.gates import Gates
from flow.faults.lanes import LANES, simulate
from model.config import ReadoutConfig
from model.readout import simulate as simulate_model
from rtl.readout import Readout

NOBODY = -9
"""The taxel of a flop that belongs to none."""
TAXEL = re.compile(r"row_(\d+)\.taxel_(\d+)\.")
CLASSES = ("nothing", "own events", "others moved", "others changed", "never recovers")
"""From the least to the worst: no event differs; those of the flop's own taxel; those of others, in time alone; in
number or address; and the last swing is not answered as ever."""


@dataclass(frozen=True)
class Upset:
    """One upset and its outcome.

    Attributes
    ----------
    flop : str
    clock : int
    outcome : str
        One of ``CLASSES``.
    own_clocks, other_clocks : int
        From the upset to the last clock in which events of its own taxel, or of others, differ; -1 if none does.
    ticks : int
        Sample ticks from the upset to the last that others answer by other events; -1 where they never do.
    lost, added : int
        Events of others that are missing, and that are too many; a wrong address is both.
    """

    flop: str
    clock: int
    outcome: str
    own_clocks: int
    other_clocks: int
    ticks: int
    lost: int
    added: int

    @property
    def block(self) -> str:
        """The block that the flop is in."""
        place = self.flop.rpartition(".")[0]
        if place in ("sequencer", "packer"):
            return "frame_readout"
        return "window" if place.endswith(".window") else "taxel" if TAXEL.match(self.flop) else place or "readout"


class UnlikeModel(AssertionError):
    """The run without upsets is not that of the model."""


def upsets(config: ReadoutConfig, calm: bool, slow: int = 0, stride: int = 1, flops: str = "") -> Iterator[Upset]:
    """Turn every flop of a readout in every clock of a stretch, one in each run; yield what came of it.

    Parameters
    ----------
    config : ReadoutConfig
    calm : bool
        Which course is played.
    slow : int
        Of the receiver.
    stride : int
        Clocks from one upset to the next.
    flops : str
        Pattern of the names of those that are turned.

    Raises
    ------
    UnlikeModel
        If the run without upsets does not give the events of the golden model.
    """
    gates, played = bench_gates(Readout(config), slow), course(config, calm, slow)
    expected = simulate_model(config, played.stimulus)
    inside = [number for number, name in enumerate(gates.flops) if re.match(rf"{DUT}\.{flops}", name)]
    todo = [(clock, flop) for clock in range(played.first, played.last, stride) for flop in inside]
    for start in range(0, len(todo), LANES - 1):
        part = todo[start : start + LANES - 1]
        turned = np.array([(clock, flop, lane) for lane, (clock, flop) in enumerate(part, 1)], np.int64)
        inputs = {name: bits for name, bits in played.inputs.items() if name in gates.inputs}
        traces = simulate(gates, inputs, turned)
        codes = codes_of(config, traces.outputs, played.inputs["event_ready"])
        found = events_of(config, codes[:, 0])
        if not len(expected) or not np.array_equal(found[: len(expected)], expected):
            raise UnlikeModel(f"{config.encoding}, {config.link}: the gates do not give the model's events")
        yield from _judged(config, gates, (played, calm), codes, part)


def own_taxel(config: ReadoutConfig, flop: str) -> int:
    """Return the taxel that a flop belongs to, ``NOBODY`` for a shared one."""
    place = TAXEL.match(flop)
    return int(place[1]) * config.columns + int(place[2]) if place else NOBODY


def _judged(
    config: ReadoutConfig, gates: Gates, run: tuple[Course, bool], codes: NDArray[np.int16], part: list[tuple[int, int]]
) -> Iterator[Upset]:
    """Compare runs with run 0, which had no upset; events are counted until the swings where the course is calm."""
    played, calm = run
    names = [gates.flops[flop].removeprefix(f"{DUT}.") for _, flop in part]
    own = np.array([own_taxel(config, name) for name in names])
    good, runs = codes[:, :1], codes[:, 1 : len(part) + 1]
    differs = runs != good
    of_own = (_taxel(runs) == own) | (_taxel(good) == own)
    of_others = ((runs >= 0) & (_taxel(runs) != own)) | ((good >= 0) & (_taxel(good) != own))
    own_last, other_last = _last(differs & of_own), _last(differs & of_others)
    until = played.last if calm else None  # the swings are no calm course: there a taxel waits for others
    more = _counted(config, runs[:until]) - _counted(config, good[:until])
    others = np.where(np.arange(len(more))[:, None] >> 1 == own, 0, more)
    answers = _answers(config, runs, played) != _answers(config, good, played)
    odd = (answers & (np.arange(len(more))[:, None, None] >> 1 != own)).any(axis=0)
    since = np.searchsorted(played.ticks, [clock for clock, _ in part], side="right") - 1
    ticks = np.where(odd.any(axis=0), _last(odd) - since, -1)
    lasting = np.abs(_counted(config, runs[played.answer :]) - _counted(config, good[played.answer :]))
    never = lasting.max(axis=0) > slack(config)
    for lane, (name, (clock, _)) in enumerate(zip(names, part, strict=True)):
        lost, added = int(-others[:, lane].clip(max=0).sum()), int(others[:, lane].clip(min=0).sum())
        outcome = 4 if never[lane] else 3 if lost or added else 2 if other_last[lane] >= 0 else int(own_last[lane] >= 0)
        own_clocks, other_clocks = (max(int(last[lane]) - clock, -1) for last in (own_last, other_last))
        yield Upset(name, clock, CLASSES[outcome], own_clocks, other_clocks, int(ticks[lane]), lost, added)


def _answers(config: ReadoutConfig, codes: NDArray[np.int16], played: Course) -> NDArray[np.int64]:
    """Return how many events of each taxel and polarity follow each sample tick, shape (2 * taxels, ticks, runs)."""
    codes = codes[: played.last]
    return np.stack([np.add.reduceat(codes == kind, played.ticks, axis=0) for kind in range(2 * config.taxels)])


def slack(config: ReadoutConfig) -> int:
    """Return by how many events of a kind an answer of a taxel may differ that is as good as the other.

    The reference of LCS comes to the same level from everywhere. That of the others need not: it is on the way of the
    signal, but a closing step, or less than a code, beside.
    """
    return 0 if config.encoding == "lcs" else 1


def _taxel(codes: NDArray[np.int16]) -> NDArray[np.int16]:
    return np.where(codes >= 0, codes >> 1, -1)


def _last(happens: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the last clock in which something happens in each run, -1 where it never does."""
    return np.where(happens.any(axis=0), len(happens) - 1 - happens[::-1].argmax(axis=0), -1)


def _counted(config: ReadoutConfig, codes: NDArray[np.int16]) -> NDArray[np.int64]:
    """Return how many events of each taxel and polarity there are, shape (2 * taxels, runs)."""
    return np.stack([(codes == kind).sum(axis=0) for kind in range(2 * config.taxels)])
