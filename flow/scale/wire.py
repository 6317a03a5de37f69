"""What the wires of an array are like."""

from __future__ import annotations

from dataclasses import dataclass

SIZES = "4x4,8x8,12x16,16x16,32x32,64x64"

PITCH_UM = 200.0
"""Of the taxels."""

OHM_PER_UM = 0.515
"""Metal 2 to 5 of IHP SG13G2 at its least width of 0.20 um: 0.103 ohm per square (LEF of the process)."""

FARAD_PER_UM = 0.2e-15
"""The same wire: 0.093 fF per um to other layers (area and edge capacitance of the LEF), and about as much again for
its neighbours on both sides. ``flow.power.wires`` takes the same."""

WITHIN_UM = 20.0
"""Length of the wire to a pin in the same block."""


@dataclass(frozen=True)
class Wire:
    """What a wire is like.

    Attributes
    ----------
    ohm_per_um, farad_per_um : float
    within_um : float
        Length of the wire to a pin in the same block.
    """

    ohm_per_um: float = OHM_PER_UM
    farad_per_um: float = FARAD_PER_UM
    within_um: float = WITHIN_UM

    def way_s(self, length_um: float, load_f: float) -> float:
        """Return the Elmore delay of a straight wire with a load at its end.

        Examples
        --------
        >>> f"{Wire().way_s(1000, 0):.3g} s of 1 mm"
        '5.15e-11 s of 1 mm'
        """
        return self.ohm_per_um * length_um * (self.farad_per_um * length_um / 2 + load_f)


NO_WIRE = Wire(0.0, 0.0, 0.0)
