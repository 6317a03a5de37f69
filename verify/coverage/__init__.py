"""Coverage of the co-simulation: lines, branches and toggles of the Verilog, and functional points."""
