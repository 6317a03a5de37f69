"""Verilog as a person writes it."""
