"""Measure the coverage of the co-simulation: lines, branches and toggles of the Verilog, functional points."""
