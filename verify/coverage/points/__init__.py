"""Functional points of the delivered modules: cover statements in SystemVerilog."""
