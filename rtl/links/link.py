"""Interface of a link's hardware: ports, their meaning, and the block between arbiter and ports."""

from collections.abc import Callable
from typing import Any, NamedTuple

from eskin.model.config import ReadoutConfig

READY = (1, 0, 1, 1)
"""``event_ready`` of the sink in the delivered testbench, repeated."""

ACK_EIGHTHS = 13
"""From each edge of a request to that of ACK in the delivered testbench, in 1/8 clock."""


class Hardware(NamedTuple):
    """The hardware of a link."""

    ports: Callable[[ReadoutConfig], dict[str, Any]]
    """Return the ports of the readout for the events, as members of a signature, without ports of no bits."""
    meanings: dict[str, str]
    """Meaning of every port; ``{address_bits}`` stands for the meaning of every bit of an address."""
    receiver: Callable[[ReadoutConfig], str]
    """Return the receiver of the delivered testbench, Verilog that calls ``check`` with the clock and {polarity, row,
    column} of every event, and drives the inputs among the ports."""
    block: type[Any] | None = None
    """``Block`` with the arbiter's stream as its input, and the ports; none if the ports are that stream."""
    asynchronous: tuple[str, ...] = ()
    """Inputs without a relation to the clock, which two flops of the block take."""


def joined(ports: list[str]) -> str:
    """Return the concatenation of ports in Verilog; a bit that is 0 if there are none."""
    return f"{{{', '.join(ports)}}}" if ports else "1'b0"
