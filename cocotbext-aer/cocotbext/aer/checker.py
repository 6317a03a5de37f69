"""Protocol checkers that report the violated rule, and count how often each rule was exercised."""

from collections import Counter, deque
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import cocotb
from cocotb.triggers import First, ReadOnly, RisingEdge, Timer, ValueChange
from cocotb.utils import get_sim_steps, get_sim_time
from cocotbext.aer.base import Unit
from cocotbext.aer.bus import AerBus, AerStreamBus
from cocotbext.aer.event import now_ps


class Rule(Enum):
    """Rules of four-phase and stream AER."""

    REQUEST_UNKNOWN = "REQ or VALID is 0 or 1"
    ACK_UNKNOWN = "ACK or READY is 0 or 1"
    ADDRESS_UNKNOWN = "every bit of the address is 0 or 1 while it is requested"
    REQUEST_AFTER_RELEASE = "REQ rises only while ACK is low"
    REQUEST_HELD = "REQ stays until ACK is high; VALID stays until READY is high"
    ONE_REQUEST = "ON and OFF never request together"
    ACK_ON_REQUEST = "ACK rises only while REQ is high"
    ACK_HELD = "ACK stays until REQ is low"
    ADDRESS_SETUP = "the address stands for the setup time before REQ rises"
    ADDRESS_HELD = "the address stays for as long as it is promised"
    IN_TIME = "no handshake stands still for longer than the timeout"


@dataclass(frozen=True)
class Violation:
    """A violation of a rule.

    Attributes
    ----------
    rule : Rule
    time_ps : int
    detail : str
        What was seen, and the changes that led to it.
    """

    rule: Rule
    time_ps: int
    detail: str

    def __str__(self) -> str:
        return f"{self.rule.name} at {self.time_ps} ps: {self.detail} ({self.rule.value})"


class AerProtocolError(AssertionError):
    """Raised if a bus violates a rule."""


class _Checker:
    """Common parts of the checkers.

    Attributes
    ----------
    checks : Counter of Rule
        How often each rule was at stake; a rule that never was says nothing about the design.
    violations : list of Violation
    """

    def __init__(self, name: str, reset: Any, reset_active_level: bool, stop: bool) -> None:
        self.checks: Counter[Rule] = Counter()
        self.violations: list[Violation] = []
        self.stop = stop
        self.log = cocotb.log.getChild(name)
        self._reset, self._reset_level = reset, int(reset_active_level)
        self._history: deque[str] = deque(maxlen=8)
        cocotb.start_soon(self._watch())

    def _holds(self, rule: Rule, holds: bool, seen: str) -> None:
        self.checks[rule] += 1
        if holds:
            return
        violation = Violation(rule, now_ps(), f"{seen}; before: {', '.join(self._history) or 'nothing'}")
        self.violations.append(violation)
        if self.stop:
            raise AerProtocolError(str(violation))
        self.log.error("%s", violation)

    def _in_reset(self) -> bool:
        if self._reset is None:
            return False
        value = self._reset.value
        return not value.is_resolvable or int(value) == self._reset_level

    async def _watch(self) -> None:
        raise NotImplementedError


@dataclass(frozen=True)
class _Wires:
    """Levels of a four-phase bus at one time; None stands for X or Z."""

    requests: tuple[bool | None, ...]
    ack: bool | None
    address: str

    @property
    def request(self) -> bool:
        return any(self.requests)

    def __str__(self) -> str:
        levels = "".join("X" if level is None else str(int(level)) for level in self.requests)
        return f"REQ {levels} ACK {'X' if self.ack is None else int(self.ack)} ADDR {self.address or '-'}"


