"""Source, sink and monitor of a clocked stream of events."""

from typing import Any

from cocotb.triggers import RisingEdge
from cocotbext.aer.base import Component, Fault, Receiving, Sending
from cocotbext.aer.bus import AerStreamBus
from cocotbext.aer.event import AerEvent, now_ps


class _Stream(Component):
    """Component that samples the bus at every rising clock edge.

    Parameters
    ----------
    bus : AerStreamBus
    clock : handle
    reset, reset_active_level : handle, bool, optional
        While it is active the component drives an idle bus.
    """

    def __init__(self, bus: AerStreamBus, clock: Any, reset: Any = None, reset_active_level: bool = True) -> None:
        self.bus, self.clock = bus, clock
        super().__init__(f"{bus.valid._path}.{type(self).__name__}", reset, reset_active_level)

    def _moves(self) -> bool:
        """Return True if an event is transferred at this edge."""
        return _high(self.bus.valid) and _high(self.bus.ready)

    def _event(self) -> AerEvent:
        address = self.bus.address()
        if address is None:
            raise ValueError(f"a bit of the payload is X or Z while VALID is high, at {now_ps()} ps")
        return AerEvent(address, time_ps=now_ps())


class AerStreamSource(_Stream, Sending):
    """Source: holds VALID and the payload until READY is high; ``pause`` stops new events."""

    FAULTS = (Fault.WITHDRAW_REQUEST, Fault.CHANGE_ADDRESS)

    def _idle(self) -> None:
        self._busy = False
        self.bus.valid.value = 0
        self._changed.set()

    async def _run(self) -> None:
        self._idle()
        await RisingEdge(self.clock)
        while True:
            while self.pause or not self.queue:
                await RisingEdge(self.clock)
            event, fault = self.queue.popleft(), self._fault()
            self._busy = True
            self._drive(event.address)
            self.bus.valid.value = 1
            await RisingEdge(self.clock)
            while not self._moves():
                if fault is Fault.WITHDRAW_REQUEST:
                    break
                if fault is Fault.CHANGE_ADDRESS:
                    self._drive(event.address ^ 1)
                await RisingEdge(self.clock)
            self._idle()

    def _drive(self, address: int) -> None:
        for name, value in self.bus.unpack(address).items():
            self.bus.fields[name].value = value


class AerStreamSink(_Stream, Receiving):
    """Sink: drives READY high unless paused."""

    def _idle(self) -> None:
        self.bus.ready.value = 0

    async def _run(self) -> None:
        self._idle()
        while True:
            await RisingEdge(self.clock)
            if self._moves():
                self._receive(self._event())
            self.bus.ready.value = int(not self.pause)


class AerStreamMonitor(_Stream, Receiving):
    """Monitor that records every transferred event."""

    async def _run(self) -> None:
        while True:
            await RisingEdge(self.clock)
            if self._moves():
                self._receive(self._event())


def _high(handle: Any) -> bool:
    return handle.value.is_resolvable and int(handle.value) == 1
