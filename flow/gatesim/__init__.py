"""Gate-level simulation of the readout with behavioural models of library cells."""
