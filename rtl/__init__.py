"""The readout in Amaranth, and its Verilog."""
