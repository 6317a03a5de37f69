"""Timing model of the classifier in closed form: clocks of events, of bin ends and of outputs.

Clocks are counted from the end of reset or, after a ``scan_start``, from any clock the caller likes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import Bin, IntegerNetwork, State


@dataclass
class ClassifierRun:
    """Clocks, classes and waiting times of one simulated run of the classifier."""

    accepted: list[int] = field(default_factory=list)  # clock of each event that was taken, the first ones in order
    bins: list[Bin] = field(default_factory=list)  # one for each bin that ended
    ended: list[int] = field(default_factory=list)  # clock of the ``bin_end`` of each bin
    valid: list[int] = field(default_factory=list)  # clock of its ``class_valid``
    overruns: list[int] = field(default_factory=list)
    """Clocks of ``bin_end`` while the work of one before was not done; from the next clock on ``overrun`` is high."""
    stalled: int = 0  # clocks in which an event waited, until the observation ends

    @property
    def latencies(self) -> list[int]:
        """Clocks from each ``bin_end`` to its ``class_valid``."""
        return [valid - ended for ended, valid in zip(self.ended, self.valid, strict=True)]


def first_ready(config: ClassifierConfig, start: int) -> int:
    """Return the first clock with ``event_ready`` high after a ``scan_start`` (``start`` -1: after reset)."""
    return start + config.hidden + config.classes + 3


def work_clocks(config: ClassifierConfig, before: Any, now: Any) -> Any:
    """Return the clocks of work at the end of a bin.

    ``before`` and ``now`` are the spikes of each hidden neuron in the previous and the ending bin, shape (hidden,): 0,
    1 or a mean; or one number for all neurons.
    """
    sizes = [group.end - group.start for group in config.stack]
    words = np.repeat([max(span.words - 1, 0) for span in config.spans], sizes)
    read = np.arange(config.hidden) >= config.stack[-1].start
    before, now = np.broadcast_to(before, config.hidden), np.broadcast_to(now, config.hidden)
    recurrent = config.hidden + (before * words).sum().item()
    outputs = config.hidden + (now * read).sum().item() * (config.classes - 1)
    return recurrent + config.hidden + 2 + outputs + config.classes


def simulate(
    network: IntegerNetwork, offered: Sequence[tuple[int, int]], ends: Sequence[int], clocks: int, start: int = -1
) -> ClassifierRun:
    """Simulate the classifier clock by clock.

    - ``offered``: clock from which each event is offered, in order, after the previous event has been taken; channel.
    - ``ends``: clocks of ``bin_end``, rising.
    - ``clocks``: the observation ends before this clock.
    - ``start``: clock of ``scan_start``; -1 for the end of reset.
    """
    config, run, state = network.config, ClassifierRun(), State(network)
    free = first_ready(config, start)  # first clock in which the next event can be taken

    def offered_since() -> int | None:
        """Return the clock from which the next event is offered, or None without an event."""
        number = len(run.accepted)
        behind = run.accepted[-1] if number else start
        return max(offered[number][0], behind + 1) if number < len(offered) else None

    def take_until(last: int) -> None:
        """Take all events that can be taken up to a clock."""
        nonlocal free
        while (since := offered_since()) is not None and max(since, free) <= last:
            clock = max(since, free)
            run.stalled += clock - since
            run.accepted.append(clock)
            free = clock + config.groups

    early = [end for end in ends if start < end < free]  # while the scan is cleared: the first is kept
    run.overruns += early
    pending = early[:1] + [end for end in ends if end >= free]
    while pending:
        end = pending.pop(0)
        taken = len(run.accepted)
        take_until(min(end, clocks - 1))
        state.add_events([channel for _, channel in offered[taken : len(run.accepted)]])
        first = max(end + 1, free) + 1  # clock in which the work begins
        lost = [late for late in pending if late < first - 1]
        pending = pending[len(lost) :]
        before = state.spikes[0]
        result = state.end_single_bin()
        last = first - 1 + work_clocks(config, before, result.spikes)
        waiting = [late for late in pending if late <= last]
        pending = waiting[:1] + pending[len(waiting) :]
        run.overruns += lost + waiting
        if end < clocks:
            run.ended.append(end)
            run.bins.append(result)
            run.valid.append(last + 2)
        free = last + 1
    take_until(clocks - 1)
    if (since := offered_since()) is not None:
        run.stalled += max(clocks - since, 0)
    return run
