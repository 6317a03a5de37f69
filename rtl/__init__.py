"""The readout in Amaranth, and the generated Verilog."""
