"""Upsets of single flops and hostile surroundings: what the readout does then, and when it is itself again."""
