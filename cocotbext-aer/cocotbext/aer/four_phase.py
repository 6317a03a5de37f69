"""Source, sink and monitor of a four-phase bus, without a clock."""

from typing import Any

from cocotb.triggers import First, ReadOnly, RisingEdge, Timer, ValueChange
from cocotb.utils import get_sim_steps
from cocotbext.aer.base import Component, Delay, Fault, Receiving, Sending, Unit
from cocotbext.aer.bus import AerBus
from cocotbext.aer.event import AerEvent, now_ps


class _FourPhase(Component):
    """Waits and delays of a four-phase component.

    Parameters
    ----------
    bus : AerBus
    clock : handle, optional
        Outputs change at its rising edges, and delays count clocks. Without it they change at any time.
    unit : str, optional
        The unit of delays without a clock.
    reset, reset_active_level : handle, bool, optional
        While it is active the component drives an idle bus, and the handshake under way is given up.
    """

    def __init__(
        self,
        bus: AerBus,
        clock: Any = None,
        unit: Unit = "ns",
        reset: Any = None,
        reset_active_level: bool = True,
    ) -> None:
        self.bus, self.clock, self.unit = bus, clock, unit
        super().__init__(f"{bus.ack._path}.{type(self).__name__}", reset, reset_active_level)

    async def _delay(self, delay: Delay) -> None:
        """Wait for a delay: at least one clock, or without a clock at least one simulator time step."""
        length = delay() if callable(delay) else delay
        if self.clock is None:
            await Timer(max(get_sim_steps(length, self.unit, round_mode="round"), 1), "step")
            return
        for _ in range(max(round(length), 1)):
            await RisingEdge(self.clock)

    async def _until_ack(self, active: bool) -> None:
        while self.bus.read(self.bus.ack) is not active:
            await ValueChange(self.bus.ack)

    async def _until_request(self, active: bool) -> None:
        while self._requested() is not active:
            await First(*(ValueChange(request) for request in self.bus.requests))

    def _requested(self) -> bool:
        return any(self.bus.read(request) for request in self.bus.requests)

    def _offered(self) -> AerEvent:
        """Return the event on the bus.

        Raises
        ------
        ValueError
            If a bit of its address is X or Z.
        """
        address = 0
        if self.bus.addr is not None:
            value = self.bus.addr.value
            if not value.is_resolvable:
                raise ValueError(f"the address is {value} while the bus requests, at {now_ps()} ps")
            address = int(value)
        polarity = None
        if self.bus.dual and not all(self.bus.read(request) for request in self.bus.requests):
            polarity = int(self.bus.read(self.bus.requests[1]) is True)
        return AerEvent(address, polarity, now_ps())

    def _set(self, handle: Any, active: bool) -> None:
        handle.value = self.bus.level(active)


