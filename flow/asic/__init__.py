"""Synthesis of the readout to a clock-gated netlist, with proofs, checks and timing."""
