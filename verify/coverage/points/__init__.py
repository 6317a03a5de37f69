"""Functional points: what the specification speaks of, as expressions over names of the Verilog."""
