"""What the runs of the co-simulation reach: lines, branches and toggles of the Verilog, points of the specification."""
