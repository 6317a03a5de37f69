"""Coverage of the board: its Verilog, a bit-level host, and checks of its records."""
