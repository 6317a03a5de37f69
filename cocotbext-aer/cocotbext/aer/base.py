"""Common parts of sources, sinks and monitors: queues, pauses, delays, resets, faults."""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from typing import Any, Literal

import cocotb
from cocotb.triggers import Event, First, RisingEdge, Timer, ValueChange
from cocotbext.aer.event import AerEvent

Unit = Literal["step", "fs", "ps", "ns", "us", "ms", "sec"]

Delay = float | Callable[[], float]
"""A delay in the unit of its component, or a function that returns the next delay, for example a random delay."""


class Fault(Enum):
    """Protocol faults that a source or sink can inject."""

    WITHDRAW_REQUEST = "the source takes its request back before it is acknowledged"
    CHANGE_ADDRESS = "the source changes the address while it requests"
    LATE_ADDRESS = "the source sets the address after the request"
    IGNORE_ACK = "the source does not wait for the end of the acknowledge, and its next request may come too early"
    BOTH_REQUESTS = "the source raises ON and OFF together"
    NO_ACK = "the sink does not acknowledge, until released"
    EARLY_ACK = "the sink acknowledges before there is a request"
    WITHDRAW_ACK = "the sink takes its acknowledge back before the request has gone"
    HOLD_ACK = "the sink keeps its acknowledge, until released"


class Component:
    """Component with an event queue and a task, restarted by the reset."""

    FAULTS: tuple[Fault, ...] = ()

    def __init__(self, name: str, reset: Any = None, reset_active_level: bool = True) -> None:
        self.log = logging.getLogger(f"cocotb.{name}")
        self.queue: deque[AerEvent] = deque()
        self._paused = False
        self._changed = Event()  # the queue, the pause or the faults
        self._faults: deque[Fault] = deque()
        self._released = Event()
        self._pauses: Any = None
        self._reset, self._reset_level = reset, int(reset_active_level)
        self._task = cocotb.start_soon(self._run())
        if reset is not None:
            cocotb.start_soon(self._watch_reset())

    @property
    def pause(self) -> bool:
        """True while the component pauses: a source offers nothing, a sink takes nothing."""
        return self._paused

    @pause.setter
    def pause(self, paused: bool) -> None:
        self._paused = bool(paused)
        self._changed.set()

    def count(self) -> int:
        """Return the number of events in the queue."""
        return len(self.queue)

    def empty(self) -> bool:
        """Return True if the queue is empty."""
        return not self.queue

    def clear(self) -> None:
        """Empty the queue."""
        self.queue.clear()

    def set_pause_generator(self, pauses: Iterable[bool], clock: Any) -> None:
        """Set ``pause`` from a sequence, one value per rising clock edge."""
        self.clear_pause_generator()
        self._pauses = cocotb.start_soon(self._pause(iter(pauses), clock))

    def clear_pause_generator(self) -> None:
        """Stop the pause generator."""
        if self._pauses is not None:
            self._pauses.cancel()
        self._pauses = None
        self.pause = False

    def inject(self, fault: Fault) -> None:
        """Inject a fault at the next event.

        Raises
        ------
        ValueError
            If this component cannot do that.
        """
        if fault not in self.FAULTS:
            able = ", ".join(known.name for known in self.FAULTS) or "none"
            raise ValueError(f"{type(self).__name__} cannot inject {fault.name}; it can: {able}")
        self._faults.append(fault)
        self._changed.set()

    def release(self) -> None:
        """End a permanent fault (``NO_ACK``, ``HOLD_ACK``)."""
        self._released.set()

    def _fault(self) -> Fault | None:
        """Return the fault to inject at this event."""
        return self._faults.popleft() if self._faults else None

    async def _pause(self, pauses: Iterator[bool], clock: Any) -> None:
        for self.pause in pauses:
            await RisingEdge(clock)
        self.pause = False

    async def _watch_reset(self) -> None:
        while True:
            if self._reset.value.is_resolvable and int(self._reset.value) == self._reset_level:
                self._task.cancel()
                self._idle()
                while not (self._reset.value.is_resolvable and int(self._reset.value) != self._reset_level):
                    await ValueChange(self._reset)
                self._task = cocotb.start_soon(self._run())
            await ValueChange(self._reset)

    def _idle(self) -> None:
        """Drive the signals of an idle component."""

    async def _run(self) -> None:
        """Run the component forever."""
        raise NotImplementedError


class Sending(Component):
    """Component that sends events."""

    _busy = False

    async def send(self, event: AerEvent | int) -> None:
        """Queue an event."""
        self.send_nowait(event)

    def send_nowait(self, event: AerEvent | int) -> None:
        """Queue an event, or a number as an address."""
        self.queue.append(event if isinstance(event, AerEvent) else AerEvent(event))
        self._changed.set()

    def idle(self) -> bool:
        """Return True if all events are sent and the last handshake is complete."""
        return not self.queue and not self._busy

    async def wait(self) -> None:
        """Wait until all events are sent and the last handshake is complete."""
        while not self.idle():
            await self._changed.wait()
            self._changed.clear()


class Receiving(Component):
    """Component that receives events."""

    async def recv(self) -> AerEvent:
        """Wait for the next event and return it."""
        while not self.queue:
            self._changed.clear()
            await self._changed.wait()
        return self.queue.popleft()

    def recv_nowait(self) -> AerEvent:
        """Return the next event without waiting.

        Raises
        ------
        IndexError
            If none has come.
        """
        return self.queue.popleft()

    async def wait(self, timeout: float | None = None, unit: Unit = "ns") -> None:
        """Wait until an event is available or a timeout expires."""
        if not self.queue:
            self._changed.clear()
            waiting = self._changed.wait()
            await (waiting if timeout is None else First(waiting, Timer(timeout, unit)))

    def _receive(self, event: AerEvent) -> None:
        self.queue.append(event)
        self._changed.set()
        self.log.debug("received %s", event)
