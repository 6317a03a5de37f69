"""The four-phase link with a request wire for ON and one for OFF events, as INTUITIVE has."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eskin.base.errors import InputError
from eskin.model.links.four_phase import FourPhase

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class FourPhaseDual(FourPhase):
    """Two request wires; the address has no polarity."""

    name = "four_phase_dual"
    requests = ("aer_req_on", "aer_req_off")

    def check(self, config: ReadoutConfig) -> None:
        if not config.has_polarity:
            raise InputError(
                f"link {self.name} has requests for ON and OFF, but encoding {config.encoding} sends only ON; "
                f"give link {FourPhase.name}"
            )
