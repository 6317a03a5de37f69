"""Formal proofs of the RTL, block by block."""
