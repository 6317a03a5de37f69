"""Functional coverage points: cases of the specification as expressions over Verilog signals."""