class AerChecker(_Checker):
    """Checker of a four-phase bus, also between clock edges.

    Changes in one instant count as one. Where a change is legal before or after another of the same instant, it is
    legal.

    Parameters
    ----------
    bus : AerBus
    setup : float, optional
        How long the address must stand before REQ rises; with 0 both may change in one instant.
    hold : {"ack", "request", "release"}, optional
        The address must stay until ACK rises, until REQ falls, or until ACK falls.
    timeout : float, optional
        The longest time without a change within a handshake.
    unit : str, optional
        The unit of ``setup`` and ``timeout``.
    reset, reset_active_level : handle, bool, optional
        While it is active nothing is checked, so that it may end a request.
    stop : bool, optional
        Fail the test at the first violation; otherwise log it and go on.
    """

    def __init__(
        self,
        bus: AerBus,
        setup: float = 0,
        hold: Literal["ack", "request", "release"] = "ack",
        timeout: float | None = None,
        unit: Unit = "ns",
        reset: Any = None,
        reset_active_level: bool = True,
        stop: bool = True,
    ) -> None:
        if hold not in ("ack", "request", "release"):
            raise ValueError(f'hold must be "ack", "request" or "release", not {hold!r}')
        self.bus, self.hold = bus, hold
        self._setup = get_sim_steps(setup, unit) if setup else 0
        self._timeout = None if timeout is None else get_sim_steps(timeout, unit)
        super().__init__(f"{bus.ack._path}.AerChecker", reset, reset_active_level, stop)

    async def _watch(self) -> None:
        wires = [*self.bus.requests, self.bus.ack]
        wires += [wire for wire in (self.bus.addr, self._reset) if wire is not None]
        await ReadOnly()
        before, was_reset = self._wires(), self._in_reset()
        address_since: float = -1  # before the start of time
        while True:
            waiting = [ValueChange(wire) for wire in wires]
            active = before.request or before.ack
            timer = Timer(self._timeout, "step") if self._timeout and active and not was_reset else None
            fired = await First(*waiting, *([timer] if timer else []))
            if fired is timer:
                self._holds(Rule.IN_TIME, False, f"{before} for {self._timeout} steps")
                await First(*waiting)
            await ReadOnly()
            now, time = self._wires(), get_sim_time("step")
            self._history.append(f"{now_ps()} ps {now}")
            reset = self._in_reset()
            if not reset and not was_reset:
                self._change(before, now, time - address_since)
            if now.address != before.address:
                address_since = time
            before, was_reset = now, reset

    def _wires(self) -> _Wires:
        address = "" if self.bus.addr is None else str(self.bus.addr.value)
        return _Wires(tuple(self.bus.read(r) for r in self.bus.requests), self.bus.read(self.bus.ack), address)

    def _change(self, before: _Wires, now: _Wires, address_age: float) -> None:
        """Check a change of the signals against the rules."""
        self._holds(Rule.REQUEST_UNKNOWN, None not in now.requests, str(now))
        self._holds(Rule.ACK_UNKNOWN, now.ack is not None, str(now))
        if self.bus.dual:
            self._holds(Rule.ONE_REQUEST, now.requests.count(True) < 2, str(now))
        if self._timeout and (before.request or before.ack):
            self._holds(Rule.IN_TIME, True, str(now))
        raised = any(new and not old for new, old in zip(now.requests, before.requests, strict=True))
        dropped = any(old and new is False for new, old in zip(now.requests, before.requests, strict=True))
        if raised:
            self._holds(Rule.REQUEST_AFTER_RELEASE, not (before.ack and now.ack), f"{before} becomes {now}")
            known = all(bit in "01" for bit in now.address)
            self._holds(Rule.ADDRESS_UNKNOWN, known, str(now))
            age = 0 if now.address != before.address else address_age
            self._holds(Rule.ADDRESS_SETUP, age >= self._setup, f"the address is {age:.0f} steps old as REQ rises")
        if dropped:
            self._holds(Rule.REQUEST_HELD, bool(before.ack or now.ack), f"{before} becomes {now}")
        if now.ack and not before.ack:
            self._holds(Rule.ACK_ON_REQUEST, before.request or now.request, f"{before} becomes {now}")
        if before.ack and now.ack is False:
            self._holds(Rule.ACK_HELD, not (before.request and now.request), f"{before} becomes {now}")
        self._hold_address(before, now)

    def _hold_address(self, before: _Wires, now: _Wires) -> None:
        """Check ADDRESS_HELD: the address must not change while it is valid."""
        until = {
            "ack": not before.ack and now.ack,
            "request": before.request and not now.request,
            "release": before.ack and not now.ack and not now.request,
        }[self.hold]
        promised = {
            "ack": before.request and now.request and not before.ack and not now.ack,
            "request": before.request and now.request,
            "release": (before.request or before.ack) and (now.request or now.ack),
        }[self.hold]
        if promised and now.address != before.address:
            self._holds(Rule.ADDRESS_HELD, False, f"{before} becomes {now}")
        elif until:
            self._holds(Rule.ADDRESS_HELD, True, str(now))


class AerStreamChecker(_Checker):
    """Checker of a stream at every rising clock edge.

    Parameters
    ----------
    bus : AerStreamBus
    clock : handle
    timeout : int, optional
        The most clocks for which an event may wait.
    reset, reset_active_level, stop
        As of ``AerChecker``.
    """

    def __init__(
        self,
        bus: AerStreamBus,
        clock: Any,
        timeout: int | None = None,
        reset: Any = None,
        reset_active_level: bool = True,
        stop: bool = True,
    ) -> None:
        self.bus, self.clock, self.timeout = bus, clock, timeout
        super().__init__(f"{bus.valid._path}.AerStreamChecker", reset, reset_active_level, stop)

    async def _watch(self) -> None:
        waiting, address, clocks = False, None, 0  # an event waits since the edge before, with this address
        while True:
            await RisingEdge(self.clock)
            if self._in_reset():
                waiting = False
                continue
            valid, ready = (wire.value for wire in (self.bus.valid, self.bus.ready))
            now = self.bus.address()
            self._history.append(f"{now_ps()} ps VALID {valid} READY {ready} ADDR {'X' if now is None else now}")
            self._holds(Rule.REQUEST_UNKNOWN, valid.is_resolvable, f"VALID is {valid}")
            if valid.is_resolvable and int(valid):
                self._holds(Rule.ACK_UNKNOWN, ready.is_resolvable, f"READY is {ready}")
                self._holds(Rule.ADDRESS_UNKNOWN, now is not None, "a bit of the payload is X or Z")
            if waiting:
                self._holds(Rule.REQUEST_HELD, valid.is_resolvable and int(valid) == 1, f"VALID is {valid}")
                self._holds(Rule.ADDRESS_HELD, now == address, f"the payload goes from {address} to {now}")
            moves = ready.is_resolvable and int(ready) == 1
            waiting = valid.is_resolvable and int(valid) == 1 and not moves
            address, clocks = now, clocks + 1 if waiting else 0
            if self.timeout and waiting:
                self._holds(Rule.IN_TIME, clocks <= self.timeout, f"an event has waited for {clocks} clocks")
