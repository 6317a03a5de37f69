"""Interface of a link's hardware: ports, their meaning, and the block between arbiter and ports."""

from collections.abc import Callable
from typing import Any, NamedTuple

from eskin.model.config import ReadoutConfig


class Hardware(NamedTuple):
    """The hardware of a link."""

    ports: Callable[[ReadoutConfig], dict[str, Any]]
    """Return the ports of the readout for the events, as members of a signature, without ports of no bits."""
    meanings: dict[str, str]
    """Meaning of every port; ``{address_bits}`` stands for the meaning of every bit of an address."""
    block: type[Any] | None = None
    """``Block`` with the arbiter's stream as its input, and the ports; none if the ports are that stream."""
    asynchronous: tuple[str, ...] = ()
    """Inputs without a relation to the clock, which two flops of the block take."""
