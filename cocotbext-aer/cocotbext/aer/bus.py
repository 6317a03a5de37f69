"""Signals of an AER bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cocotbext.aer.event import AerEvent

REQUESTS = ("req_on", "req_off")


def _signal(entity: Any, name: str) -> Any:
    """Return the signal of an entity with a name, as it is or in capitals; None if there is none."""
    found = getattr(entity, name, None)
    return getattr(entity, name.upper(), None) if found is None else found


class AerBus:
    """Four-phase bus with one or two requests, an acknowledge, and a bundled address.

    Parameters
    ----------
    ack : handle
        The acknowledge.
    req : handle, optional
        The request of a bus that has one.
    req_on, req_off : handle, optional
        The requests of a bus that has one for each polarity.
    addr : handle, optional
        The address; a bus between single cells has none.
    active_low : bool, optional
        Requests and acknowledge are active low, as on many chips.

    Raises
    ------
    ValueError
        Without a request, or with one request and two.
    """

    def __init__(
        self,
        ack: Any,
        req: Any = None,
        req_on: Any = None,
        req_off: Any = None,
        addr: Any = None,
        active_low: bool = False,
    ) -> None:
        dual = (req_on is not None, req_off is not None)
        if not (dual == (False, False) if req is not None else dual == (True, True)):
            raise ValueError("an AER bus has either req, or req_on and req_off")
        self.ack, self.addr, self.active_low = ack, addr, active_low
        self.requests: tuple[Any, ...] = (req,) if req is not None else (req_off, req_on)

    @classmethod
    def from_prefix(cls, entity: Any, prefix: str = "", active_low: bool = False) -> AerBus:
        """Return the bus with signals ``{prefix}_req`` (or ``_req_on``, ``_req_off``), ``_ack`` and ``_addr``.

        A name may also be in capitals: ``AERIN_REQ``.

        Raises
        ------
        AttributeError
            If the entity has no such acknowledge or request.
        """
        start = f"{prefix}_" if prefix else ""
        found = {name: _signal(entity, start + name) for name in ("req", *REQUESTS, "ack", "addr")}
        for name in ("ack", "req"):
            if found[name] is None and not (name == "req" and all(found[one] is not None for one in REQUESTS)):
                raise AttributeError(
                    f"{entity._path} has no signal {start}{name} or {(start + name).upper()}; give signals of other "
                    f"names as AerBus(req=..., ack=..., addr=...)"
                )
        return cls(**found, active_low=active_low)

    @classmethod
    def from_entity(cls, entity: Any, active_low: bool = False) -> AerBus:
        """Return the bus with signals ``req`` (or ``req_on``, ``req_off``), ``ack`` and ``addr``."""
        return cls.from_prefix(entity, active_low=active_low)

    @property
    def dual(self) -> bool:
        """True if the bus has two requests."""
        return len(self.requests) == 2

    def level(self, active: bool) -> int:
        """Return the signal level for an active or inactive request or acknowledge."""
        return int(active) ^ int(self.active_low)

    def request_of(self, event: AerEvent) -> Any:
        """Return the request signal for an event."""
        if not self.dual:
            return self.requests[0]
        if event.polarity is None:
            raise ValueError(f"{event} needs a polarity: the bus has two requests")
        return self.requests[event.polarity]

    def read(self, handle: Any) -> bool | None:
        """Return True if a request or acknowledge is active, and None for a level of X or Z."""
        value = handle.value
        return bool(int(value) ^ int(self.active_low)) if value.is_resolvable else None


class AerStreamBus:
    """Clocked bus that transfers an event in each clock with VALID and READY high.

    Parameters
    ----------
    valid, ready : handle
    fields : mapping of str to handle
        The parts of the address, the lowest bits first: ``{"col": ..., "row": ..., "polarity": ...}``.
    """

    def __init__(self, valid: Any, ready: Any, fields: Mapping[str, Any]) -> None:
        self.valid, self.ready, self.fields = valid, ready, dict(fields)

    @classmethod
    def from_prefix(cls, entity: Any, prefix: str, fields: Sequence[str] = ("addr",)) -> AerStreamBus:
        """Return the bus with signals ``{prefix}_valid``, ``{prefix}_ready`` and ``{prefix}_{field}``.

        Raises
        ------
        AttributeError
            If a signal is missing.
        """
        names = ("valid", "ready", *fields)
        found = {name: _signal(entity, f"{prefix}_{name}") for name in names}
        if missing := [f"{prefix}_{name}" for name in names if found[name] is None]:
            raise AttributeError(
                f"{entity._path} has no signal {', '.join(missing)}, also not in capitals; give signals of other names "
                f"as AerStreamBus(valid, ready, fields)"
            )
        return cls(found["valid"], found["ready"], {name: found[name] for name in fields})

    def pack(self, **values: int) -> int:
        """Return the address for field values."""
        address = shift = 0
        for name, handle in self.fields.items():
            value = values.pop(name)
            if not 0 <= value < 1 << len(handle):
                raise ValueError(f"{name} must fit in {len(handle)} bits, not {value}")
            address |= value << shift
            shift += len(handle)
        if values:
            raise ValueError(f"the bus has no field {', '.join(values)}")
        return address

    def unpack(self, address: int) -> dict[str, int]:
        """Return the field values for an address."""
        values = {}
        for name, handle in self.fields.items():
            values[name] = address & (1 << len(handle)) - 1
            address >>= len(handle)
        if address:
            raise ValueError(f"the address has {address.bit_length()} bits more than the bus")
        return values

    def address(self) -> int | None:
        """Return the address on the bus, or None if a bit is X or Z."""
        values = {name: handle.value for name, handle in self.fields.items()}
        if not all(value.is_resolvable for value in values.values()):
            return None
        return self.pack(**{name: int(value) for name, value in values.items()})
