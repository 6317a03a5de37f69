"""Clock gates in the delivered Verilog."""
