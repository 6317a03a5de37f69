"""Wire model for arrays without a layout."""

PITCH_UM = 200.0
"""Default taxel pitch; the area of a taxel is its square."""

FARAD_PER_UM = 0.2e-15
"""Metal 2 to 5 of IHP SG13G2 at its least width of 0.20 um: 0.093 fF per um to other layers (area and edge capacitance
of the LEF), and about as much again for its neighbours on both sides."""

WITHIN_UM = 20.0
"""Length of the wire to a pin in the same block, for every pin on it."""
