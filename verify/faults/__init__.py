"""Fault injection: bit flips in every flop, hostile inputs, and their effects."""
