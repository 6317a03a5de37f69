"""Wire model for arrays without a layout."""

from dataclasses import dataclass

from eskin.base.errors import InputError

PITCH_UM = 200.0
"""Default taxel pitch; the area of a taxel is its square."""

OHM_PER_UM = 0.515
"""Metal 2 to 5 of IHP SG13G2 at its least width of 0.20 um: 0.103 ohm per square (LEF of the process)."""

FARAD_PER_UM = 0.2e-15
"""The same wire: 0.093 fF per um to other layers (area and edge capacitance of the LEF), and about as much again for
its neighbours on both sides."""

WITHIN_UM = 20.0
"""Length of the wire to a pin in the same block, for every pin on it."""


@dataclass(frozen=True)
class Wire:
    """Resistance and capacitance of a wire per length."""

    ohm_per_um: float = OHM_PER_UM
    farad_per_um: float = FARAD_PER_UM
    within_um: float = WITHIN_UM  # length of the wire to a pin in the same block

    def __post_init__(self) -> None:
        for option, value, most in (("--ohm", self.ohm_per_um, 1e3), ("--farad", self.farad_per_um, 1e-12)):
            if not 0 <= value <= most:
                raise InputError(f"{option} must be from 0 to {most:g} for each um, not {value:g}")

    def way_s(self, length_um: float, load_f: float) -> float:
        """Return the Elmore delay of a straight wire with a load at its end.

        Examples
        --------
        >>> f"{Wire().way_s(1000, 0):.3g} s of 1 mm"
        '5.15e-11 s of 1 mm'
        """
        return self.ohm_per_um * length_um * (self.farad_per_um * length_um / 2 + load_f)


def check_pitch(pitch_um: float) -> None:
    """Raise InputError for an implausible taxel pitch."""
    if not 1 <= pitch_um <= 1e6:
        raise InputError(f"--pitch must be from 1 to 1000000 um, not {pitch_um:g}")


NO_WIRE = Wire(0.0, 0.0, 0.0)
