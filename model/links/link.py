"""Interface of a link: its wires, its times, and its step in the model.

The functions under "compiled" are plain Python that Numba understands; ``eskin.model.links.compiled`` compiles them.
Numba selects the link by the type of ``rule``, so every protocol needs its own rule class with a unique name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a configuration knows its link, so no link imports the configuration
    from eskin.model.config import ReadoutConfig

Read = Callable[[str], Any]
"""Returns the value of a port: a number, an array of numbers, or an Amaranth value."""
Bits = Callable[[Any, int, int], Any]
"""Returns the bits of a value from a bit on: their lowest bit and their number."""

ACK_QUANTA = 8
"""Time quanta per clock, the unit of the delays of an asynchronous receiver."""

NOTHING = -1
"""Number in the place of an event, 2 * taxel + polarity, where there is none."""


class Sink(NamedTuple):
    """The receiver of events, as in ``eskin.model.readout.Stimulus``.

    ``ack_delay`` are the delays from each edge of a request to that of ACK in 1/8 clock, used cyclically; never a
    multiple of 8, so ACK does not change at a clock edge.
    """

    ready: NDArray[np.uint8]
    ack_delay: NDArray[np.int64]


class Timing(NamedTuple):
    """Constants of a link for the compiled functions."""

    late: int
    """1: an event leaves at the edge that ends a clock, and is seen in the next clock; 0: within the clock."""


class Shown(NamedTuple):
    """An event on the wires of a link, as values of the same kind as those of the ports."""

    high: tuple[Any, ...]  # of these, one is 1 while the wires show an event
    row: Any
    column: Any
    polarity: Any


def parts(config: ReadoutConfig, event: int) -> tuple[int, int, int]:
    """Return row, column and polarity of an event, 2 * taxel + polarity."""
    return *divmod(event >> 1, config.columns), event & 1


def shifted(word: Any, low: int, width: int) -> Any:
    """Return ``width`` bits of a number, or of an array of numbers, from bit ``low`` on."""
    return word >> low & (1 << width) - 1


class Link(ABC):
    """The protocol by which events leave the readout."""

    name: ClassVar[str]  # in configurations and commands
    title: ClassVar[str]  # in datasheets
    leaves: ClassVar[str]  # when an event leaves, in datasheets
    at_best: ClassVar[str]  # the receiver for which ``clocks_per_event`` holds, in datasheets
    clocks_per_event: ClassVar[int]  # docs/design/microarchitecture.md
    holds: ClassVar[int]  # events in registers of the link
    streams: ClassVar[bool] = False  # the ports are the arbiter's own stream, with ready in the clock of the transfer
    address: ClassVar[tuple[str, ...]]  # ports with the address of the event
    requests: ClassVar[tuple[str, ...]] = ()
    """Request wires to an asynchronous receiver, which answers every edge with ACK; of two, the first is that of ON."""
    Rule: ClassVar[type[Any]]  # a subclass of ``Timing``; links with the same compiled functions share it

    @property
    def asynchronous(self) -> bool:
        """True if the receiver has no clock, and answers requests with ACK."""
        return bool(self.requests)

    @property
    def request_has_polarity(self) -> bool:
        """True if the request wire names the polarity, which then is no bit of the address."""
        return len(self.requests) > 1

    # -- of a configuration ----------------------------------------------------------------------

    def check(self, config: ReadoutConfig) -> None:  # noqa: B027 (most links take every configuration)
        """Raise InputError for a configuration that this link does not support."""

    @abstractmethod
    def shown(self, config: ReadoutConfig, read: Read, bits: Bits = shifted) -> Shown:
        """Return the event that the wires show; ``read`` returns 0 for a port that would have no bit.

        An event leaves in every clock in which a wire is high, or if the link is late, in the clock before it rises.
        """

    @abstractmethod
    def levels(self, config: ReadoutConfig, state: Any, sink: Sink, clock: int, offered: int) -> dict[str, int | None]:
        """Return the level of every port in a clock, in the order of datasheets; None for an arbitrary address.

        ``offered`` is the event that the arbiter offers in this clock, or ``NOTHING``.
        """

    def rule(self) -> Any:
        """Return the constants of the link."""
        return self.Rule()

    @abstractmethod
    def new_state(self) -> NDArray[np.int64]:
        """Return the state of the link after reset."""

    # -- compiled --------------------------------------------------------------------------------

    @staticmethod
    @abstractmethod
    def ready(rule: Any, state: Any, sink: Any, clock: int) -> bool:
        """Return True if the link takes an event that is offered in this clock."""

    @staticmethod
    @abstractmethod
    def advance(rule: Any, state: Any, sink: Any, clock: int, taken: int) -> int:
        """Advance the link by the edge that ends a clock; return the event that leaves, or ``NOTHING``.

        ``taken`` is the event that the link takes in this clock, or ``NOTHING``.
        """

    @staticmethod
    @abstractmethod
    def rests(rule: Any, state: Any) -> bool:
        """Return True if the state stays as it is until the link takes an event."""
