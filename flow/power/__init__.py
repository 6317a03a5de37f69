"""Compute the power of a netlist from the activity of its nets."""
