"""Cover the board: its Verilog, a bit-level host, and the checks of its records."""
