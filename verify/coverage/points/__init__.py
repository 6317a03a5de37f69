"""Define functional points: cases of the specification, as expressions over Verilog names."""
