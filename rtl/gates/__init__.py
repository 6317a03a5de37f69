"""Clock gating of the generated Verilog."""