class AerSource(_FourPhase, Sending):
    """Source: sets the address, raises REQ, waits for ACK, lowers REQ, waits until ACK is low.

    Parameters
    ----------
    setup, hold, gap : float or function, optional
        Delays from address to REQ, from ACK to the end of REQ, and from the end of ACK to the next address.
    bus, clock, unit, reset, reset_active_level
        As of every four-phase component.
    """

    FAULTS = (
        Fault.WITHDRAW_REQUEST,
        Fault.CHANGE_ADDRESS,
        Fault.LATE_ADDRESS,
        Fault.IGNORE_ACK,
        Fault.BOTH_REQUESTS,
    )

    def __init__(self, bus: AerBus, setup: Delay = 1, hold: Delay = 1, gap: Delay = 1, **options: Any) -> None:
        self.setup, self.hold, self.gap = setup, hold, gap
        super().__init__(bus, **options)

    def _idle(self) -> None:
        self._busy = self._hasty = False  # hasty: the next event does not wait for the end of ACK
        self._drop()
        if self.bus.addr is not None:
            self.bus.addr.value = 0
        self._changed.set()

    async def _run(self) -> None:
        self._idle()
        while True:
            while self.pause or not self.queue:
                self._changed.clear()
                await self._changed.wait()
            self._busy = True
            await self._send(self.queue.popleft(), self._fault())
            self._busy = False
            self._changed.set()
            await self._delay(self.gap)

    async def _send(self, event: AerEvent, fault: Fault | None) -> None:
        if not self._hasty:
            await self._until_ack(False)
        self._hasty = fault is Fault.IGNORE_ACK
        if fault is not Fault.LATE_ADDRESS:
            self._drive_address(event.address)
            await self._delay(self.setup)
        for request in self.bus.requests if fault is Fault.BOTH_REQUESTS else (self.bus.request_of(event),):
            self._set(request, True)
        if fault is Fault.LATE_ADDRESS:
            await self._delay(0)
            self._drive_address(event.address)
        elif fault is Fault.CHANGE_ADDRESS:
            await self._delay(0)
            self._drive_address(event.address ^ 1)
        elif fault is Fault.WITHDRAW_REQUEST:
            await self._delay(0)
            self._drop()
            return
        await self._until_ack(True)
        await self._delay(self.hold)
        self._drop()
        if not self._hasty:
            await self._until_ack(False)

    def _drive_address(self, address: int) -> None:
        if self.bus.addr is not None:
            self.bus.addr.value = address
        elif address:
            raise ValueError(f"address {address} cannot be sent: the bus has no address wires")

    def _drop(self) -> None:
        for request in self.bus.requests:
            self._set(request, False)


class AerSink(_FourPhase, Receiving):
    """Sink: reads the address when REQ rises, and answers with ACK; ``pause`` delays ACK.

    An event is received when it is acknowledged; its time is that of the request.

    Parameters
    ----------
    ack_delay, release_delay : float or function, optional
        Delays from REQ to ACK, and from the end of REQ to the end of ACK.
    bus, clock, unit, reset, reset_active_level
        As of every four-phase component.
    """

    FAULTS = (Fault.NO_ACK, Fault.EARLY_ACK, Fault.WITHDRAW_ACK, Fault.HOLD_ACK)

    def __init__(self, bus: AerBus, ack_delay: Delay = 1, release_delay: Delay = 1, **options: Any) -> None:
        self.ack_delay, self.release_delay = ack_delay, release_delay
        self.busy = False
        super().__init__(bus, **options)

    def _idle(self) -> None:
        self.busy = False
        self._set(self.bus.ack, False)

    async def _run(self) -> None:
        self._idle()
        while True:
            while not self._requested():
                if self._faults and self._faults[0] is Fault.EARLY_ACK:
                    self._faults.popleft()
                    await self._pulse(True)
                    continue
                self._changed.clear()
                await First(*(ValueChange(request) for request in self.bus.requests), self._changed.wait())
            self.busy = True
            await self._take()
            self.busy = False

    async def _take(self) -> None:
        """Answer a request with ACK."""
        await ReadOnly()  # address and request may change in the same instant
        if not self._requested():
            await self._delay(0)
            return
        event = self._offered()
        fault = self._fault()
        while self.pause:
            self._changed.clear()
            await self._changed.wait()
        if fault is Fault.NO_ACK:
            await self._until_released()
        await self._delay(self.ack_delay)
        self._set(self.bus.ack, True)
        self._receive(event)
        if fault is Fault.WITHDRAW_ACK:
            await self._delay(0)
            await self._pulse(False)
        await self._until_request(False)
        if fault is Fault.HOLD_ACK:
            await self._until_released()
        await self._delay(self.release_delay)
        self._set(self.bus.ack, False)

    async def _pulse(self, active: bool) -> None:
        self._set(self.bus.ack, active)
        await self._delay(0)
        self._set(self.bus.ack, not active)
        await self._delay(0)

    async def _until_released(self) -> None:
        await self._released.wait()
        self._released.clear()


class AerMonitor(_FourPhase, Receiving):
    """Monitor that records the event at every rising REQ."""

    async def _run(self) -> None:
        while True:
            await self._until_request(True)
            await ReadOnly()
            if self._requested():
                self._receive(self._offered())
            await self._until_request(False)
