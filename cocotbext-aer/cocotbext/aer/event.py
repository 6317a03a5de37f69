"""Events on an AER bus."""

from dataclasses import dataclass, field

from cocotb.utils import get_sim_time


@dataclass(frozen=True)
class AerEvent:
    """An address event.

    Attributes
    ----------
    address : int
        The word on the address wires; 0 where a bus has none.
    polarity : int, optional
        On a bus with two requests: 1 if the ON request carried the event, 0 if the OFF request did.
    time_ps : int
        When the event was offered, in picoseconds of simulated time: REQ rose, or VALID met READY; 0 before that. It
        does not count when events are compared.
    """

    address: int = 0
    polarity: int | None = None
    time_ps: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        if self.address < 0:
            raise ValueError(f"the address of an event must be at least 0, not {self.address}")
        if self.polarity not in (None, 0, 1):
            raise ValueError(f"the polarity of an event must be 0, 1 or None, not {self.polarity}")


def now_ps() -> int:
    """Return the simulated time in picoseconds."""
    return round(get_sim_time("ps"))
